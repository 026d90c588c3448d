"""Gain of a one-step log score on held-out data, nats per minute, with a bootstrap over stretches (Künsch 1989)."""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.fitting.held_out_gain import bootstrapped
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# s; longer than the memory of the noise's scale
STRETCH_S = 15.0
# fewer stretches do not show how much the gain varies
MIN_STRETCHES = 4


def gain(difference: Array, rows: Flags, dt: float) -> Interval:
    """Mean difference of two log scores; NaN with too few stretches.

    Args:
        difference: (n,) nats, of one-step densities by models that were fitted to other data.
        rows: (n,) samples that count.
        dt: s.

    Returns:
        nats/min.

    Example:
        >>> round(gain(np.full(6000, 0.01), np.ones(6000, dtype=bool), 0.1).low, 6)
        6.0
    """
    stretch = np.arange(rows.size) // max(round(STRETCH_S / dt), 1)
    columns = np.full(rows.size, dt / 60.0)[rows], difference[rows]
    return bootstrapped(columns, stretch[rows], MIN_STRETCHES, lambda sums: sums[1] / sums[0])
