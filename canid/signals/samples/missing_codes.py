"""Numbers that stand for "not measured" in speed, range rate and pedal: reached and left by jumps, the same each time.

A car's speed cannot jump: what it jumps to is left out at once, until the signal moves on from it by a step. So is a range
rate beyond all leads. Else a range rate jumps where the lead changes, and a pedal is pressed fast: a number stands for none
once the signal has jumped to it and back to where it was `MIN_VISITS` times, and of a pedal only one that is out of its
range. What is reached by steps is measured, whatever the number. Gaps have `no_target`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.samples.smoothing import MAX_REPORT_AGE_S
from canid.signals.vehicle.decoding_state import Decoded
from canid.values.findings import Flags
from canid.values.roles import ROLES
from canid.values.state_constraints import NOT_NEGATIVE
from canid.values.types import NAN, Array

# role -> per s, how fast it may change meanwhile: brakes give 10 m/s², two cars 15
MAX_SLOPE = {"speed": 12.0, "range_rate": 15.0, "pedal": 0.0}
# m/s that a noisy or coarse speed may jump besides, and s that one that is held may be late
SPEED_MARGIN, MAX_HOLD_S = 2.0, 1.0
# role -> in its unit, below which no change is a jump
LEAST_JUMP = {"speed": SPEED_MARGIN, "range_rate": 0.3, "pedal": 5.0}
# median changes from one number to the next, 5.4 standard deviations of a normal change: what is farther is a jump
FAR_CHANGES = 8.0
# of the median by which it moves with each change (Robbins & Monro 1951), and changes that are needed for it
GAIN, MIN_CHANGES = 0.05, 20
# role -> in its unit; what jumps farther is measured by no sensor of a lead
IMPOSSIBLE = {"speed": 0.0, "range_rate": 20.0, "pedal": np.inf}
# jumps to a number and back that show what it stands for, and numbers that are remembered
MIN_VISITS, MAX_NUMBERS = 3, 16
# %; a pedal's range
PEDAL_RANGE = (0.0, 100.0)


class Watch(NamedTuple):
    """One signal."""

    value: float = NAN  # latest that was reached by steps, or confirmed by one
    since: float = NAN  # s, of its first reading
    t: float = NAN  # s, of the latest reading
    number: float = NAN  # reached by a jump and not left since; NaN: none
    begin: float = NAN  # s, of its first reading
    change: Annotated[float, NOT_NEGATIVE] = 0.0  # median of the changes from one number to the next
    changes: int = 0  # behind it
    visits: Mapping[float, int] = {}  # number -> jumps to it and back


State = Mapping[str, Watch]


def init() -> State:
    """Return the state before the first reading."""
    return {}


def step(state: State, decoded: Decoded, t: Array) -> tuple[State, Decoded, Mapping[str, int]]:
    """Take a chunk.

    Args:
        state: from `init()` or the chunk before.
        decoded: the chunk's readings.
        t: (n,) s, of its frames.

    Returns:
        the state; the readings, with NaN in the place of numbers that stand for none; and how many those were, by
        sentence.

    Example:
        >>> from canid.signals.vehicle.decoding_state import RoleReadings
        >>> rows, speed = np.arange(6), np.array([20.0, 20.1, -1.0, -1.0, 20.3, 20.4])
        >>> _, decoded, counts = step(init(), Decoded((RoleReadings("speed", rows, speed),), (), ()), 0.1 * rows)
        >>> decoded.roles[0].value.tolist(), dict(counts)
        ([20.0, 20.1, nan, nan, 20.3, 20.4], {'speed: -1 m/s is reached by a jump that no vehicle makes, not measured': 2})
    """
    after, roles, counts = dict(state), list(decoded.roles), Counter[str]()
    for k, readings in enumerate(decoded.roles):
        role = readings.role
        if role not in MAX_SLOPE:
            continue
        after[role], none = codes(after.get(role, Watch()), role, t[readings.row], readings.value)
        if none.any():
            roles[k] = readings._replace(value=np.where(none, NAN, readings.value))
            why = "a jump that no vehicle makes" if role == "speed" else "jumps alone"
            unit = f" {ROLES[role].unit}"
            for number in readings.value[none].tolist():
                counts[f"{role}: {number:.4g}{unit} is reached by {why}, not measured"] += 1
    return after, decoded._replace(roles=tuple(roles)) if counts else decoded, counts


def codes(watch: Watch, role: str, t: Array, value: Array) -> tuple[Watch, Flags]:
    """Which readings of one signal stand for "not measured", (n,).

    Args:
        watch: before them.
        role: of `MAX_SLOPE`.
        t: (n,) s.
        value: (n,) in the role's unit.

    Example:
        >>> t = 0.1 * np.arange(100)
        >>> rate = np.where(np.arange(100) % 20 == 19, 0.0, 2.0 + 0.1 * np.sin(5.0 * t))
        >>> codes(Watch(), "range_rate", t, rate)[1].nonzero()[0].tolist()
        [99]
    """
    none = np.zeros(len(t), dtype=bool)
    for k, (at, x) in enumerate(zip(t.tolist(), value.tolist(), strict=True)):
        # what is not measured changes nothing
        if x == x:
            watch = _reading(watch, role, at, x)
            if x == watch.number:
                none[k] = watch.visits.get(x, 0) >= MIN_VISITS or abs(x - watch.value) > IMPOSSIBLE[role]
    return watch, none


def _reading(watch: Watch, role: str, t: float, x: float) -> Watch:
    value, since, latest, number, begin, change, changes, visits = watch
    if not 0.0 <= t - latest <= MAX_REPORT_AGE_S:
        # also the first: what happened meanwhile is not known
        return Watch(x, t, t, NAN, NAN, change, changes, visits)
    if x in (number, value):
        back = x == value and number == number
        visits = _counted(visits, number, 1) if back else visits
        kept = (NAN, NAN) if back else (number, begin)
        return Watch(value, since, t, *kept, change, changes, visits)
    if number == number:
        if abs(x - number) <= _jump(watch, role, t - begin):
            # it moves on by a step: it was measured
            return Watch(x, t, t, NAN, NAN, change, changes, _counted(visits, number, -1))
        if abs(x - value) <= _jump(watch, role, t - since) + MAX_SLOPE[role] * (t - since):
            visits = _counted(visits, number, 1)
        return Watch(x, t, t, NAN, NAN, change, changes, visits)
    far = abs(x - value)
    if far > _jump(watch, role, t - since) and (role != "pedal" or not PEDAL_RANGE[0] <= x <= PEDAL_RANGE[1]):
        return watch._replace(t=t, number=x, begin=t)
    changes = min(changes + 1, MIN_CHANGES)
    change = far if changes == 1 else change * (1.0 + GAIN) if far > change else change / (1.0 + GAIN)
    return Watch(x, t, t, NAN, NAN, change, changes, visits)


def _jump(watch: Watch, role: str, age: float) -> float:
    """What is farther from a number of this age, s, is reached by a jump."""
    least = LEAST_JUMP[role] if watch.changes >= MIN_CHANGES or role == "speed" else np.inf
    if role == "speed":
        return least + MAX_SLOPE[role] * min(age, MAX_HOLD_S)
    return max(least, FAR_CHANGES * watch.change)


def _counted(visits: Mapping[float, int], number: float, n: int) -> Mapping[float, int]:
    """One more jump to a number and back, or one less; the numbers that came longest ago are forgotten."""
    rest = [(each, count) for each, count in visits.items() if each != number][-MAX_NUMBERS + 1 :]
    count = visits.get(number, 0) + n
    return dict([*rest, (number, count)] if count > 0 else rest)
