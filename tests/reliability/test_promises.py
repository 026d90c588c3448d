"""Each promise of docs/reliability.md, tried out a few times; `python -m benchmarks.reliability` does it at length.

The benchmark measures times; here a busy machine's pauses are no failure, so bounds in s are four times the promise.
"""

from __future__ import annotations

import doctest
import json
import random
import signal
from pathlib import Path

import pytest

from benchmarks.reliability import buses, cuts, disks, ends, kills, seams, soak, table
from benchmarks.reliability.outcome import Outcome

BUSY = 4.0


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(("rate", "after"), [(100, 0.31), (2000, 0.87), (8000, 1.29)])
@pytest.mark.usefixtures("between_processes")
def test_a_kill_leaves_a_whole_log_that_ends_a_moment_before(rate: int, after: float, tmp_path: Path) -> None:
    """kill -9 of `canid record`: contiguous, at its absolute time, equal for three readers."""
    assert kills.one(tmp_path, rate, after, BUSY * kills.MAX_LOSS_S).wrong == ""


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(("rate", "after"), [(100, 0.9), (8000, 0.7)])
@pytest.mark.usefixtures("between_processes", "mounting")
def test_a_power_cut_leaves_what_was_synced(rate: int, after: float, tmp_path: Path) -> None:
    """What was not synced is thrown away, or came through in part: what was synced is there, and nothing false."""
    outcomes = list(cuts.one(tmp_path, rate, 0.01, after, random.Random(rate), busy=BUSY))
    assert [o.wrong for o in outcomes if o.wrong] == []
    assert len(outcomes) == 1 + cuts.MIXTURES
    assert not (tmp_path / "left/x.blf").exists() or (tmp_path / "left/x.blf").stat().st_size


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(("end", "again"), [(signal.SIGTERM, True), (signal.SIGHUP, False), (None, False)])
def test_an_end_in_a_burst_loses_nothing(end: signal.Signals | None, again: bool, tmp_path: Path) -> None:
    """60,000 frames and a signal, or the end of the bus: all are there; an earlier file is not touched."""
    outcome = ends.one(tmp_path, end, again=again)
    assert (outcome.wrong, outcome.frames) == ("", 0)


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(
    ("case", "suffix"),
    [(seams.by_size, ".blf"), (seams.ring_by_share, ".log"), (seams.killed, ".blf")],
)
@pytest.mark.usefixtures("between_processes", "root")
def test_new_files_lose_nothing_at_their_seams(
    case: object, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rotation and ring between processes: each file opens alone, names sort, only own files are deleted."""
    monkeypatch.setattr(seams, "DURATION_S", 3.0)
    monkeypatch.setattr(seams, "MAX_GAP_S", BUSY * seams.MAX_GAP_S)
    assert callable(case)
    assert case(suffix, tmp_path) == []


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize("case", [disks.full, disks.is_read_only, disks.stuck])
@pytest.mark.usefixtures("between_processes", "root", "mounting")
def test_a_bad_disk_is_reported_and_live_goes_on(
    case: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full, read-only, stuck: exit 5 or every drop counted, shown and in the log; the file up to there is whole."""
    monkeypatch.setattr(disks, "DURATION_S", 2.0)
    monkeypatch.setattr(disks, "MAX_WAITING_FRAMES", 2000)
    assert callable(case)
    assert [text for text in case(tmp_path) if text] == []


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize("case", [case for _, case in buses.CASES if case is not buses.overrun])
def test_a_bad_bus_is_reported_in_the_log(
    case: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """Errors, bus-off, unplugging, clocks, duplicates: recorded as it came, reported in journal and log."""
    if case is buses.which_clock:
        request.getfixturevalue("between_processes")
    monkeypatch.setattr(buses, "MAX_RETURN_S", BUSY * buses.MAX_RETURN_S)
    monkeypatch.setattr(buses, "MAX_STAMP_ERROR_S", 20 * BUSY * buses.MAX_STAMP_ERROR_S)
    assert callable(case)
    assert case(tmp_path) == []


@pytest.mark.usefixtures("between_processes")
def test_what_the_kernel_drops_stands_in_the_log(tmp_path: Path) -> None:
    """A recorder that stood still: recorded and counted make up what was sent."""
    assert buses.overrun(tmp_path) == []


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.usefixtures("between_processes")
def test_the_soak_in_short_drops_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Both estimators and the monitor at 4,000 frames/s: every frame is in the log. CPU and memory: not here."""
    soak.run(hours=8 / 3600, rate=4000.0)
    printed = capsys.readouterr().out
    wrong = [line for line in printed.splitlines() if line.startswith("wrong: ")]
    assert [line for line in wrong if " % of a core" not in line and "memory grew" not in line] == [], printed


def test_outcomes_survive_a_file_and_become_a_table(tmp_path: Path) -> None:
    """What --out keeps comes back as it was; broken promises are counted in the table."""
    outcomes = [Outcome("a", 0.125, 3), Outcome("b", float("nan"), 0, "bad")]
    (tmp_path / "out").write_text(table.line(4, outcomes) + "\n")
    back = table.stored(tmp_path / "out")
    assert json.dumps(back[4]) == json.dumps(outcomes)
    assert "| b | 1 | – | – | 0 | 1: bad |" in table.markdown(back[4])


def test_examples_of_the_benchmark_are_true() -> None:
    assert doctest.testmod(table).failed == 0
