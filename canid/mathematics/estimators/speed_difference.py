"""An acceleration that is made of the recorded speed: how many samples it spans, and the drive that no longer shows it.

The speed's noise is then in the output, and in headway and range rate as well. A difference over two samples or more has
nothing at the highest frequency; whitening lifts that empty band, and what is left in it of the common noise passes for an
answer: of drives of 9 min with 3 mm/s of noise K1 came out twice as large (z 2 to 3), whether the difference is central or
late. Of samples as far apart as it spans it is a difference of neighbours, and K1 is as without (z 0.2 to 0.5). One of
neighbouring samples moves no gain by more than its interval.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import autoregression
from canid.values.output_role import output_role
from canid.values.types import Array, Trace

Flags = npt.NDArray[np.bool_]

# samples by which the output may be ahead of the speed, and behind it: centred differences over 0.6 s at 10 Hz, an output
# that comes up to 0.4 s late, and what undoes the lines between the readings of a speed
AHEAD, BACK = 4, 9
# samples, with which an autocorrelation is known to 0.07
MIN_ROWS = 200
# of its own innovations, by which an output may differ from what the speed's differences say; rounding of more than that
# hides whether the one is made of the other
MAX_SHARE = 0.5
# likewise, where no rounding comes between
EXACT_SHARE = 0.01
# Autocorrelation of what differs at the span of a difference: it is -0.5 where it is the rounding of the recorded speed,
# whose difference it is as well, and near 0 beyond one sample where the output is an acceleration of its own.
AT_SPAN = -1.0 / 3.0
# standard deviation of a normal over the median of its absolute value, and beyond how many of them a sample is another thing
SD_OF_MEDIAN, CLIPPED = 1.4826, 4.0
# samples; a difference that comes between the samples has small weights besides
SPAN_ROUNDING = 0.1
# highest order of the output's own noise model
ORDER = 5
# why samples are farther apart
SAID = "the acceleration is a difference of the recorded speed, whose noise is in headway too"
# s; a driver's answer does not show in samples that are farther apart
MAX_SAMPLE_TIME_S = 0.8


def without_common_noise(trace: Trace, usable: Flags) -> tuple[Trace, Flags]:
    """Take samples as far apart as the output's difference of the recorded speed spans; any other drive stays as it is.

    Args:
        trace: of a drive, or of several.
        usable: (n,) samples that are fitted.
    """
    every = min(span(trace, usable), int(MAX_SAMPLE_TIME_S / trace.dt + 1e-9))
    return (trace, usable) if every < 2 else (thinned(trace, every), usable[::every])


def span(trace: Trace, usable: Flags) -> int:
    """How many samples the output spans as a difference of the recorded speed; 0: it is none.

    Args:
        trace: of a drive, at the rate at which it was sampled.
        usable: (n,) samples that are fitted.
    """
    if output_role(trace) != "accel" or trace.t.size <= AHEAD + BACK:
        return 0
    speed = trace.signals["speed"]
    # (rows, AHEAD + BACK) mean accelerations between neighbours, the latest first
    between = np.lib.stride_tricks.sliding_window_view(np.diff(speed) / trace.dt, AHEAD + BACK)[:, ::-1]
    here = slice(BACK, trace.t.size - AHEAD)
    rows = usable[here] & np.isfinite(between).all(axis=1) & np.isfinite(trace.output[here])
    innovation = _innovation(trace.output, usable)
    if np.count_nonzero(rows) < MIN_ROWS or not innovation > 0.0:
        return 0
    X, y = between[rows], trace.output[here][rows]
    X, y = X - X.mean(axis=0), y - y.mean()
    weight = np.linalg.lstsq(X, y, rcond=None)[0]
    left = np.zeros(rows.size)
    left[rows] = y - X @ weight
    sd = SD_OF_MEDIAN * float(np.median(np.abs(left[rows])))
    share = sd / innovation
    if share < EXACT_SHARE:
        return int(float(np.abs(weight).sum()) ** 2 / float(weight @ weight) + SPAN_ROUNDING)
    left = np.clip(left, -CLIPPED * sd, CLIPPED * sd)
    at = [float(left[lag:] @ left[:-lag]) / float(left @ left) for lag in range(1, BACK + 1)]
    lowest = int(np.argmin(at))
    return lowest + 1 if share < MAX_SHARE and at[lowest] < AT_SPAN else 0


def _innovation(output: Array, usable: Flags) -> float:
    """Standard deviation of what an output's own past does not show; 0: too few samples."""
    known = usable & np.isfinite(output)
    if not known.any():
        return 0.0
    y = np.where(known, output - output[known].mean(), 0.0)
    noise = autoregression.fit(y, known, ORDER)
    return float(np.std(autoregression.whiten(y, noise)[autoregression.whole(known, len(noise))]))


def thinned(trace: Trace, every: int = 2, first: int = 0) -> Trace:
    """Every second sample, or of so many one, from the one numbered `first` on."""
    part = slice(first, None, every)
    return trace._replace(
        dt=every * trace.dt,
        t=trace.t[part],
        output=trace.output[part],
        inputs=trace.inputs[part],
        gate=trace.gate[part],
        learn=trace.learn[part],
        segment=trace.segment[part],
        signals={role: x[part] for role, x in trace.signals.items()},
        bound=None if trace.bound is None else trace.bound[part],
        variance=None if trace.variance is None else trace.variance[part],
    )
