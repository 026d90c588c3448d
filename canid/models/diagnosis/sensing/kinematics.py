"""Gap against range rate by modulating functions: the gap's change is the integral of the range rate (Shinbrot 1957).

Over a window in which a smooth φ rises from 0 and falls back to it, ∫φ·(dg/dt) dt = −∫φ′·g dt (integration by parts). So
a noisy gap need not be differentiated, and both sides are averages whose noise is a thousandth of their variance: it does
not bias a regression between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis.causal_smoothing import roughness
from canid.values.findings import Flags
from canid.values.runs import runs
from canid.values.types import Array

# s over which the slope of a speed is taken, around the sample
SLOPE_SPAN_S = 0.5
# s; one window: long against the radar's noise, short against drifts
WINDOW_S = 6.0
# distance of neighbouring windows, as a share of a window: they share data, which blocks longer than a window account for
HOP_SHARE = 0.5
# s; of one block, some ten of a driver's time constants
BLOCK_S = 30.0


class Averages(NamedTuple):
    """One row per window."""

    rate: Array  # (m,) m/s, mean of the range rate
    change: Array  # (m,) m/s, mean change of the gap
    block: npt.NDArray[np.int64]  # (m,)
    noise: float  # m/s, standard deviation that the reports' own noise gives to rate − change


def averages(gap: Array, rate: Array, usable: Flags, dt: float) -> Averages:
    """Average gap and range rate over windows.

    Args:
        gap: (n,) m, as reported.
        rate: (n,) m/s, as reported.
        usable: (n,) a new stretch of True starts after each False: windows lie within one.
        dt: s.

    Example:
        >>> t = np.arange(600) * 0.1
        >>> found = averages(30 + np.sin(t), np.cos(t), np.ones(600, dtype=bool), 0.1)
        >>> bool(np.abs(found.rate - found.change).max() < 1e-4)
        True
    """
    m = round(WINDOW_S / dt)
    k = np.arange(m + 1) / m
    weight = np.sin(np.pi * k) ** 2
    slope = np.pi / (m * dt) * np.sin(2 * np.pi * k)
    area = float(weight.sum())
    rates, changes, blocks = [], [], []
    for first, stop in runs(usable):
        for i in range(first, stop - m, max(round(HOP_SHARE * m), 1)):
            rates.append(float(weight @ rate[i : i + m + 1]) / area)
            changes.append(-float(slope @ gap[i : i + m + 1]) / area)
            blocks.append(int(i * dt // BLOCK_S))
    of_rate = roughness(np.where(usable, rate, np.nan), 2) * float(np.linalg.norm(weight)) / area
    of_gap = roughness(np.where(usable, gap, np.nan), 3) * float(np.linalg.norm(slope)) / area
    noise = float(np.hypot(of_rate, of_gap))
    return Averages(np.array(rates), np.array(changes), np.array(blocks, dtype=np.int64), noise)


def two_ways(averages: Averages, rows: Flags) -> Array:
    """Regress each on the other: (slope, offset m/s, slope the other way, offset the other way).

    Noise in what a line is fitted against flattens it; fitted the other way round it steepens it. The truth lies
    between the two slopes rate/change.
    """
    x, y = averages.change[rows], averages.rate[rows]
    ones = np.ones(x.size)
    there = np.linalg.lstsq(np.stack([x, ones], axis=1), y, rcond=None)[0]
    back = np.linalg.lstsq(np.stack([y, ones], axis=1), x, rcond=None)[0]
    steep = 1 / back[0] if abs(back[0]) > 1e-9 else np.inf
    return np.array([there[0], there[1], steep, -back[1] * steep])


def slope(x: Array, dt: float) -> Array:
    """Slope of the least-squares line through `SLOPE_SPAN_S` s around each sample, (n,) per s.

    Example:
        >>> slope(np.arange(8.0), 0.1)[3:5].round(6)
        array([10., 10.])
    """
    k = max(round(SLOPE_SPAN_S / dt / 2), 1)
    weights = np.arange(k, -k - 1, -1.0)
    weights = weights / (dt * np.sum(weights * weights))
    return np.convolve(np.pad(x, k, mode="edge"), weights, mode="valid")
