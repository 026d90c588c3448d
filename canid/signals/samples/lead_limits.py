"""Limits of a lead that was chosen among radar tracks: of its own reports, as all tracks of a radar end where it does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.signals.samples import limited_values
from canid.signals.samples.lead import REPORTED
from canid.signals.samples.lead_readings import Made
from canid.signals.samples.limited_values import AT_LIMIT
from canid.signals.samples.reading_facts import Limited
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import Array


class WithinLimits(NamedTuple):
    """The lead of a chunk."""

    made: Mapping[str, Made]  # its reports with NaN at a limit; smoothed ones as they are
    limits: tuple[tuple[int, Limited], ...]  # with the row from which on they are known
    # of the role `AT_LIMIT`, as `limited_values` has them, of gap and range rate
    marks: tuple[RoleReadings, ...]


def step(
    state: limited_values.State, made: Mapping[str, Made], t: Array
) -> tuple[limited_values.State, WithinLimits]:
    """Take the lead of a chunk.

    A report at a limit still says that the vehicle is there: its sample is marked and not learned from.

    Args:
        state: of `limited_values`.
        made: by role, what the lead has made of the chunk's reports.
        t: (n,) s, of the chunk's frames.
    """
    named = [(role, name) for role, name in REPORTED.items() if name in made]
    reports = tuple(RoleReadings(role, made[name].row, made[name].value) for role, name in named)
    state, within = limited_values.step(state, Decoded(reports, (), ()), t)
    after, at = dict(made), np.zeros(len(reports[0].row) if reports else 0, dtype=bool)
    for (_, name), left in zip(named, within.decoded.roles, strict=True):
        # of one report gap and range rate come together
        at |= np.isnan(left.value) & ~np.isnan(made[name].value)
        after[name] = made[name]._replace(value=left.value)
    for _, row, value in within.marks:
        at |= np.isin(reports[0].row, row[value == 1.0])
    known = any(watch.low.found or watch.high.found or watch.suspected for watch in state.values())
    marks = (RoleReadings(AT_LIMIT, reports[0].row, at.astype(float)),) if known and reports else ()
    return state, WithinLimits(after, within.limits, marks)
