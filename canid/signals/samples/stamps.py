"""Intervals between the stamps of a message: how regularly it comes, in whole microseconds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import NAN, Array

# s; stamps are summed up over so long
SPAN_S = 10.0
# s; a longer interval is a pause of the sender, not its jitter
MAX_INTERVAL_S = 2.0

# of the shortest interval; a mean that is farther from it is not that of its multiples
MAX_JITTER = 0.1

_MICROSECONDS = 1e6


class StampIntervals(NamedTuple):
    """The intervals of `SPAN_S` s."""

    role: str  # one that the message carries
    t: float  # s, of the reading behind them
    number: int  # of intervals
    mean: float  # s, of them
    sd: float  # s, their standard deviation
    shortest: float = NAN  # s, of the span before; NaN: there is none
    off: float = NAN  # s, root mean square distance from the multiples of that


class Tally(NamedTuple):
    """Sums of one message."""

    span: int = -1  # which `SPAN_S` is being filled
    last: int = -1  # µs, of the last reading; -1: none
    number: int = 0
    total: int = 0
    squares: int = 0
    nominal: int = 0  # µs, the shortest of the span before, without its jitter; 0: there is none
    shortest: int = 0  # µs, in this span
    off: int = 0  # µs², squared distances from multiples of `nominal`
    multiples: int = 0  # of these, the sum


State = Mapping[str, Tally]


def init() -> State:
    """Return the state before the first reading."""
    return {}


def step(
    state: State, role: str, t: Array, row: npt.NDArray[np.int64]
) -> tuple[State, list[tuple[int, StampIntervals]]]:
    """Take the stamps of a message.

    Args:
        state: from `init()` or the step before.
        role: one that the message carries.
        t: (n,) s, ascending.
        row: (n,) of the frame that brought each.

    Returns:
        The state, and the intervals of every span that is over, with the row of the first reading behind it. Whole
        numbers are summed, so the result does not depend on how the readings are divided.

    Example:
        >>> state, spans = step(init(), "gap", np.arange(0.0, 10.2, 0.05), np.arange(204))
        >>> spans[0][1].number, spans[0][1].mean
        (199, 0.05)
    """
    tally = state.get(role, Tally())
    span, last, number, total, squares, nominal, shortest, off, multiples = tally
    out = []
    for at, k in zip(t.tolist(), row.tolist(), strict=True):
        now = round(at * _MICROSECONDS)
        here = int(at // SPAN_S)
        if here != span:
            if number:
                mean = total / number / _MICROSECONDS
                variance = squares / number / _MICROSECONDS**2 - mean * mean
                apart = (NAN, NAN)
                if nominal:
                    apart = nominal / _MICROSECONDS, math.sqrt(off / number) / _MICROSECONDS
                out.append((k, StampIntervals(role, at, number, mean, math.sqrt(max(variance, 0.0)), *apart)))
            # the shortest is so by its jitter, which the mean of the multiples is not
            nominal = round(total / multiples) if multiples else shortest
            nominal = nominal if abs(nominal - shortest) <= MAX_JITTER * shortest else shortest
            span, number, total, squares, shortest, off, multiples = here, 0, 0, 0, 0, 0, 0
        interval = now - last
        if last >= 0 and 0 <= interval <= MAX_INTERVAL_S * _MICROSECONDS:
            number += 1
            total += interval
            squares += interval * interval
            shortest = interval if number == 1 else min(shortest, interval)
            if nominal:
                rest = interval % nominal
                off += min(rest, nominal - rest) ** 2
                multiples += (2 * interval + nominal) // (2 * nominal)
        last = now
    after = Tally(span, last, number, total, squares, nominal, shortest, off, multiples)
    return {**state, role: after}, out
