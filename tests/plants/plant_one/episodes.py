"""When something happens that lasts for a while: drawn at random, never two at once, none at either end."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Episodes = list[list[float]]

MARGIN_S = 15.0  # s at both ends of the drive in which nothing happens
MIN_PAUSE_S = 4.0  # s between two episodes at least


def draw(
    minutes: float, number: float, length: tuple[float, float], dt: float, rng: np.random.Generator
) -> Episodes:
    """Draw about `number` episodes [start, stop] in s, at least one, of lengths uniform within `length`.

    Each has a stretch of the drive for itself; one that does not fit there is cut. Both ends are whole steps of dt.

    >>> draw(2.0, 2, (2.0, 4.0), 0.1, np.random.default_rng(1))
    [[51.1, 54.1], [96.7, 99.0]]
    """
    room = 60.0 * minutes - 2.0 * MARGIN_S
    count = max(min(round(number), int(room / (MIN_PAUSE_S + length[0]))), 1)
    share = room / count
    out = []
    for i in range(count):
        long = min(float(rng.uniform(*length)), share - MIN_PAUSE_S)
        start = MARGIN_S + i * share + float(rng.uniform(0.0, share - MIN_PAUSE_S - long))
        out.append([round(round(x / dt) * dt, 9) for x in (start, start + long)])
    return out


def inside(episodes: Episodes, n: int, dt: float) -> npt.NDArray[np.bool_]:
    """Mark which of n samples lie in an episode, the start belonging to it.

    >>> inside([[0.2, 0.4]], 6, 0.1).tolist()
    [False, False, True, True, False, False]
    """
    out = np.zeros(n, dtype=bool)
    for start, stop in episodes:
        out[round(start / dt) : round(stop / dt)] = True
    return out
