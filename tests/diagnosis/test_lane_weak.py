"""Lane keeping on weak data: a verdict, never an exception, and no name."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.ui.cli import main
from canid.values.findings import Verdict
from canid.values.types import NAN, Array, LearnGate, Trace
from tests.plants.lane_drives import CLEAN, LaneDrive, make


def cut(trace: Trace, n: int) -> Trace:
    """The first samples."""
    return trace._replace(
        t=trace.t[:n], output=trace.output[:n], inputs=trace.inputs[:n], gate=trace.gate[:n], learn=trace.learn[:n],
        segment=trace.segment[:n], signals={role: x[:n] for role, x in trace.signals.items()},
    )  # fmt: skip


def steered(trace: Trace, angle: Array) -> Trace:
    """Another steering angle."""
    return trace._replace(output=angle, signals=trace.signals | {"steering_angle": angle})


def offset(trace: Trace, y: Array) -> Trace:
    """Another lateral offset."""
    return trace._replace(inputs=y[:, None], signals=trace.signals | {"lateral_offset": y})


WEAK: dict[str, Callable[[Trace, np.random.Generator], Trace]] = {
    "nothing": lambda trace, _: cut(trace, 0),
    "one sample": lambda trace, _: cut(trace, 1),
    "20 s": lambda trace, _: cut(trace, 200),
    "a wheel at rest": lambda trace, _: steered(trace, np.zeros(trace.t.size)),
    "no steering angle": lambda trace, _: steered(trace, np.full(trace.t.size, NAN)),
    "a wheel of noise": lambda trace, rng: steered(trace, rng.normal(0, 1, trace.t.size)),
    "no lateral offset": lambda trace, _: offset(trace, np.full(trace.t.size, NAN)),
    "a dead camera": lambda trace, _: offset(trace, np.zeros(trace.t.size)),
    "the gate shut": lambda trace, _: trace._replace(gate=(LearnGate.STANDSTILL,) * trace.t.size),
}


@pytest.mark.parametrize("kind", WEAK)
def test_weak_data_give_a_verdict_and_no_name(kind: str, seed: int) -> None:
    whole = make(LaneDrive("one", CLEAN, seed, 4.0)).trace
    report = canid.diagnose(WEAK[kind](whole, np.random.default_rng(seed)))
    assert not [finding for finding in report.findings if not finding.surrogate], report.says
    assert report.verdict in (Verdict.NOT_ENOUGH_DATA, Verdict.UNEXPLAINED), report.says
    assert report.says


def test_a_wheel_in_steps_larger_than_twice_its_motion_decides_nothing(seed: int) -> None:
    """Such a wheel stands still whoever turns it: no attention gap, and no gain of a rounding."""
    whole = make(LaneDrive("one", CLEAN, seed, 4.0)).trace
    width = 2.5 * float(np.std(whole.output))
    report = canid.diagnose(steered(whole, width * np.rint(whole.output / width)))
    assert (report.verdict, report.findings) == (Verdict.NOT_ENOUGH_DATA, ())
    assert "steps" in report.says


@pytest.mark.slow("diagnoses planted drives")
def test_the_shipped_log_of_lane_keeping_through_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, page = tmp_path / "lane.json", tmp_path / "lane.html"
    words = ["diagnose", "replay_logs/lane_keeping.blf", "--vehicle", "generic_lane", "--details"]
    assert main([*words, "--json", str(out), "--report", str(page)]) == 0
    report = json.loads(out.read_text())
    assert report["output"] == "steering_angle"
    assert report["verdict"] in ("adequate", "named", "one_of", "unexplained", "not_enough_data")
    assert "lateral offset" in capsys.readouterr().out
    # plotly.js is packed: the page has its plots as data
    figures = re.search(
        r'<script type="application/json" id="figures">(.*?)</script>', page.read_text(), re.S
    )
    drawn = json.loads(figures[1]) if figures else {}
    assert drawn
    assert all(figure["data"] for figure in drawn.values())
