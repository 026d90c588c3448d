"""What one id of a table stands for: one vehicle, or several in turn, as in NGSIM's file of all periods and places.

Rows of one vehicle have one place, one length and one count of frames. Where these differ, or where minutes are missing
in a set of vehicles that pass a camera once, the id was given again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.headings import heading
from canid.analysis.tables.rows import Rows
from canid.analysis.tables.source import clean
from canid.signals.vehicle.quoting import brief
from canid.values.types import Array

_Codes = npt.NDArray[np.int64]
# names of columns, as `Heading.name`, that a vehicle has one value of: where and when it was seen, and what it is
PLACES = ("location", "site", "recording", "recording_id", "period", "session", "session_id", "trip", "trip_id", "trip_no",
          "drive", "drive_id", "run", "run_id", "data_set", "dataset", "scene", "scene_id", "file", "file_name", "filename",
          "case", "case_id", "event", "event_id")  # fmt: skip
TRAITS = ("length", "v_length", "vehicle_length", "veh_length", "width", "v_width", "vehicle_width", "class", "v_class",
          "vehicle_class", "veh_class", "vehicle_type", "total_frames", "num_frames", "number_of_frames")  # fmt: skip
COUNTERS = ("frame_id", "frame", "frame_no", "frame_number", "frame_nr", "frame_index")
# s without a row: a vehicle that passes a camera is seen for some minutes, without a break
GAP_S = 60.0
# values of a trait that is a number, and rows of each at least: what is measured anew in every row is no trait
_MAX_TRAITS, _MIN_TRAIT_ROWS = 8, 20
# frames by which a counter differs from the one before when it is another one: more than an eclipse takes
_MIN_FRAMES = 300
# s; a clock with longer steps gives several rows the same time
_FINE_S = 0.5
# share of the rows that have another one of the same time
_AT_ONCE_SHARE = 0.2
# vehicles that a message lists
_MAX_LISTED = 8


class Columns(NamedTuple):
    """Places of the columns that show which vehicle a row is of."""

    where: tuple[int, ...]
    traits: tuple[int, ...]
    counter: int  # −1: none

    @property
    def all(self) -> tuple[int, ...]:
        """All places."""
        return (*self.where, *self.traits, *((self.counter,) if self.counter >= 0 else ()))


class Vehicle(NamedTuple):
    """One of the vehicles of an id."""

    rows: _Codes  # of the table, in its order
    begin: float  # s
    duration: float  # s
    shown: tuple[str, ...]  # "Location us-101"
    options: tuple[str, ...]  # "Location=us-101", that distinguish it from the others


class Vehicles(NamedTuple):
    """What an id stands for, in the order of time."""

    all: tuple[Vehicle, ...]
    pause_s: float  # the longest stretch without a row of what is taken for one vehicle; 0: none of minutes


def columns_of(headings: Sequence[str], used: Sequence[int]) -> Columns:
    """Find the columns.

    Args:
        headings: of the table.
        used: places of columns that have another meaning, as a time that counts frames.

    Example:
        >>> columns_of(["Vehicle_ID", "Frame_ID", "v_Length", "Location"], [0])
        Columns(where=(3,), traits=(2,), counter=1)
    """
    names = {place: heading(text).name for place, text in enumerate(headings) if place not in used}
    counters = [place for place, name in names.items() if name in COUNTERS]
    return Columns(
        tuple(place for place, name in names.items() if name in PLACES),
        tuple(place for place, name in names.items() if name in TRAITS),
        counters[0] if counters else -1,
    )


def vehicles(t: Array, rows: Rows, columns: Columns, headings: Sequence[str], *, passing: bool) -> Vehicles:
    """Separate the vehicles of one id.

    Args:
        t: (n,) s, ascending; NaN at the end: no time.
        rows: of the id.
        columns: from `columns_of`.
        headings: of the table.
        passing: whether the table is of vehicles that pass a camera: a gap of minutes alone is then another vehicle.

    Example:
        >>> t = np.concatenate([np.arange(50) * 0.1, 900 + np.arange(50) * 0.1])
        >>> rows = Rows({0: np.repeat([15.5, 22.0], 50)}, {}, 100, np.arange(100))
        >>> those = vehicles(t, rows, Columns((), (0,), -1), ["v_Length"], passing=False)
        >>> [vehicle.shown for vehicle in those.all]
        [('v_Length 15.5',), ('v_Length 22',)]
    """
    known = np.flatnonzero(np.isfinite(t))
    codes = np.zeros(len(known), np.int64)
    telling: dict[int, tuple[list[str], _Codes]] = {}
    for place in (*columns.where, *columns.traits):
        cells = _cells(rows, place, known)
        if cells is None:
            continue
        values, code = np.unique(cells, return_inverse=True)
        enough = np.bincount(code).min() >= _MIN_TRAIT_ROWS and len(values) <= _MAX_TRAITS
        if len(values) > 1 and (place in columns.where or enough):
            codes = _joined(codes, code)
            telling[place] = (
                [value if isinstance(value, str) else f"{value:.12g}" for value in values.tolist()],
                code,
            )
    if columns.counter >= 0 and columns.counter in rows.numbers:
        counter = clean(rows.numbers[columns.counter])[known]
        codes = _joined(codes, _counters(t[known], counter, codes))
    rows_by_vehicle: list[_Codes] = []
    pause = 0.0
    for code in np.unique(codes).tolist():
        its_rows = known[codes == code]
        steps = np.diff(t[its_rows])
        if passing:
            rows_by_vehicle += np.split(its_rows, np.flatnonzero(steps >= GAP_S) + 1)
        else:
            rows_by_vehicle.append(its_rows)
            pause = max(pause, float(steps.max(initial=0.0)))
    rows_by_vehicle.sort(key=lambda its_rows: (float(t[its_rows[0]]), int(its_rows[0])))
    made = []
    for its_rows in rows_by_vehicle:
        k = int(np.searchsorted(known, its_rows[0]))
        cells_of = {place: names[int(code[k])] for place, (names, code) in telling.items()}
        titles = {place: headings[place].strip() for place in cells_of}
        made.append(
            Vehicle(
                its_rows,
                float(t[its_rows[0]]),
                float(t[its_rows[-1]] - t[its_rows[0]]),
                tuple(f"{brief(titles[place])} {brief(cell)}" for place, cell in cells_of.items()),
                tuple(f"{titles[place]}={cell}" for place, cell in cells_of.items()),
            )
        )
    return Vehicles(tuple(made), pause if pause >= GAP_S else 0.0)


def _cells(rows: Rows, place: int, known: _Codes) -> npt.NDArray[Any] | None:
    """The cells of a column; None: not all of them are filled."""
    if place in rows.texts:
        texts = np.array([text.strip() for text in rows.texts[place]])[known]
        return texts if (texts != "").all() else None
    if place not in rows.numbers:
        return None
    values = clean(rows.numbers[place])[known]
    return values if np.isfinite(values).all() else None


def _joined(codes: _Codes, more: npt.NDArray[np.int64]) -> _Codes:
    joined = codes * (int(more.max(initial=0)) + 1) + more
    inverse: _Codes = np.unique(joined, return_inverse=True)[1]
    return inverse


def _counters(t: Array, counter: Array, codes: _Codes) -> _Codes:
    """Which of several counts of frames a row belongs to: those of one count differ from its times by a constant."""
    out = np.zeros(len(t), np.int64)
    if not np.isfinite(counter).all():
        return out
    rates = []
    for code in np.unique(codes).tolist():
        dt, frames = np.diff(t[codes == code]), np.diff(counter[codes == code])
        good = (dt > 0.0) & (frames > 0.0)
        rates.append(frames[good] / dt[good])
    steps = np.concatenate(rates)
    if not len(steps):
        return out
    offset = counter - float(np.median(steps)) * t
    order = np.argsort(offset, kind="stable")
    out[order] = np.concatenate([[0], np.cumsum(np.diff(offset[order]) > _MIN_FRAMES)])
    return out


def at_once(t: Array, columns: Sequence[Array]) -> bool:
    """Whether an id is of several vehicles at the same times: rows of one time with other values, on a fine clock.

    Args:
        t: (n,) s, ascending; NaN at the end.
        columns: (n,) each, measured values; NaN: none.

    Example:
        >>> at_once(np.repeat(np.arange(9) * 0.1, 2), [np.tile([20.0, 31.0], 9)])
        True
    """
    steps = np.diff(t)
    fine = steps[steps > 0.0]
    if not len(fine) or np.median(fine) > _FINE_S:
        return False
    wrong = np.zeros(len(steps), bool)
    for column in columns:
        a, b = column[:-1], column[1:]
        wrong |= np.isfinite(a) & np.isfinite(b) & (a != b)
    return bool(((steps == 0.0) & wrong).sum() > _AT_ONCE_SHARE * len(t))


def listed(id_: str, vehicles: Sequence[Vehicle], start_ns: int | None) -> str:
    """The vehicles of an id, in words: the key of each, when, how long, and what distinguishes it.

    Example:
        >>> listed("2", [Vehicle(np.arange(9), 0.0, 90.0, ("Location us-101",), ())], None)
        '2#1: from 0 s, 90 s, Location us-101'
    """
    shown = []
    for k, vehicle in enumerate(vehicles[:_MAX_LISTED], 1):
        begin = f"from {vehicle.begin:.6g} s"
        if start_ns is not None:
            begin = f"{datetime.fromtimestamp(start_ns * 1e-9 + vehicle.begin, UTC):%Y-%m-%d %H:%M:%S} UTC"
        shown.append(", ".join((f"{id_}#{k}: {begin}", f"{vehicle.duration:.3g} s", *vehicle.shown)))
    more = f"; and {len(vehicles) - _MAX_LISTED} more" if len(vehicles) > _MAX_LISTED else ""
    return "; ".join(shown) + more


def numbered(chosen: str) -> tuple[str, int]:
    """The id and the number of a choice such as "2#1"; number 0: it has none.

    Example:
        >>> numbered("2#1"), numbered("2"), numbered("car#a")
        (('2', 1), ('2', 0), ('car#a', 0))
    """
    id_, mark, number = chosen.rpartition("#")
    if mark and id_ and number.isdecimal() and 0 < len(number) < 7 and int(number):
        return id_, int(number)
    return chosen, 0


def options(vehicles: Sequence[Vehicle]) -> Mapping[str, int]:
    """Conditions of --where, and how many of the vehicles each of them leaves.

    Example:
        >>> options([Vehicle(np.arange(1), 0, 1, (), ("Location=a",)), Vehicle(np.arange(1), 0, 1, (), ("Location=b",))])
        {'Location=a': 1, 'Location=b': 1}
    """
    counts: dict[str, int] = {}
    for vehicle in vehicles:
        for text in vehicle.options:
            counts[text] = counts.get(text, 0) + 1
    return counts
