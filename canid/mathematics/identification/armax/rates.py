"""Durations of the recursion, in s, as numbers of samples of a grid: what it forgets, tests and allows per sample."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

# s; the grid for which forgetting factors are stated
STATED_S = 0.1

# s; after which is forgotten, and whose summed score is compared with that of white innovations.
BLOCK_S = 2.0

# s; over which the variance is formed that a change is tested against.
RECENT_S = 10.0

# s; for so long may a zero of C remember, longer than any movement lasts: 0.995 at 10 Hz.
ZERO_MEMORY_S = 20.0

# s; of the long autoregression of the batch start, after which 1/C is gone for zeros up to 0.75 at 10 Hz.
LONG_AR_S = 1.5


class Rates(NamedTuple):
    """Of one grid."""

    block: int  # samples
    recent: int  # samples
    zero_radius: float
    long_order: int  # samples
    stated: float  # steps for which forgetting factors and probabilities are stated, in steps of this grid


@cache
def rates(dt: float) -> Rates:
    """Make them for a grid of `dt` s.

    >>> rates(0.1)
    Rates(block=20, recent=100, zero_radius=0.995, long_order=15, stated=1.0)
    >>> rates(0.2).block, round(rates(0.2).zero_radius, 3)
    (10, 0.99)
    """
    return Rates(
        max(round(BLOCK_S / dt), 2),
        max(round(RECENT_S / dt), 2),
        (1.0 - 0.1 / ZERO_MEMORY_S) ** (dt / STATED_S),
        max(round(LONG_AR_S / dt), 1),
        dt / STATED_S,
    )


def per_sample(factors: tuple[float, ...], dt: float) -> tuple[float, ...]:
    """Forgetting factors per sample of a grid of `dt` s, from those per STATED_S.

    >>> per_sample((0.98, 1.0), 0.1), [round(x, 4) for x in per_sample((0.98, 1.0), 0.2)]
    ((0.98, 1.0), [0.9604, 1.0])
    """
    return factors if dt == STATED_S else tuple([x ** (dt / STATED_S) for x in factors])
