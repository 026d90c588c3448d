"""A table's roles as a log and a vehicle: every row becomes frames of doubles, which the pipeline of CAN logs reads.

Columns whose cells are filled in the same rows are one message, as signals of a car that are sent together. In a column
that is filled in every row an empty cell says that nothing was measured; in one that is filled now and then (a table of
several rates) it says nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.source import EMPTY, NO_NUMBER
from canid.io.logs.formats import Format
from canid.io.logs.log import Log
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import LineCount
from canid.mathematics.estimators import ESTIMATORS
from canid.signals.vehicle.bits import Bits
from canid.signals.vehicle.mapping import LeadConfig, MessageMap, RoleMap, SignalMap, Vehicle
from canid.values import timestamps
from canid.values.frame_columns import WantedIds
from canid.values.roles import NEEDS, ROLES
from canid.values.types import Array, Columns, Driver, Flag

# in the frames, a reading that says that there is none; its cell was empty, held a text, or said so
NO_VALUE = -(2**60)
TEXTS = {EMPTY: "empty cell", NO_NUMBER: "no number", NO_VALUE: "no value"}
# doubles of one CAN FD frame
PER_FRAME = 8
ROWS_PER_CHUNK = 8192
# beyond these a value cannot be: not measured, counted (a pedal's sensor may be off by some percent)
LIMITS = {
    "pedal": (-5.0, 110.0),
    "speed": (-30.0, 150.0),
    "gap": (0.0, 2000.0),
    "range_rate": (-150.0, 150.0),
    "accel": (-50.0, 50.0),
    "accel_command": (-50.0, 50.0),
    "steering_angle": (-3000.0, 3000.0),
    "lateral_offset": (-50.0, 50.0),
}
WIDEST = (-1e12, 1e12)


# what a table is among the formats of logs
TABLE = Format("", "", "table")


class TableLog(Log):
    """The rows of a table as frames; see `Log`."""

    entries = "entries"

    def __init__(
        self, path: Path, t: Array, messages: list[tuple[npt.NDArray[np.int64], Array]], start_ns: int | None
    ):
        """Take the rows.

        Args:
            path: of the table, for messages.
            t: (n,) s.
            messages: of each message its rows (m,) and its doubles (m, k).
            start_ns: epoch of t = 0.
        """
        self.path = path
        self.format = TABLE
        self.buses = {}  # a table has no interfaces
        self._first_remarks = ()
        self._t, self._messages = t, messages
        self.count = LineCount(read=len(t))  # the lines of the table
        self._read = self._columns
        self._state = self._new_state()
        self.start_ns = (
            None if start_ns is None else start_ns + round(1e9 * float(t[0])) if t.size else start_ns
        )
        self.start_utc = timestamps.epoch_seconds(self.start_ns)

    @property
    def span(self) -> tuple[float, float]:
        """The times of the first and of the last row, s."""
        return float(self._t[0]), float(self._t[-1])

    def _new_state(self, notes: Any = None) -> ReadState:
        return ReadState(size=max(len(self._t), 1), notes=notes)

    def _columns(self, path: Path, state: ReadState, wanted: WantedIds | None) -> Iterator[Columns]:
        for begin in range(0, len(self._t), ROWS_PER_CHUNK):
            end = min(begin + ROWS_PER_CHUNK, len(self._t))
            parts = []
            for number, (rows, values) in enumerate(self._messages, 1):
                a, b = np.searchsorted(rows, (begin, end))
                if a < b:
                    parts.append((rows[a:b], number, values[a:b]))
            state.done = end
            if not parts:
                continue
            chunk = _joined(self._t, parts)
            state.frames += len(chunk.t)
            yield chunk
        state.damage = self.count.damage("rows")
        state.damaged = self.count.bad + self.count.cut
        state.other_kinds = Counter(self.count.others)


def _joined(t: Array, parts: list[tuple[npt.NDArray[np.int64], int, Array]]) -> Columns:
    rows = np.concatenate([part_rows for part_rows, _, _ in parts])
    n = len(rows)
    ids = np.concatenate([np.full(len(part_rows), number) for part_rows, number, _ in parts])
    data = np.zeros((n, PER_FRAME))
    length = np.zeros(n, np.uint8)
    begin = 0
    for part_rows, _, values in parts:
        data[begin : begin + len(part_rows), : values.shape[1]] = values
        length[begin : begin + len(part_rows)] = 8 * values.shape[1]
        begin += len(part_rows)
    order = np.argsort(rows, kind="stable")
    return Columns(
        t=t[rows[order]],
        bus=np.zeros(n, np.uint16),
        id=ids[order].astype(np.uint32),
        flags=np.full(n, int(Flag.FD), np.uint8),
        length=length[order],
        data=np.ascontiguousarray(data[order]).astype("<f8").view(np.uint8),
    )


def table_log(
    path: str,
    t: Array,
    roles: Mapping[str, Array],
    start_ns: int | None,
    driver: Driver,
    title: str,
    estimators: Mapping[str, Any],
    stale: Mapping[str, float],
    map_path: str = "",
) -> tuple[TableLog, Vehicle]:
    """Make a log and its vehicle of a table's roles.

    Args:
        path: of the table.
        t: (n,) s.
        roles: role -> (n,) in its unit, with the marks of `source`.
        start_ns: epoch of t = 0; None: not known.
        driver: whose answer is identified.
        title: name of the vehicle.
        estimators: their settings, by name; those that are missing have their defaults.
        stale: role -> s, where it is not the usual.
        map_path: of the column map.
    """
    needed = {driver.output, *NEEDS[driver.task]}
    # what the model needs comes last: a sample is complete with it, and all others of the row have come by then
    ordered = sorted(roles, key=lambda role: (role in needed, list(ROLES).index(role)))
    groups: dict[bytes, list[str]] = {}
    filled: dict[bytes, npt.NDArray[np.int64]] = {}
    for role in ordered:
        there = _there(roles[role])
        key = np.packbits(there).tobytes()
        groups.setdefault(key, []).append(role)
        filled[key] = np.flatnonzero(there)
    messages: list[tuple[npt.NDArray[np.int64], Array]] = []
    maps: list[MessageMap] = []
    role_maps: dict[str, RoleMap] = {}
    for key, group in groups.items():
        for first in range(0, len(group), PER_FRAME):
            names = group[first : first + PER_FRAME]
            rows = filled[key]
            number = len(messages) + 1
            message = MessageMap("table", number, False, None, 8 * len(names), math.nan, None, ())
            message = message._replace(name=f"columns_{number}")
            maps.append(message)
            messages.append((rows, np.column_stack([_marked(roles[role][rows]) for role in names])))
            for k, role in enumerate(names):
                role_maps[role] = _role(role, k, message, stale.get(role, ROLES[role].stale))
    settings = {}
    for estimator in ESTIMATORS:
        given = estimators.get(estimator.name) or estimator.settings()
        stated = {x: getattr(driver, x) for x in given._fields if x in Driver._fields}
        settings[estimator.name] = given._replace(**stated)
    vehicle = Vehicle(
        name=title,
        path=map_path,
        dbc=(),
        roles={role: role_maps[role] for role in ROLES if role in role_maps},
        lead=LeadConfig(),
        messages=tuple(maps),
        driver=driver,
        estimators=settings,
        warnings=(),
    )
    return TableLog(Path(path), t, messages, start_ns), vehicle


def _there(values: Array) -> npt.NDArray[np.bool_]:
    """The rows in which a column has something to say: all, if it is filled in neighbouring rows as a rule."""
    there: npt.NDArray[np.bool_] = values != EMPTY
    rows = np.flatnonzero(there)
    if there.all() or len(rows) < 2 or np.median(np.diff(rows)) > 1.0:
        return there
    return np.ones(len(values), bool)


def _marked(values: Array) -> Array:
    return np.where(np.isfinite(values), values, float(NO_VALUE))


def _role(role: str, place: int, message: MessageMap, stale: float) -> RoleMap:
    low, high = LIMITS.get(role, WIDEST)
    kind = ROLES[role].kind
    how = SignalMap(
        signal=role,
        bits=Bits(64 * place, 64, floating=True),
        factor=1.0,
        offset=0.0,
        low=low,
        high=high,
        kind=kind,
        no_value=TEXTS,
    )
    return RoleMap(role, message.name, message.id, False, None, ROLES[role].unit, stale, how)
