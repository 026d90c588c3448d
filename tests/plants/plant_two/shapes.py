"""Smooth forms of corners: each meets its hard counterpart far from the corner, so that its parameter means the same."""

from __future__ import annotations

import math


def above(x: float, corner: float, soft: float) -> float:
    """max(x - corner, 0) with a round corner (softplus); `soft` in the unit of x.

    >>> round(above(9.0, 4.0, 0.5), 3), round(above(4.0, 4.0, 0.5), 3), round(above(0.0, 4.0, 0.5), 3)
    (5.0, 0.347, 0.0)
    """
    z = (x - corner) / soft
    # beyond 30 the exponential is below the last digit of z
    return soft * z if z > 30.0 else soft * math.log1p(math.exp(z))


def below(x: float, level: float, soft: float) -> float:
    """min(x, level) with a round corner.

    >>> round(below(2.0, 9.0, 0.5), 3), round(below(20.0, 9.0, 0.5), 3)
    (2.0, 9.0)
    """
    return level - above(level, x, soft)


def dead_zone(x: float, width: float, soft: float) -> float:
    """What of x lies beyond ±width: a pair of round corners, odd in x.

    >>> round(dead_zone(2.0, 0.5, 0.1), 3), dead_zone(0.0, 0.5, 0.1), round(dead_zone(-2.0, 0.5, 0.1), 3)
    (1.5, 0.0, -1.5)
    """
    return above(x, width, soft) - above(-x, width, soft)


def hyperbolic_dead_zone(x: float, width: float, soft: float) -> float:
    """What of x lies beyond ±width: between two hyperbolas, whose corners are longer than softplus's.

    >>> round(hyperbolic_dead_zone(50.0, 0.5, 0.1), 3), hyperbolic_dead_zone(0.0, 0.5, 0.1)
    (49.5, 0.0)
    """
    return x + 0.5 * (math.hypot(x - width, soft) - math.hypot(x + width, soft))


def switch(x: float, soft: float) -> float:
    """0 far below zero, 1 far above, in between a logistic curve.

    >>> switch(-1e9, 0.1), switch(0.0, 0.1), switch(1e9, 0.1)
    (0.0, 0.5, 1.0)
    """
    return 0.5 * (1.0 + math.tanh(0.5 * x / soft))


def window(t: float, start: float, stop: float, ramp: float) -> float:
    """0 outside, 1 from `start` to `stop`, with half a cosine of length `ramp` after each.

    >>> window(0.9, 1.0, 3.0, 0.4), round(window(1.2, 1.0, 3.0, 0.4), 3), window(2.0, 1.0, 3.0, 0.4)
    (0.0, 0.5, 1.0)
    >>> round(window(3.2, 1.0, 3.0, 0.4), 3), window(3.5, 1.0, 3.0, 0.4)
    (0.5, 0.0)
    """
    if t <= start or t >= stop + ramp:
        return 0.0
    if t < start + ramp:
        return 0.5 - 0.5 * math.cos(math.pi * (t - start) / ramp)
    if t <= stop:
        return 1.0
    return 0.5 + 0.5 * math.cos(math.pi * (t - stop) / ramp)
