"""A gain that is withheld for a reason has that one reason, in the same words, wherever its number would stand."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from canid.analysis.comparison import drive_json, result_estimates
from canid.analysis.comparison.comparison import compare
from canid.analysis.comparison.drive import Side
from canid.analysis.drive import identification_json
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_summary import DriveSummary
from canid.analysis.drive.requirements import judged, requirement
from canid.mathematics.estimators import plausibility, whole_drive_agreement
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.systems import identified_loop
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.ui.views import identification_text, junit
from canid.ui.views.comparison_report import comparison_document
from canid.values.types import Channel, DriveTime, Identifiable, Interval
from tests.views.test_results_shown import nothing

INPUTS = ("headway_error", "range_rate")


def drawn(seed: int) -> tuple[Identified, str, str]:
    """A drive of which one gain is withheld: its result, the input, and the reason."""
    rng = np.random.default_rng(seed)
    moved = INPUTS[seed % 2]
    channels = {}
    for name in INPUTS:
        value, half = rng.uniform(2.0, 8.0), rng.uniform(0.1, 0.9)
        known = Interval(value, value - half, value + half)
        channels[name] = Channel(known, *[Interval(0.5, 0.4, 0.6)] * 3, status=Identifiable.OK)
    why = plausibility.average_over_cause(moved)
    whole = whole_drive_agreement.without_parameter(WholeDrive(channels), moved, "K", why)
    assert whole is not None
    time = DriveTime(600.0, 600.0, 600.0, 500.0)
    summary = DriveSummary("pedal")
    drive = Identified(
        600.0, 500.0, (), {"fopdt": whole}, (), time, loop=IdentifiedLoop(why), drive_summary=summary
    )
    return drive, moved, why


def text(drive: Identified, moved: str) -> str:
    return " ".join(" ".join(identification_text.summary(drive, "a.blf", "car")).split())


def notebook(drive: Identified, moved: str) -> str:
    return drive._repr_html_()


def channel(drive: Identified, moved: str) -> str:
    return drive.channels[moved]._repr_html_()


def json(drive: Identified, moved: str) -> str:
    written = identification_json.to_json(drive, "a.blf", "car")
    return str(written["whole"]["channels"][moved]["withheld"])


def compared(drive: Identified, moved: str) -> str:
    side = Side("A", (result_estimates.of_identified(drive, "a.blf", "car", "%"),))
    return " ".join(" ".join(comparison_document.text(compare(side, side._replace(label="B")))).split())


def compared_json(drive: Identified, moved: str) -> str:
    read = drive_json.read(identification_json.to_json(drive, "a.blf", "car"))
    return read.quantities[f"{moved} tau"].why


def required(drive: Identified, moved: str) -> str:
    return judged([requirement(f"{moved}.K in 0..99")], drive, "pedal")[0].failed


def in_junit(drive: Identified, moved: str) -> str:
    return junit.xml([junit.JudgedLog("a.blf", tuple(judged([requirement(f"{moved}.K in 0..99")], drive)))])


@pytest.mark.parametrize(
    "shown", [text, notebook, channel, json, compared, compared_json, required, in_junit]
)
def test_the_reason_is_where_the_number_would_be(shown: Callable[[Identified, str], str], seed: int) -> None:
    drive, moved, why = drawn(seed)
    said = shown(drive, moved)
    assert said.count(why) == 1
    assert "not identifiable" not in said
    assert "drive longer" not in said


def test_margins_name_the_reason(seed: int) -> None:
    drive, _, why = drawn(seed)
    fit = SimpleNamespace(posterior=object())
    assert identified_loop.identified_loop(fit, drive.channels, nothing()).says == why  # type: ignore[arg-type]
    assert why not in " ".join(identification_text.loop_lines(drive.loop, f"{why}."))


def test_what_the_data_do_not_show_is_not_identifiable() -> None:
    assert "not identifiable" in identification_text.estimate_text.channel("range_rate", Channel())
