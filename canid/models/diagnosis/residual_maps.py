"""Where the simulation is wrong: in time, over operating points, over frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import coherence, welch

from canid.values.findings import Flags, OperatingMap, Spectra, Window
from canid.values.types import Array

# s; long enough for one manoeuvre
ERROR_WINDOW_S = 15.0
WORST_WINDOWS = 5
MAP_BINS = 8
# s that a bin must hold to be shown
MIN_BIN_S = 5.0
# s of a spectrum's segment: 0.02 Hz
SEGMENT_S = 51.2


def worst(t: Array, before: Array, after: Array, used: Flags, dt: float) -> tuple[Window, ...]:
    """The windows in which the baseline's residual is largest, worst first; they do not overlap."""
    size = round(ERROR_WINDOW_S / dt)
    windows = []
    for start in range(0, max(t.size - size, 0) + 1, size):
        part = slice(start, start + size)
        here = used[part]
        if here.sum() * 2 < size:
            continue
        rms = [float(np.sqrt(np.mean(x[part][here] ** 2))) for x in (before, after)]
        windows.append(Window(float(t[part][0]), float(t[part][-1]) + dt, *rms))
    return tuple(sorted(windows, key=lambda window: -window.before)[:WORST_WINDOWS])


def operating_map(
    x: tuple[str, Array], y: tuple[str, Array], before: Array, after: Array, used: Flags, dt: float
) -> OperatingMap:
    """Mean residual over two signals."""
    edges = []
    for _, values in (x, y):
        low, high = np.quantile(values[used], (0.01, 0.99)) if used.any() else (0.0, 1.0)
        edges.append(np.linspace(low, max(high, low + 1e-6), MAP_BINS + 1))
    a = np.clip(np.searchsorted(edges[0], x[1][used]) - 1, 0, MAP_BINS - 1)
    b = np.clip(np.searchsorted(edges[1], y[1][used]) - 1, 0, MAP_BINS - 1)
    cell = a * MAP_BINS + b
    count = np.bincount(cell, minlength=MAP_BINS * MAP_BINS)
    seconds = np.asarray((count * dt).reshape(MAP_BINS, MAP_BINS), dtype=np.float64)
    means = []
    for r in (before, after):
        total = np.bincount(cell, weights=r[used], minlength=MAP_BINS * MAP_BINS)
        mean = (total / np.maximum(count, 1)).reshape(MAP_BINS, MAP_BINS)
        means.append(np.asarray(np.where(seconds >= MIN_BIN_S, mean, np.nan), dtype=np.float64))
    return OperatingMap(x[0], y[0], edges[0], edges[1], means[0], means[1], seconds)


def spectra(
    before: Array, after: Array, inputs: Mapping[str, Array], used: Flags, dt: float
) -> Spectra | None:
    """Spectrum of the residual, and its coherence with each input; unused samples count as no residual."""
    size = round(SEGMENT_S / dt)
    if used.sum() < 3 * size:
        return None
    r = [np.where(used, x - np.mean(x[used]), 0.0) for x in (before, after)]
    f, p0 = welch(r[0], 1 / dt, nperseg=size)
    _, p1 = welch(r[1], 1 / dt, nperseg=size)
    columns = {name: np.where(used, x - np.mean(x[used]), 0.0) for name, x in inputs.items()}
    c0, c1 = (
        {name: np.asarray(coherence(x, e, 1 / dt, nperseg=size)[1]) for name, x in columns.items()} for e in r
    )
    # half-overlapping Hann segments are worth some 0.8 of their number (Welch 1967)
    segments = max(0.8 * (2 * before.size / size - 1), 2.0)
    level = 1 - 0.01 ** (1 / (segments - 1))
    keep = (f > 0) & (f <= 2.5)
    return Spectra(
        f[keep], p0[keep], p1[keep],
        {k: v[keep] for k, v in c0.items()}, {k: v[keep] for k, v in c1.items()}, float(level),
    )  # fmt: skip
