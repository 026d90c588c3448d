"""Pauses of a whole log are in its duration and in no rate: `look`, `check`, `decode` and `init` alike."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.contents.binding import DbcFile
from canid.analysis.contents.decoded_frames import Decoder
from canid.analysis.contents.last_values import LastValues
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.drive_reader import read_trace
from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.fleet.one_log import drive_row
from canid.analysis.proposal import log_columns
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle import read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Frame

Canid = Callable[..., Any]
URBAN = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
# s; what the pause is long, and when it begins
PAUSE_S, BEGIN_S = 600.0, 20.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """40 s of driving, and the same with a pause of ten minutes in its middle."""
    folder = tmp_path_factory.mktemp("pause")
    frames = [frame for frame in open_log(URBAN) if frame.t < 40.0]
    later = [f._replace(t=f.t + PAUSE_S) if f.t > BEGIN_S else f for f in frames]
    for name, some in (("whole.blf", frames), ("paused.blf", later)):
        write_log(folder / name, some)
    return folder / "whole.blf", folder / "paused.blf"


def test_look(canid: Canid, logs: tuple[Path, Path]) -> None:
    whole, paused = (json.loads(canid("look", log, "--json", "-").out) for log in logs)
    assert (whole["paused"], paused["paused"]) == (0.0, pytest.approx(PAUSE_S, abs=0.1))
    assert paused["duration"] == pytest.approx(whole["duration"] + PAUSE_S)
    for key, name in (
        ("buses", "rate"),
        ("buses", "bits_per_s"),
        ("messages", "rate"),
        ("messages", "jitter"),
    ):
        of = [[row[name] for row in found[key]] for found in (whole, paused)]
        np.testing.assert_allclose(of[1], of[0], rtol=0.005, atol=2e-3, err_msg=name)
    # the longest time without a frame is what it is
    assert all(row["longest_gap"] > PAUSE_S for row in paused["messages"])
    assert f"640 s of which {PAUSE_S:.0f} s without any frame" in canid("look", logs[1]).out


@pytest.mark.long("verbs on whole logs")
def test_check(canid: Canid, logs: tuple[Path, Path]) -> None:
    whole, paused = (
        json.loads(canid("check", log, "--vehicle", "generic", "--json", "-").out) for log in logs
    )
    assert (whole["paused"], paused["paused"]) == (0.0, pytest.approx(PAUSE_S, abs=0.1))
    for role, row in whole["roles"].items():
        assert paused["roles"][role]["rate"] == pytest.approx(row["rate"], rel=0.005), role
        assert paused["roles"][role]["stale_percent"] == pytest.approx(row["stale_percent"], abs=0.5), role


def test_a_proposal_and_last_values(logs: tuple[Path, Path]) -> None:
    whole, paused = (log_columns.read(open_log(log), []) for log in logs)
    for key, frames in whole.frames.items():
        expected = whole.time.rate_of(frames.t)
        assert expected > 1.0
        assert paused.time.rate_of(paused.frames[key].t) == pytest.approx(expected, rel=0.005)


def test_a_table_of_last_values_knows_a_pause() -> None:
    """The rate of the last frames, of which the pause is in the middle."""
    signal = Signal("B", 0, 8, False, False, False, 1.0, 0.0, None, None, "m", {}, False, None, ())
    file = DbcFile("a.dbc", None, [Message("A", 7, False, 1, 0.1, (signal,))])
    values = LastValues(Decoder([file], Wanted()))
    values.take([columns_of([Frame(0.1 * k + (60.0 if k > 15 else 0.0), 0, 7, b"\1") for k in range(24)])])
    assert [row.rate for row in values.rows(63.0)] == [pytest.approx(10.0, rel=0.05)]


@pytest.mark.long("verbs on whole logs")
def test_what_a_fleet_counts_as_driven_is_without_pauses(logs: tuple[Path, Path]) -> None:
    whole, paused = (identify(read_trace(log, "generic"), sliding=False, select_orders=False) for log in logs)
    assert paused.duration > PAUSE_S
    assert whole.recorded == whole.duration
    vehicle = read_vehicle("generic")
    driven = [drive_row.identified_columns(found, vehicle)["duration"] for found in (whole, paused)]
    assert driven[1] == pytest.approx(driven[0], abs=2.0)


def test_frames_that_are_all_far_apart_have_a_rate() -> None:
    """One frame in 20 s is no log of pauses alone."""
    t = 20.0 * np.arange(10)
    time = RecordedTime().after(t)
    assert time.rate_of(t) == pytest.approx(0.05)
    assert time.rate(9) == pytest.approx(0.05)


def test_the_time_before_the_first_row_is_no_duration(canid: Canid, tmp_path: Path) -> None:
    """A counter that does not begin at 0: the duration is from the first row to the last."""
    path = tmp_path / "x.csv"
    rows = [f"{0.75 + 0.1 * k:.2f},{20 + 0.01 * (k % 9):.2f},30,0.1,{0.02 * (k % 7):.2f}" for k in range(301)]
    path.write_text("time,speed [km/h],gap,range_rate,accel\n" + "\n".join(rows) + "\n", encoding="utf-8")
    assert json.loads(canid("check", path, "--json", "-").out)["duration"] == pytest.approx(30.0)
