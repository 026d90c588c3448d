"""The summary of identify fits a terminal, says what may be quoted, and leaves the windows to --windows."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.identification_verdict import verdict
from canid.mathematics.estimators.estimator import WholeDrive
from canid.ui.cli import main
from canid.ui.views.document.document_text import WIDTH
from canid.ui.views.identification_text import MAX_LINES, summary
from canid.values.types import Channel, DriveTime, Identifiable, Interval, SignalFinding
from tests.seeds import mostly
from tests.views.test_level_plot import identified

LOGS = Path(__file__).parents[2] / "replay_logs"


def fits(lines: list[str]) -> None:
    assert len(lines) <= MAX_LINES
    assert max(len(line) for line in lines[1:]) <= WIDTH  # the first is the log's name, which is never cut


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize(
    ("log", "vehicle", "stop"),
    [("following_urban.blf", "generic", 60), ("lane_keeping.blf", "generic_lane", 120)],
)
def test_a_summary_fits_and_names_the_kind_of_fit(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, log: str, vehicle: str, stop: int
) -> None:
    """At most 25 lines of 80 columns; windows in text with --windows only, in JSON always; each fit is called simulated."""
    words = [
        "identify",
        str(LOGS / log),
        "--vehicle",
        vehicle,
        "--stop",
        str(stop),
        "--json",
        str(tmp_path / "a.json"),
    ]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    fits(lines)
    of = json.loads((tmp_path / "a.json").read_text())
    said = [line for line in lines if " fit " in line]
    assert said
    assert all("(simulated)" in line for line in said)
    assert of["whole"]["fit_kind"] == "simulated"
    window = next(f"{e['t']:8.1f} s" for e in of["windows"])
    assert not any(window in line for line in lines)
    assert main([*words, "--windows"]) == 0
    full = capsys.readouterr().out.splitlines()
    assert any(window in line for line in full)
    # without the line that names --windows
    assert full[1 - len(lines) :] == lines[:-1]


@mostly(0.95)
def test_a_changed_driver_has_no_number_of_the_whole_drive(seed: int) -> None:
    """The summary and the verdict give the stretches, with units, and never the average over a change."""
    drive = identified(seed, True)
    text = "\n".join(summary(drive, "a.blf", "car", "pedal"))
    fits(text.splitlines())
    assert "7.10" not in text
    assert "no number holds for the whole drive" in " ".join(text.split())
    of = verdict(drive, "pedal")
    assert of.kind == "changed"
    assert of.identifiable
    assert "312–1200 s: range rate K 8.4 [7.9, 8.9] % per m/s" in of.says


def test_many_long_findings_still_fit() -> None:
    """Twenty findings of three lines each, and ten methods: 25 lines, the most important ones first."""
    finding = SignalFinding("gap", ("gap",), 1.0, 2.0, "the gap is wrong " * 9, "map another one " * 5, False)
    K = WholeDrive(
        {"range_rate": Channel(Interval(5.6, 5.0, 6.2), status=Identifiable.GAIN_ONLY)}, None, 70.0
    )
    drive = Identified(
        60.0,
        60.0,
        (),
        {"fopdt": K} | {f"method{k}": K for k in range(9)},
        (),
        DriveTime(60.0, 60.0, 60.0, 60.0),
        (finding,) * 20,
    )
    lines = summary(drive, "a.blf", "a vehicle with a name", "pedal")
    fits(lines)
    assert any("K 5.6 [5.0, 6.2] % per m/s" in line for line in lines)
    assert any(line.startswith("✗ the gap is wrong") for line in lines)


def test_nothing_known_names_the_signal_that_is_wrong() -> None:
    """A finding that withholds estimates is the reason, before gates and missing data."""
    finding = SignalFinding("gap", ("gap",), 0.0, 2.0, "the gap is wrong", "map another one", True)
    of = verdict(
        Identified(60.0, 0.0, (), {"fopdt": WholeDrive({"range_rate": Channel()})}, (), findings=(finding,))
    )
    assert (of.kind, of.identifiable) == ("nothing", False)
    assert of.withheld.startswith("The gap is wrong (since 0 s): map another one")
