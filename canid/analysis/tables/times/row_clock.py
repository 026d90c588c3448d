"""The clock of a table's rows, where it begins anew or is changed to summer time while the rows are in order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.samples import clock_wraps, session_clock
from canid.values.types import Array

DAY_S = 86_400.0
_HOUR_S = 3600.0
# h; summer time begins and ends at night
_CHANGES_UNTIL = 4
# s; a step back of a time of day by less than this is a row out of order, not the next day
_MIN_NIGHT_S = 2 * _HOUR_S
# nights within a table; with more steps back its rows are in no order
_MAX_NIGHTS = 31

# a row of noise, and a row that is missing at the seam: another drive differs by far more
_MUCH = 3.0

# times that a clock is set within a table, and the share of the shorter of two parts that it is set back by at most:
# where they overlap by more they may be two drives
_MAX_SET, _SET_SHARE = 3, 0.5
# as many rows as elsewhere, times this: more are those of two parts
_TWICE = 1.5

# counts after which a counter of 16, 24 and 32 bits begins anew
_COUNTERS = (2.0**16, 2.0**24, 2.0**32)

_Rows = npt.NDArray[np.int64]


class Clock(NamedTuple):
    """Times of rows whose clock goes on."""

    t: Array  # (n,) s
    says: str


def unwrapped(t: Array, zero: float, columns: Sequence[Array], *, local: bool) -> Clock | None:
    """Times in the order of the rows, where every step back is the clock's and not the rows'.

    It is one by a known period, over the instant at which that clock does begin anew; or the clock was set back, by less
    than half of what the rows last before and behind it, and the drive is cut in two there. The columns go on across it:
    another drive, or rows in another order, are none.

    Args:
        t: (n,) s, of the rows as they stand; NaN: no time.
        zero: s, what the clock shows at t = 0.
        columns: (n,) each, measured values.
        local: whether it is a time of day without a zone, which summer time changes.

    Returns:
        None where no step is one of these, or another one is left.

    Example:
        >>> t = np.array([59.8, 59.9, 0.0, 0.1])
        >>> unwrapped(t, 0.0, [np.array([5.0, 5.1, 5.2, 5.3])], local=False).t.round(6).tolist()
        [59.8, 59.9, 60.0, 60.1]
        >>> unwrapped(t, 0.0, [np.array([5.0, 5.1, 9.0, 9.1])], local=False) is None
        True
    """
    known = np.flatnonzero(np.isfinite(t))
    steps = np.diff(t[known])
    if not (steps > 0.0).any():
        return None
    usual = float(np.median(steps[steps > 0.0]))
    added = np.zeros(len(known))
    said: dict[str, None] = {}
    seams = np.flatnonzero((steps < -session_clock.MAX_REORDERING_S) | (local & (steps > _HOUR_S)))
    edges = [0, *(np.flatnonzero(steps < -session_clock.MAX_REORDERING_S) + 1).tolist(), len(known)]
    for k in seams.tolist():
        # as the clock shows them: whole µs, where doubles end of a clock since 1970
        before, behind = (round(zero + float(t[known[row]]), 6) for row in (k, k + 1))
        wrap = clock_wraps.wrap_of(before - behind, 0.0)
        if wrap is not None and _at_its_end(before, behind, wrap):
            added[k + 1] = wrap.period
            said[wrap.says] = None
        elif steps[k] > 0.0:
            if _to_summer_time(before, behind, usual):
                added[k + 1] = -_HOUR_S
                said["summer time begins"] = None
        elif len(edges) <= _MAX_SET + 2 and _is_set(t[known], k, edges):
            added[k + 1] = session_clock.CUT_S - steps[k]
            said[f"the clock is set back by {-steps[k]:.1f} s: the drive is cut in two there"] = None
        else:
            return None
    changed = np.flatnonzero(added)
    if not len(changed) or not _go_on(columns, known, changed):
        return None
    out = t.copy()
    out[known] = session_clock.rounded(t[known] + np.cumsum(added), float(np.abs(t[known]).max()))
    return Clock(out, "; ".join(said))


def counted(t: Array, columns: Sequence[Array]) -> Array | None:
    """Whole numbers of a counter of 16, 24 or 32 bits that begins anew, as one that goes on, in whatever unit it counts.

    Args:
        t: (n,) counts, of the rows as they stand; NaN: none.
        columns: (n,) each, measured values, which go on across it.

    Example:
        >>> t = np.array([65_300.0, 65_400.0, 65_500.0, 64.0, 164.0])
        >>> counted(t, [np.arange(5.0)]).tolist(), counted(t - 9_000.0, [np.arange(5.0)])
        ([65300.0, 65400.0, 65500.0, 65600.0, 65700.0], None)
    """
    known = np.flatnonzero(np.isfinite(t))
    steps = np.diff(t[known])
    back = steps < 0.0
    if not back.any() or not (steps > 0.0).any() or (t[known] != np.rint(t[known])).any():
        return None
    usual = float(np.median(steps[steps > 0.0]))
    for period in _COUNTERS:
        across = steps[back] + period
        if (
            t[known].min() >= 0.0
            and t[known].max() < period
            and (across > 0.0).all()
            and across.max() <= _MUCH * usual
        ):
            out = t.copy()
            out[known[1:]] += period * np.cumsum(back)
            return out if _go_on(columns, known, np.flatnonzero(back) + 1) else None
    return None


def _at_its_end(before: float, behind: float, wrap: clock_wraps.Wrap) -> bool:
    """Whether a clock begins anew between two times."""
    last, first = ((t - wrap.begins) % wrap.period for t in (before, behind))
    return first <= clock_wraps.MAX_STEP_S and last >= wrap.period - clock_wraps.MAX_STEP_S


def _to_summer_time(before: float, behind: float, usual: float) -> bool:
    """Whether a jump ahead is the hour that is left out when summer time begins, and no pause."""
    step = behind - before - _HOUR_S
    at_night = behind % DAY_S < _CHANGES_UNTIL * _HOUR_S
    return at_night and 0.0 < step < 2.0 * usual and behind % _HOUR_S < 2.0 * usual


def _is_set(t: Array, k: int, edges: Sequence[int]) -> bool:
    """Whether the step back behind row k begins a part of which the first rows have the times of the last before it."""
    place = edges.index(k + 1)
    parts = t[edges[place - 1] : k + 1], t[k + 1 : edges[place + 1]]
    back = float(t[k] - t[k + 1])
    if not session_clock.MAX_REORDERING_S < back <= _SET_SHARE * min(float(np.ptp(part)) for part in parts):
        return False
    steps = np.diff(t)
    # rows that exchanged their places are as many as anywhere
    expected = back * len(t) / steps[steps > 0.0].sum()
    return bool(((t > t[k + 1]) & (t < t[k])).sum() > _TWICE * expected)


def _go_on(columns: Sequence[Array], known: _Rows, seams: _Rows) -> bool:
    """Whether no column changes much more across the seams than elsewhere between two of its values."""
    across = np.zeros(len(known), bool)
    across[seams] = True
    judged = False
    for column in columns:
        values = column[known]
        there = np.flatnonzero(np.isfinite(values))
        change = np.abs(np.diff(values[there]))
        # the changes between whose two values there is a seam
        which = np.diff(np.cumsum(across)[there]) > 0
        if which.any() and not which.all():
            judged = True
            if change[which].max() > _MUCH * change[~which].max():
                return False
    return judged


def over_midnight(t: Array, zero: float) -> Clock:
    """Times of day without dates go on behind midnight, and those of twelve hours behind 12:59:59.

    Args:
        t: (n,) s since the first, within a day, in the order of the rows.
        zero: s, what the clock shows at t = 0.

    Example:
        >>> over_midnight(np.array([0.0, 1.0, 1.0 - 86_398.0]), 86_399.0).t.tolist()  # the next one 2 s later
        [0.0, 1.0, 3.0]
        >>> over_midnight(np.array([0.0, -43_199.0]), 46_799.0)  # 12:59:59, 1:00:00
        Clock(t=array([0., 1.]), says='the clock of twelve hours goes on from 12:59:59 to 1:00')
    """
    wrap = clock_wraps.TWELVE_HOURS
    shown = (zero + t).round(6).tolist()
    anew = [clock_wraps.wrap_of(a - b, 0.0) is wrap and _at_its_end(a, b, wrap) for a, b in pairwise(shown)]
    t = t + wrap.period * np.cumsum([False, *anew])
    # a jump ahead by hours is a pause; one by nearly a day is a row out of order, from before midnight
    kept = np.unwrap(t, discont=DAY_S - _HOUR_S, period=DAY_S)
    nights = np.diff(kept, prepend=kept[:1]) < -_MIN_NIGHT_S
    paused = np.asarray(kept + DAY_S * np.cumsum(nights))
    if (
        nights.sum() > _MAX_NIGHTS
        or (np.diff(paused) < -session_clock.MAX_REORDERING_S).any()
        or _one_piece(kept)
    ):
        paused = np.asarray(np.unwrap(t, period=DAY_S))
    over = np.ptp(paused - t) > 1.0 if len(t) else False
    return Clock(paused, "; ".join([wrap.says] * any(anew) + [clock_wraps.MIDNIGHT.says] * bool(over)))


def _one_piece(t: Array) -> bool:
    """Whether times that are not in order are those of one stretch without a pause, in another order of its parts."""
    ordered = np.sort(t)
    return bool((np.diff(t) < 0.0).any() and np.diff(ordered).max() <= clock_wraps.MAX_STEP_S)
