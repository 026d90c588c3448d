"""The part of a log that is asked for: the only place where frames are left out for their time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.frame_columns import select
from canid.values.types import Array, Columns, Frame


class Window(NamedTuple):
    """From `start` to `stop`, both included; s since the log's first frame.

    A log may have frames that are earlier than its first one: two channels of an interface are some 0.1 ms out of order,
    two logs were joined. So where nobody asked for a start there is none, and 0 is one that was asked for.
    """

    start: float = -math.inf  # -inf: whatever is there, however early
    stop: float = math.inf

    @property
    def is_whole(self) -> bool:
        """Whether it is all of a log.

        >>> Window().is_whole, Window(start=0.0).is_whole
        (True, False)
        """
        return self.start == -math.inf and self.stop == math.inf

    @property
    def begin(self) -> float:
        """Where clocks, samples and time axes begin, s: at the log's first frame, or where it was asked for.

        >>> Window().begin, Window(5.0).begin
        (0.0, 5.0)
        """
        return max(self.start, 0.0)

    def holds(self, t: Array) -> npt.NDArray[np.bool_]:
        """Which times are in it.

        >>> Window(stop=1.0).holds(np.array([-0.001, 1.0, 1.5])).tolist()
        [True, True, False]
        """
        return (t >= self.start) & (t <= self.stop)

    def columns(self, chunk: Columns) -> Columns:
        """The frames of a chunk that are in it.

        >>> none = (np.zeros(2, kind) for kind in ("u2", "u4", "u1", "u1"))
        >>> Window(start=0.0).columns(Columns(np.array([-1.0, 0.0]), *none, np.zeros((2, 8), np.uint8))).t.tolist()
        [0.0]
        """
        if self.is_whole:
            return chunk
        inside = self.holds(chunk.t)
        return chunk if inside.all() else select(chunk, inside)

    def frames(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames that are in it, one by one; they keep their times.

        >>> [frame.t for frame in Window(0.5, 1.5).frames([Frame(t, 0, 1, b"") for t in (0.0, 1.0, 2.0)])]
        [1.0]
        """
        return (frame for frame in frames if self.start <= frame.t <= self.stop)


WHOLE = Window()
