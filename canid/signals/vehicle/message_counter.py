"""Rolling counters of messages: for how long one has repeated, and from when on its message counts as frozen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.signals.vehicle.bits import Bits, Bools, Payloads, Rows, raws_of
from canid.values.types import Array

# A counter that repeats once or twice is a frame sent twice by a gateway; five at 20 Hz are a quarter of a
# second in which the sender's program did not run. A slow message is not waited for that long: what its counter has
# said for longer than the role's `stale` is as old as a message that does not come.
FROZEN_AFTER_REPEATS = 5


class AliveCounter(NamedTuple):
    """A message's rolling counter: its last number, whether it ever moved, and for how many frames it has repeated."""

    last: float
    moved: bool = False
    repeats: int = 0
    moved_at: float = 0.0  # s, when it last moved


class CounterAge(NamedTuple):
    """For how long a counter has repeated, frame by frame; 0 where it never moved, or the frame ends before it."""

    repeats: Rows  # (n,) frames
    age: Array  # (n,) s


def frozen_frames(ages: CounterAge, stale: float) -> Bools | None:
    """In which frames the counter has repeated for too long; None: in none."""
    frozen = (ages.repeats >= FROZEN_AFTER_REPEATS) | (ages.age > stale)
    return frozen if frozen.any() else None


def counter_ages(
    before: AliveCounter | None, counter: Bits, frames: Payloads, t: Array
) -> tuple[AliveCounter | None, CounterAge | None]:
    """The counter after these frames, and for how long it has repeated in each of them."""
    raw, there = raws_of(counter, frames)
    long_enough = np.arange(len(raw)) if there is None else np.flatnonzero(there)
    if not long_enough.size:
        return before, None
    raw = raw[long_enough]
    last = raw[0] if before is None else before.last
    moved = np.concatenate([np.array([last], raw.dtype), raw[:-1]]) != raw
    index = np.arange(len(raw))
    latest = np.maximum.accumulate(np.where(moved, index, -1))
    # before the first move here: as long as it repeated before; a counter that never moved counts nothing
    ever = before is not None and before.moved
    if there is None and moved[1:].all() and (moved[0] or not ever):
        # the usual case: no frame repeats the one before
        moved_at_last = float(t[-1]) if len(raw) > 1 or moved[0] else 0.0
        return AliveCounter(raw[-1].item(), bool(moved.any()) or ever, 0, moved_at_last), None
    start = (-1 - before.repeats) if before is not None and ever else index
    repeats = np.where(latest >= 0, index - latest, index - start)
    t = t[long_enough]
    moved_at = np.where(latest >= 0, t[latest], before.moved_at if before is not None else 0.0)
    age = np.where((latest >= 0) | ever, t - moved_at, 0.0)
    after = AliveCounter(raw[-1].item(), bool(latest[-1] >= 0) or ever, int(repeats[-1]), float(moved_at[-1]))
    ages = CounterAge(np.zeros(len(frames.length), np.int64), np.zeros(len(frames.length)))
    ages.repeats[long_enough] = repeats
    ages.age[long_enough] = age
    return after, ages
