"""The band in which a residual has content: how far apart rows are taken so that no empty band is whitened."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array, OutputFilter


class Band(NamedTuple):
    """How far a band reaches, by the power of the residual's changes."""

    share: float  # of that power, which lies below a frequency
    wide: float  # Hz; where that frequency is above, rows are taken `short` s apart
    narrow: float  # Hz; where it is below, `long` s; in between in proportion
    short: float  # s; 0: every row
    long: float  # s


# An output that was smoothed (an acceleration from speeds) has noise without content above some frequency. Whitening
# would lift that empty band and fit K, tau and dead time to what leaked into it. Rows further apart end the band; all
# phases are used, and the distance grows by single rows, so that little depends on where a log is cut. Of the changes of
# white, Ornstein-Uhlenbeck and mixed noise three quarters of the power reach beyond 3 Hz; behind a Savitzky-Golay filter
# of 1.1 s they end at 0.5 Hz, and 97 % between 0.8 Hz (speeds known to 3 mm/s) and 4 Hz (20 mm/s). A person's answer
# ends below 1 Hz: where the band ends there without need, intervals grow by a per cent.
BANDS = (Band(0.75, 2.5, 1.25, 0.0, 0.5), Band(0.97, 0.8, 0.5, 0.5, 1.0))
# s; rows apart where nobody knows how the output was smoothed
UNKNOWN_FILTER_S = 0.5
# s; the same at most where no filter stands between driver and output. Noise that ends below 1 Hz is the driver's own
# then, a resonance for instance, and in a closed loop it comes back as input after the vehicle's response: rows further
# apart than a dead time would take it for an answer (intervals of 95 % held tau in 4 of 9 drives)
UNFILTERED_S = 0.2


class Strides(NamedTuple):
    """How far apart rows may be taken."""

    least: int = 1
    most: int = 1_000_000


ANY = Strides()


def strides(step: float, output_filter: OutputFilter | None = None) -> Strides:
    """Return the limits for rows `step` s apart of an output that has passed a filter; None: nothing is said of one.

    >>> strides(0.1, OutputFilter("unknown")).least, strides(0.1, OutputFilter("none"))
    (5, Strides(least=1, most=2))
    """
    if output_filter is not None and output_filter.kind == "unknown":
        return Strides(max(round(UNKNOWN_FILTER_S / step), 1))
    if output_filter is not None and output_filter.kind == "none":
        return Strides(1, max(round(UNFILTERED_S / step), 1))
    return ANY


def stride(residual: Array, usable: npt.NDArray[np.bool_], step: float, limits: Strides = ANY) -> int:
    """Rows from one to the next so that no empty band is whitened, see BANDS.

    Args:
        residual: (n,), zero where not usable.
        usable: (n,).
        step: s, of the rows.
        limits: of the answer.

    >>> white = np.random.default_rng(0).normal(size=600)
    >>> stride(white, np.full(600, True), 0.1), stride(np.cumsum(np.cumsum(white)), np.full(600, True), 0.1)
    (1, 10)
    """
    change = (residual[1:] - residual[:-1]) * (usable[1:] & usable[:-1])
    of_change = np.abs(np.fft.rfft(change)) ** 2
    total = float(of_change.sum())
    if len(of_change) < 16 or not total > 0.0:
        return limits.least
    frequency = np.fft.rfftfreq(len(change), step)
    below = np.cumsum(of_change) / total
    apart = 0.0
    for entry in BANDS:
        reach = float(np.interp(entry.share, below, frequency))
        part = min(max((entry.wide - reach) / (entry.wide - entry.narrow), 0.0), 1.0)
        apart = max(apart, entry.short * (part > 0.0) + (entry.long - entry.short) * part)
    return min(max(round(apart / step), limits.least), limits.most)
