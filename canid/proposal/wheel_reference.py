"""The wheel speeds of a log, with which candidates of the own speed are compared."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from canid.proposal import log_columns
from canid.proposal.log_columns import LogColumns
from canid.proposal.signal_agreement import References
from canid.proposal.signal_words import dbc_unit, words
from canid.types import Array
from canid.vehicle.database import Dbc
from canid.vehicle.units import factor_to

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


def wheel_reference(files: Sequence[Dbc], columns: LogColumns | None) -> References:
    """The median of all wheel speeds of a log; nothing where there is no log, or no wheel in it."""
    if columns is None:
        return References()
    wheels: list[Array] = []
    units: list[str] = []
    for file in files:
        for message in file.messages.values():
            for signal in message.signals:
                if (
                    signal.length < 8
                    or not _WHEEL.search(words(signal.name))
                    or _NO_WHEEL.search(words(signal.name))
                ):
                    continue
                unit = dbc_unit(signal.unit)
                keys = log_columns.keys_of(message, columns)
                found = log_columns.column(message, signal, keys[0].bus, columns) if keys else None
                if found is None or (unit and factor_to(unit, "m/s") is None):
                    continue
                wheels.append(found[1] * (factor_to(unit, "m/s") or 1.0 if unit else 1.0))
                units.append(unit)
    if units and any(units):
        wheels = [wheel for wheel, unit in zip(wheels, units, strict=True) if unit]
    if not wheels:
        return References()
    stacked = np.vstack(wheels)
    ok = np.isfinite(stacked).any(axis=0)
    middle = np.full(stacked.shape[1], np.nan)
    middle[ok] = np.nanmedian(stacked[:, ok], axis=0)
    return References(wheels=middle, wheels_unit=any(units))
