"""What every method of the table gets: the same rows, aligned, smoothed and masked alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import Sample

# samples from one estimate of an online method to the next: 1 s
EVERY = 10
# samples below which nothing is estimated online: 5 s
FEWEST = 50


class Rows(NamedTuple):
    """One drive at 10 Hz."""

    dt: float  # s
    output: np.ndarray  # (n,) % or m/s²
    inputs: np.ndarray  # (n, 2) headway error s, range rate m/s
    usable: np.ndarray  # (n,) bool: a person drives with the pedal, and all is measured
    segment: np.ndarray  # (n,)
    speed: np.ndarray  # (n,) m/s
    gap: np.ndarray  # (n,) m
    # the true vehicle and what disturbs it, for methods that know no pedal
    gain: float  # m/s² per unit of the output
    remnant: float  # m/s², sd of the acceleration that the model does not give

    def until(self, n: int) -> Rows:
        """Return the first n rows."""
        cut = (column[:n] if isinstance(column, np.ndarray) else column for column in self)
        return Rows(*cut)


def masked(columns: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Join what is missing by lines, and say where nothing was: no method but canid reads NaN."""
    known = np.all([np.isfinite(column) for column in columns], axis=0)
    at = np.arange(len(known))
    return [np.interp(at, at[known], column[known]) for column in columns], known


def of_samples(samples: Sequence[Sample], dt: float, gain: float, remnant: float) -> Rows:
    """Make rows of canid's samples, masked by its gate."""
    columns = [
        np.array([s.output for s in samples]),
        *np.array([s.inputs for s in samples]).T,
        np.array([s.signals["speed"] for s in samples]),
        np.array([s.signals["gap"] for s in samples]),
    ]
    (output, headway_error, range_rate, speed, gap), known = masked(columns)
    usable = known & np.array([s.learn for s in samples])
    segment = np.array([s.segment for s in samples])
    return Rows(
        dt, output, np.column_stack([headway_error, range_rate]), usable, segment, speed, gap, gain, remnant
    )
