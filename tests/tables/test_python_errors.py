"""Calls from Python: rows in any order, times that are none, wrong types, and what the message says to do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import canid
from canid.analysis.tables.arrays import from_arrays, from_frame
from tests.tables.test_same_path import same

T = np.arange(0.0, 60.0, 0.1)
DRIVE: dict[str, Any] = {
    "pedal": 20.0 + 5.0 * np.sin(T / 3),
    "speed": 20.0 + np.sin(T / 5),
    "gap": 30.0 + 3.0 * np.sin(T / 7),
    "range_rate": np.sin(T / 4),
}


def test_rows_in_any_order_give_the_drive_and_say_so() -> None:
    """Shuffled and reversed rows, as arrays and as a frame: the same to the last bit, with a warning."""
    expected = from_arrays(time=T, **DRIVE)
    for order in (np.random.default_rng(1).permutation(len(T)), np.arange(len(T))[::-1]):
        with pytest.warns(UserWarning, match="were not in the order of time; they were sorted"):
            same(expected, from_arrays(time=T[order], **{name: x[order] for name, x in DRIVE.items()}))
        with pytest.warns(UserWarning, match="sorted"):
            same(expected, from_frame(pd.DataFrame({"time": T, **DRIVE}).iloc[order]))


def test_drive_seconds_made_dates_are_drive_seconds() -> None:
    """`pd.to_datetime(t, unit="s")` gives 1970: the same drive, and a line that says what was taken for granted."""
    expected = from_arrays(time=T, **DRIVE)
    dates = pd.to_datetime(T, unit="s")
    with pytest.warns(UserWarning, match="dates of 1970"):
        same(expected, from_arrays(time=dates, **DRIVE))
    for unit in ("ns", "us", "ms"):
        with pytest.warns(UserWarning, match="dates of 1970"):
            same(expected, from_frame(pd.DataFrame({"time": dates.astype(f"datetime64[{unit}]"), **DRIVE})))
    spans = from_arrays(time=pd.to_timedelta(T, unit="s"), **DRIVE)
    same(expected, spans)


@pytest.mark.parametrize(
    ("time", "says"),
    [
        (0.0 * T, "all rows have the same time"),
        (0.0 * T + 1.7e9, "all rows have the same time"),
        (np.nan * T, "holds no time in any row"),
        (1e-6 * T, "too short for two samples"),
        (pd.to_datetime([None] * len(T)), "holds no time in any row"),
    ],
)
def test_times_that_are_none_give_one_line_and_never_an_empty_trace(time: Any, says: str) -> None:
    """Equal, missing, or in a unit that makes the drive last nothing."""
    for call in (
        lambda: from_arrays(time=time, **DRIVE),
        lambda: from_frame(pd.DataFrame({"time": time, **DRIVE})),
    ):
        with pytest.raises(ValueError, match=says) as caught:
            call()
        assert "\n" not in str(caught.value)


def frames() -> dict[str, tuple[pd.DataFrame, str]]:
    """Frames that leave something open, and what the message says to write."""
    whole = pd.DataFrame({"time": T, **DRIVE})
    return {
        "no time": (whole.drop(columns="time"), 'columns={"time": "NAME"}'),
        "no gap": (whole.drop(columns=["gap", "range_rate"]), 'columns={"gap": "NAME", ...}'),
        "two speeds": (
            whole.rename(columns={"speed": "v"}).assign(velocity=1.0),
            'columns={"speed": "v"}',
        ),
        "two vehicles": (whole.assign(vehicle_id=np.arange(len(T)) % 2), "select the rows of one"),
        "two drives": (
            pd.concat([whole, whole.assign(speed=1.0)], ignore_index=True),
            "select its rows before the call",
        ),
    }


@pytest.mark.parametrize("what", frames())
def test_errors_of_frames_speak_python(what: str) -> None:
    """`columns=`, never an option of the command line or a TOML file."""
    frame, says = frames()[what]
    with pytest.raises(ValueError, match=r"^from_frame: ") as caught:
        from_frame(frame)
    assert says in str(caught.value)
    assert "--" not in str(caught.value)
    assert ".toml" not in str(caught.value).lower()


WRONG: dict[str, tuple[Any, str]] = {
    "columns": (lambda: from_frame({"time": T, **DRIVE}, ["a"]), "columns=['a'] is no mapping"),
    "units": (lambda: from_arrays(time=T, units=["km/h"], **DRIVE), "units=['km/h'] is no mapping"),
    "dt": (lambda: from_arrays(time=T, dt="0.1", **DRIVE), "dt='0.1' is no step"),
    "headway": (lambda: from_arrays(time=T, headway_desired="2", **DRIVE), "headway_desired='2'"),
    "filter": (lambda: from_arrays(time=T, output_filter="x", **DRIVE), "output_filter='x'"),
    "time": (lambda: from_arrays(time=5, **DRIVE), "give an array with one value per row"),
    "drive": (lambda: canid.identify(5, "generic"), "5 is no drive"),
    "vehicle": (lambda: canid.identify("replay_logs/following_urban.blf", 7), "vehicle=7 is no vehicle file"),
    "start": (lambda: canid.identify("x.blf", "generic", start="10"), "start='10' is no number"),
    "side": (lambda: canid.compare(5, 6), "5 is no result"),
    "sides": (lambda: canid.compare([5], [6]), "5 is no result"),
    "argument": (
        lambda: canid.identify(from_arrays(time=T, **DRIVE), stopp=3),
        "'stopp' (did you mean \"stop\"?)",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_type_is_one_line_that_names_the_argument(what: str) -> None:
    """ValueError or TypeError of canid, not of what it is built on."""
    call, says = WRONG[what]
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow("four drives are identified")
def test_compare_takes_what_identify_takes() -> None:
    """Paths with a vehicle and traces give the comparison of their results."""
    log, other = "replay_logs/following_urban.blf", "replay_logs/following_mixed.blf"
    by_path = canid.compare(log, other, vehicle="generic")
    a, b = (canid.identify(one, "generic", select_orders=False, sliding=False) for one in (log, other))
    assert repr(by_path) == repr(canid.compare(a, b))
