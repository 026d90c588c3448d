"""Lateral offsets that stand for no lane: a number that a camera sends while it sees none, such as 0.

A vehicle that moves changes its offset by small steps. A number that is reached or left by a jump, and stands still in
between for much longer than numbers of this signal do, is none: 0 the first time, another number when it does so again, as a
camera may repeat any offset. Behind a jump that no noise makes, 0 is none from its first reading on; without any jump, when
it stands three times as long. Another number from which the signal moves on by a step was an offset: it is forgotten. A lane
change is a jump too, and nothing stands still behind it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from operator import itemgetter
from typing import Annotated, NamedTuple

from canid.signals.samples.learning_gate import CREEP_SPEED
from canid.signals.samples.smoothing import MAX_REPORT_AGE_S
from canid.signals.vehicle.decoding_state import Decoded
from canid.values.state_constraints import NOT_NEGATIVE, POSITIVE
from canid.values.types import NAN, Array

# m/s; sideways no driver moves a car faster within the lane
MAX_LATERAL_SPEED = 1.5
# resolutions; a jump exceeds what the speed allows by more than rounding, and a step is no longer than the second
ROUNDED, STEP = 1.5, 2.0
# times as long a 0 that no jump begins or ends stands for no lane, as in a car that keeps to the middle
ALONE = 3.0
# s, and multiples of how long a number of this signal stays on average: so long a number without a movement is none
STILL_S, STILL_STAYS = 1.0, 5.0
# reports in that time
MIN_REPORTS = 5
# numbers over which their stay is averaged, and s, before the first one
STAYS, FIRST_STAY_S = 50, 1.0
# mean changes from one number to the next; a jump to 0 that is farther is no noise
FAR_CHANGES = 8.0
# that are remembered as having stood still once
MAX_NUMBERS = 64
# of one frame in this order
ROLES = ("speed", "lateral_offset")


class State(NamedTuple):
    """The run of equal offsets, and the numbers that have turned out to stand for none."""

    speed: float = NAN  # m/s, latest
    offset: float = NAN  # m, of the run; NaN: there is none
    t: float = NAN  # s, of its latest report
    since: float = NAN  # s, of its first report
    reports: int = 0
    jumped: bool = False  # it did not follow from the offset before
    resolution: Annotated[float, POSITIVE] = math.inf  # m, smallest change so far
    stay: Annotated[float, NOT_NEGATIVE] = FIRST_STAY_S  # s, mean of a number
    change: Annotated[float, NOT_NEGATIVE] = 0.0  # m, mean between a number and the next
    stays: int = 0  # of which these are the means
    stood: frozenset[float] = frozenset()  # m, numbers that have stood still once
    known: frozenset[float] = frozenset()  # m, those that stand for none
    none: bool = False  # the latest report was of no lane


def init() -> State:
    """Return the state before the first reading."""
    return State()


def step(state: State, decoded: Decoded, t: Array) -> tuple[State, Decoded, Mapping[str, int]]:
    """Take a chunk.

    Args:
        state: from `init()` or the chunk before.
        decoded: the chunk's readings.
        t: (n,) s, of its frames.

    Returns:
        the state; the readings, with NaN in the place of offsets that stand for no lane; and how many those were, by
        sentence.

    Example:
        >>> import numpy as np
        >>> from canid.signals.vehicle.decoding_state import RoleReadings
        >>> rows, offset = np.arange(60), 0.3 + 0.01 * np.sin(np.arange(60.0))
        >>> offset[30:] = 0.0
        >>> readings = RoleReadings("lateral_offset", rows, offset)
        >>> _, decoded, counts = step(init(), Decoded((readings,), (), ()), 0.05 * rows)
        >>> dict(counts), int(np.isnan(decoded.roles[0].value).sum())
        ({'lateral_offset: 0 m stands still, no lane': 30}, 30)
    """
    items = sorted(
        (
            (row, place, k, index, value)
            for place, role in enumerate(ROLES)
            for k, readings in enumerate(decoded.roles)
            if readings.role == role
            for index, (row, value) in enumerate(
                zip(readings.row.tolist(), readings.value.tolist(), strict=True)
            )
        ),
        key=itemgetter(0, 1),
    )
    times, counts = t.tolist(), Counter[str]()
    hidden: dict[int, list[int]] = {}
    speed = state.speed
    for row, place, k, index, value in items:
        if ROLES[place] == "speed":
            speed = value
        elif value != value:
            # a hole: the next offset follows from none
            state = state._replace(offset=NAN)
        else:
            state = _report(state, times[row], value, standing=speed < CREEP_SPEED)
            if state.none:
                counts[f"lateral_offset: {value:.4g} m stands still, no lane"] += 1
                hidden.setdefault(k, []).append(index)
    state = state._replace(speed=speed)
    if not hidden:
        return state, decoded, counts
    roles = list(decoded.roles)
    for k, indices in hidden.items():
        value = roles[k].value.copy()
        value[indices] = NAN
        roles[k] = roles[k]._replace(value=value)
    return state, decoded._replace(roles=tuple(roles)), counts


def _report(state: State, t: float, offset: float, *, standing: bool) -> State:
    """Take an offset."""
    if standing:
        return state._replace(offset=NAN, none=False)
    recent = t - state.t <= MAX_REPORT_AGE_S  # false for NaN
    if offset == state.offset and recent:
        state = state._replace(t=t, reports=state.reports + 1)
        long = _stands_still(state)
        alone = offset == 0.0 and _stands_still(state, ALONE)
        if alone or (long and state.jumped and (offset == 0.0 or offset in state.stood)):
            state = state._replace(known=state.known | {offset})
        return state._replace(none=state.none or (offset in state.known and (state.jumped or long)))
    change = abs(offset - state.offset) if recent else NAN
    jump = not change <= MAX_LATERAL_SPEED * (t - state.t) + ROUNDED * min(state.resolution, change)
    far = state.stays >= MIN_REPORTS and change > FAR_CHANGES * state.change
    if recent and change == change:
        state = _left(state, change, jump=jump)
    return state._replace(
        offset=offset,
        t=t,
        since=t,
        reports=1,
        jumped=jump,
        none=jump and (offset in state.known or (far and offset == 0.0)),
    )


def _left(state: State, change: float, *, jump: bool) -> State:
    """The run is over."""
    if _stands_still(state) and (jump or state.jumped) and not state.none:
        if state.offset == 0.0 or state.offset in state.stood:
            return state._replace(known=state.known | {state.offset})
        return state._replace(stood=frozenset([*state.stood, state.offset][-MAX_NUMBERS:]))
    if state.none:
        moved_on = {state.offset} - {0.0} if change <= STEP * state.resolution else set()
        return state._replace(known=state.known - moved_on)
    stays = min(state.stays + 1, STAYS)
    return state._replace(
        resolution=min(state.resolution, change),
        stay=state.stay + (state.t - state.since - state.stay) / stays,
        change=state.change + (change - state.change) / stays,
        stays=stays,
    )


def _stands_still(state: State, times: float = 1.0) -> bool:
    """Whether the run is longer than those of a signal that moves, by so many times."""
    lasts = times * max(STILL_S, STILL_STAYS * state.stay)
    return state.reports >= MIN_REPORTS and state.t - state.since >= lasts
