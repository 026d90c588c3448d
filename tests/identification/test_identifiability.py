"""One rule decides what may be quoted of a channel; what may not is given for what it is worth."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import canid
from canid.analysis.drive import identification_json
from canid.mathematics.identification import identifiability
from canid.mathematics.identification.identifiability import QUOTABLE
from canid.ui.views.diagnosis_report import diagnosis_json, diagnosis_parts, diagnosis_text
from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.values.findings import Report
from canid.values.text import json_values
from canid.values.types import NAN, Channel, Identifiable, Interval
from tests import seeds
from tests.plants import plant_one
from tests.plants.measurement import trace as sensed_trace

ROOT = Path(__file__).parents[2]
LOGS = sorted(path for path in (ROOT / "replay_logs").glob("*.[ba][ls][fc]"))
FIELDS = ("K", "tau", "dead_time", "tau_plus_dead_time")
# simulated drives: a lively one, one whose lead hardly changes, and one that is short
DRIVES = (("mixed", 6.0, 7), ("motorway", 4.0, 8), ("urban", 2.0, 9))


def test_only_one_module_gives_a_channel_its_status() -> None:
    """Every other module that makes a channel makes an empty one."""
    made = []
    for path in sorted([*(ROOT / "canid").rglob("*.py"), *(ROOT / "canid_study").rglob("*.py")]):
        # the second one reads a status that canid has written
        if path.name in ("identifiability.py", "drive_json.py"):
            continue
        text = path.read_text(encoding="utf-8")
        # what is not written is not called
        if "Channel" not in text and "Identifiable" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            name = node.func if isinstance(node, ast.Call) else None
            if isinstance(name, ast.Name) and name.id == "Channel" and isinstance(node, ast.Call):
                made += [path.name] if node.args or node.keywords else []
            if isinstance(node, ast.keyword) and node.arg == "status" and path.name != "identifiability.py":
                value = ast.unparse(node.value)
                made += [path.name] if value.startswith("Identifiable") else []
    assert not made


def test_a_number_that_is_not_finite_is_not_quoted() -> None:
    K, one, gone = Interval(5.0, 4.0, 6.0), Interval(0.5, 0.4, 0.6), Interval()
    for tau in (one, gone):
        found = identifiability.channel(Identifiable.OK, K, tau, one, one)
        assert found.status is (Identifiable.OK if tau is one else Identifiable.NOT)


@pytest.mark.parametrize("sd", [NAN, 0.01, 0.15, 5.0])
def test_unknown_deviations_withhold(sd: float) -> None:
    K = Interval(5.0, 4.0, 6.0)
    status = identifiability.judge(K, 0.5, sd, sd, sd)
    expected = {0.01: Identifiable.OK, 0.15: Identifiable.SUM_ONLY}
    assert status is expected.get(sd, Identifiable.GAIN_ONLY)
    assert identifiability.judge(Interval(5.0, -1.0, 6.0), 0.5, sd, sd, sd) is Identifiable.NOT


def assert_given(channel: Channel) -> None:
    """Where K is estimated, all four are, in order and inside their limits."""
    for field in FIELDS:
        interval = getattr(channel, field)
        if field in QUOTABLE[channel.status] or math.isfinite(channel.K.value):
            assert all(map(math.isfinite, interval)), (field, channel)
            assert interval.low <= interval.value <= interval.high
            assert field == "K" or interval.low >= 0.0
    if channel.status is not Identifiable.NOT:
        assert channel.tau_plus_dead_time.low <= channel.tau.high + channel.dead_time.high + 1e-6


def channels(value: Any) -> Iterator[dict[str, Any]]:
    """Every channel in a JSON value."""
    if isinstance(value, dict):
        if {"K", "tau", "dead_time", "status"} <= set(value):
            yield value
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            yield from channels(each)


def assert_json_gives(value: Any) -> None:
    """Null only where nothing was estimated."""
    for channel in channels(value):
        quotable = QUOTABLE[Identifiable(channel["status"])]
        for field in FIELDS:
            numbers = [channel[field][end] for end in ("low", "value", "high")]
            if field in quotable or any(x is not None for x in numbers):
                assert None not in numbers, (field, channel)
                assert numbers == sorted(numbers)


def assert_report_gives(report: Report) -> None:
    for fit in (report.baseline, report.extended):
        for channel in fit.channels.values():
            assert_given(channel)
    shown = diagnosis_parts.known_parameters(report)
    for name, before in report.baseline.channels.items():
        after = report.extended.channels[name]
        for field in FIELDS:
            quoted = field in {*QUOTABLE[before.status], *QUOTABLE[after.status]}
            assert (f"{name} {field}" in shown) == quoted
    assert "nan" not in "\n".join(diagnosis_text.text(report, "log", "car")).split()
    assert ">nan" not in page(report)


@pytest.mark.slow("fits many drives")
@pytest.mark.parametrize("log", seeds.in_turn(LOGS, 2, "identifiability of logs"), ids=lambda p: p.name)
def test_both_verbs_give_all_of_shipped_logs(log: Path) -> None:
    generic = "generic_lane" if "lane" in log.name else "generic"
    trace = canid.read_trace(
        log, log.stem.removesuffix("_simulated") if "_simulated" in log.name else generic
    )
    identified = canid.identify(trace, select_orders=False)
    # ARMAX, which is the number to read of steering, has no lag and dead time of its own
    fopdt = identified.whole["fopdt"]
    assert fopdt is not None
    for channel in fopdt.channels.values():
        assert_given(channel)
    assert_json_gives(identification_json.to_json(identified, log.name, "car"))
    report = canid.diagnose(trace)
    assert_report_gives(report)
    assert_json_gives(json_values.plain(diagnosis_json.document(report, log.name, "car")))


@pytest.mark.slow("fits many drives")
def test_the_urban_log_quotes_no_delay_of_headway_in_either_verb() -> None:
    trace = canid.read_trace(ROOT / "replay_logs" / "following_urban.blf", "generic")
    one = canid.identify(trace, select_orders=False).channels["headway_error"]
    other = canid.diagnose(trace).baseline.channels["headway_error"]
    assert one.status is other.status is Identifiable.GAIN_ONLY


@pytest.mark.slow("fits many drives")
@pytest.mark.parametrize(("profile", "minutes", "seed"), seeds.in_turn(DRIVES, 2, "identifiability"))
def test_simulated_drives_give_all(profile: str, minutes: float, seed: int) -> None:
    trace = sensed_trace(plant_one.plant({}, seed=seed, minutes=minutes, noise="ar1", profile=profile))
    for channel in canid.identify(trace, select_orders=False).channels.values():
        assert_given(channel)
    assert_report_gives(canid.diagnose(trace))


@pytest.mark.slow("fits many drives")
def test_both_verbs_follow_one_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that nothing meets leave gains alone in both verbs."""
    trace = canid.read_trace(ROOT / "replay_logs" / "following_urban.blf", "generic")
    monkeypatch.setattr(identifiability, "DEAD_TIME_SD", 0.0)
    monkeypatch.setattr(identifiability, "SUM_SD", 0.0)
    identified = canid.identify(trace, select_orders=False).channels
    for channels_ in (identified, canid.diagnose(trace).baseline.channels):
        assert {channel.status for channel in channels_.values()} == {Identifiable.GAIN_ONLY}


@pytest.mark.parametrize("truth", [0.5, 1.0, 2.0, 3.0, 4.0, 6.0])
def test_a_gain_that_is_quoted_since_it_is_large_is_in_its_interval(truth: float) -> None:
    """Of 20,000 gains in standard deviations, of those that reach the limit 95 %; of plain intervals more miss."""
    drawn = truth + np.random.default_rng(7).standard_normal(20_000)
    quoted = drawn[drawn >= identifiability.GAIN_RATIO]
    several = {
        f"{k}": Channel(Interval(x, x - 1.96, x + 1.96), status=Identifiable.GAIN_ONLY)
        for k, x in enumerate(quoted.tolist())
    }
    given = [channel.K for channel in identifiability.given_quoted(several).values()]
    holds = np.mean([K.low <= truth <= K.high for K in given])
    assert holds > 0.95 - 3.0 * (0.05 / len(quoted)) ** 0.5
    if truth == 2.0:
        assert np.mean(np.abs(quoted - truth) < 1.96) < 0.9
