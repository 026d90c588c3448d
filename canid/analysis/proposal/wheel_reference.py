"""The wheel speeds of DBC files and a log: what candidates of the own speed are compared with, and what it is made of."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.proposal import log_columns
from canid.analysis.proposal.log_columns import LogColumns
from canid.analysis.proposal.name_score import Candidate
from canid.analysis.proposal.signal_agreement import References, correlation, moves
from canid.analysis.proposal.signal_words import dbc_unit, words
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.units import factor_to
from canid.values.types import Array

_WHEEL = re.compile(
    r"\b(wheel|whl|wh) ?(spd|speed|velocity)?\w* ?(fl|fr|rl|rr|lf|rf|lr|front|rear|left|"
    r"right)\b|\b(fl|fr|rl|rr|lf|rf|lr|front left|front right|rear left|rear right"
    r"|vl|vr|hl|hr)\w* ?(wheel|whl|radgesch\w*) ?(spd|speed)?|radgeschw\w*( \w+)? (vl|vr|hl|"
    r"hr)|\bvx(fl|fr|rl|rr)\b|\bwhl spd (fl|fr|rl|rr)\b"
)
_NO_WHEEL = re.compile(
    r"\b(count\w*|cnt|checksum|valid|dir\w*|pulse\w*|press\w*|temp\w*|slip|torque|tq|angle|"
    r"rough|stat\w*|qual\w*|qf|seat|heat\w*|edge\w*|time\w*|rpm)\b"
)
# correlation of two messages with one speed: coarse steps and a tenth of a second between them leave as much
_SAME_SPEED = 0.99
# wheels of a car; what a DBC has beyond them are copies
_WHEELS = 4


class Wheel(NamedTuple):
    """A wheel speed."""

    file: int  # index of its DBC
    message: Message
    signal: Signal
    unit: str  # "": the DBC is silent
    bus: int | None = None  # where the log has it
    values: Array | None = None  # on the raster, m/s where the unit is known; None: no log

    @property
    def where(self) -> str:
        """MESSAGE.SIGNAL."""
        return f"{self.message.name}.{self.signal.name}"


def wheel_signals(files: Sequence[Dbc], columns: LogColumns | None) -> list[Wheel]:
    """The wheel speeds of DBC files; with a log those that it has."""
    wheels = []
    for index, file in enumerate(files):
        for message in file.messages.values():
            for signal in message.signals:
                name = words(signal.name)
                if signal.length < 8 or not _WHEEL.search(name) or _NO_WHEEL.search(name):
                    continue
                unit = dbc_unit(signal.unit)
                factor = factor_to(unit, "m/s") if unit else 1.0
                if factor is None:
                    continue
                wheel = Wheel(index, message, signal, unit)
                if columns is not None:
                    keys = log_columns.keys_of(message, columns)
                    came = log_columns.column(message, signal, keys[0].bus, columns) if keys else None
                    if came is None:
                        continue
                    wheel = wheel._replace(bus=keys[0].bus, values=came[1] * factor)
                wheels.append(wheel)
    return wheels


def wheel_reference(wheels: Sequence[Wheel]) -> References:
    """The median of all wheel speeds of a log; nothing where there is no log, or no wheel in it."""
    known = [wheel for wheel in wheels if wheel.values is not None]
    with_unit = [wheel for wheel in known if wheel.unit]
    if not known:
        return References()
    return References(wheels=median(with_unit or known), wheels_unit=bool(with_unit))


def speed_reference(speeds: Sequence[Candidate], columns: LogColumns) -> References:
    """Of a car without wheel speeds: the first speed with a unit that another message's speed follows in the log.

    Args:
        speeds: candidates of the own speed, the best first.
        columns: the log.
    """
    seen = []
    for candidate in speeds:
        bus = log_columns.bus_of(candidate, columns)
        came = None if bus is None else log_columns.column(candidate.message, candidate.signal, bus, columns)
        if came is not None and moves(came[1]):
            seen.append((candidate, came[1]))
    for first, values in seen:
        factor = factor_to(first.unit, "m/s") if first.unit else None
        others = [raw for other, raw in seen if other.message.name != first.message.name]
        if factor is not None and any(correlation(values, raw)[0] > _SAME_SPEED for raw in others):
            return References(wheels=values * factor, wheels_unit=True, wheels_are=first.where)
    return References()


def median(wheels: Sequence[Wheel]) -> Array:
    """The median of wheels that a log has, on the raster; NaN where none of them is known."""
    values = np.vstack([wheel.values for wheel in wheels if wheel.values is not None])
    ok = np.isfinite(values).any(axis=0)
    middle = np.full(values.shape[1], np.nan)
    middle[ok] = np.nanmedian(values[:, ok], axis=0)
    return middle


def own_wheels(wheels: Sequence[Wheel]) -> list[Wheel]:
    """The wheels of which an own speed is made: one of each name, with a unit, of the message with most of them first."""
    usable = [wheel for wheel in wheels if wheel.unit and (wheel.values is None or moves(wheel.values))]
    counts: dict[tuple[int, str], int] = {}
    for wheel in usable:
        key = wheel.file, wheel.message.name
        counts[key] = counts.get(key, 0) + 1
    usable.sort(key=lambda wheel: -counts[wheel.file, wheel.message.name])
    chosen: dict[str, Wheel] = {}
    for wheel in usable:
        first = next(iter(chosen.values()), wheel)
        # options of an entry hold for all of its signals
        if wheel.unit == first.unit and wheel.file == first.file and wheel.bus == first.bus:
            chosen.setdefault(words(wheel.signal.name), wheel)
    most = list(chosen.values())[:_WHEELS]
    return most if len(most) > 1 else []
