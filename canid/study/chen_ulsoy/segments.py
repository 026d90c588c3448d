"""Segments of a driver's logs (Chen & Ulsoy 2001, sec. 2.1): the first is left out, gaps and standing signals are rejected.

Segments are counted from the start of each log, so that segment k holds the seconds from 60 k to 60 (k + 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import firwin

from canid.study.artifact import Skipped
from canid.study.chen_ulsoy.settings import ChenUlsoySettings
from canid.types import Array, Trace

# a driver of fewer segments is reported and left out: 4 variances between minutes need as many again
MIN_SEGMENTS = 6
# samples of a segment below which ARMAX(2,2,1) with its offset, 6 parameters, is not fitted
MIN_SAMPLES = 100
# share of the samples of a grid of step dt that may lie off it before a segment counts as one with a gap
_GRID_TOLERANCE = 0.25
# of the offset's or angle's largest value; below it only the rounding of the sum of numbers moves
_STILL = 1e-9

GAP = "a gap: samples are missing or were not usable"
STILL = "the offset or the steering angle does not move"


class Segments(NamedTuple):
    """Complete segments of one driver, one row each, in time."""

    # (S, N) m, the paper's lateral error without the driver's mean: positive to the right, canid's offset to the left
    error: Array
    angle: Array  # (S, N) degrees, steering wheel angle
    number: npt.NDArray[
        np.int64
    ]  # (S,) from 0 over all logs; rejected segments keep theirs, so that it is time
    log: npt.NDArray[np.int64]  # (S,) which log
    dt: float  # s
    mean_error: float  # m, removed

    def take(self, index: npt.NDArray[np.bool_]) -> Segments:
        """Rows of some segments."""
        return self._replace(
            error=self.error[index], angle=self.angle[index], number=self.number[index], log=self.log[index]
        )


class Found(NamedTuple):
    """Segments of a driver's logs."""

    segments: Segments
    skipped: tuple[Skipped, ...]
    counted: int  # segments that the logs hold, without the first of each
    finer: (
        Segments | None
    )  # the same resampled without an anti-aliasing filter; None: the logs have no finer grid


def segments_of(logs: Sequence[tuple[str, Trace]], settings: ChenUlsoySettings) -> Found:
    """Cut a driver's logs into segments.

    Args:
        logs: name and trace of lane keeping each: output steering angle, one input.
        settings: length and step.

    Returns:
        Complete segments, and what is left out by reason. Weak data raise nothing.

    Example:
        >>> trace = planar_trace(np.arange(0.0, 200.0, 0.1))
        >>> found = segments_of([("a.blf", trace)], ChenUlsoySettings())
        >>> found.segments.error.shape, found.segments.number.tolist(), found.counted
        ((2, 600), [0, 1], 2)
    """
    size = round(settings.segment / settings.dt)
    rows: list[tuple[Array, Array, int, int]] = []
    plain: list[tuple[Array, Array, int, int]] = []
    skipped: list[Skipped] = []
    begin = counted = 0
    for index, (name, trace) in enumerate(logs):
        why = _unusable(trace, settings, size)
        if why:
            skipped.append(Skipped(name, "the whole log", why))
            continue
        step = max(round(settings.dt / trace.dt), 1)
        last = int(np.floor((trace.t[-1] + trace.dt) / settings.segment + 1e-6))
        reasons: dict[str, list[int]] = {}
        for k in range(1, last):
            counted += 1
            cut = _cut(trace, k * settings.segment, settings.segment)
            if cut is None:
                reasons.setdefault(GAP, []).append(k)
                continue
            y, angle = cut
            if _still(y) or _still(angle):
                reasons.setdefault(STILL, []).append(k)
                continue
            rows.append((_resampled(y, step), _resampled(angle, step), begin + k - 1, index))
            if step > 1:
                plain.append((y[::step], angle[::step], begin + k - 1, index))
        begin += max(last - 1, 0)
        skipped += [
            Skipped(name, f"{_listed(ks)} of {settings.segment:g} s", why) for why, ks in reasons.items()
        ]
    return Found(
        _stacked(rows, size, settings.dt),
        tuple(skipped),
        counted,
        _stacked(plain, size, settings.dt) if plain else None,
    )


def planar_trace(t: Array, seed: int = 0) -> Trace:
    """A trace of independent noise, for examples and tests."""
    from canid.types import LearnGate

    rng = np.random.default_rng(seed)
    y, angle = rng.normal(size=(2, len(t)))
    return Trace(
        dt=float(t[1] - t[0]),
        t=t,
        output=angle,
        inputs=y[:, None],
        input_names=("lateral_offset",),
        gate=(LearnGate.OPEN,) * len(t),
        learn=np.full(len(t), True),
        segment=np.zeros(len(t), np.int64),
        signals={"lateral_offset": y, "steering_angle": angle},
    )


def _unusable(trace: Trace, settings: ChenUlsoySettings, size: int) -> str:
    """Why a whole log is not used; empty: it is."""
    if trace.input_names != ("lateral_offset",):
        return "no lane keeping: the vehicle file has to name lateral_offset and steering_angle, as generic_lane does"
    if not len(trace.t) or not np.isfinite(trace.inputs).any():
        return "no lateral offset in it: record a lane camera's signal"
    if not np.isfinite(trace.output).any():
        return "no steering angle in it"
    ratio = settings.dt / trace.dt
    if abs(ratio - round(ratio)) > 0.01 or round(ratio) < 1:
        return f"samples {trace.dt:g} s apart cannot be resampled to {settings.dt:g} s"
    if size < MIN_SAMPLES:
        return f"segments of {settings.segment:g} s hold {size} samples, and a fit takes {MIN_SAMPLES}"
    if trace.t[-1] < 2.0 * settings.segment - settings.dt:
        return f"{trace.t[-1]:.0f} s long: the first segment is left out, so record {3 * settings.segment:g} s and more"
    return ""


def _cut(trace: Trace, start: float, length: float) -> tuple[Array, Array] | None:
    """Offset and angle of one segment on the trace's own grid; None where it has a gap."""
    n = round(length / trace.dt)
    first = int(np.searchsorted(trace.t, start - 1e-6 * trace.dt))
    at = slice(first, first + n)
    t = trace.t[at]
    if len(t) < n or abs((t[-1] - t[0]) - (n - 1) * trace.dt) > _GRID_TOLERANCE * trace.dt:
        return None
    y, angle = trace.inputs[at, 0], trace.output[at]
    whole = np.isfinite(y).all() and np.isfinite(angle).all() and trace.learn[at].all()
    if not whole or t[0] - start > trace.dt:
        return None
    return (y, angle) if (np.diff(trace.segment[at]) == 0).all() else None


def _still(x: Array) -> bool:
    return bool(np.ptp(x) <= _STILL * max(float(np.abs(x).max()), 1.0))


def _resampled(x: Array, step: int) -> Array:
    """Every step-th sample behind a linear-phase low-pass at 0.8 of the new Nyquist frequency."""
    if step == 1:
        return x
    # 20 taps per new sample: 60 dB down at the new Nyquist frequency; ends repeat, as they do in no other way worse
    taps = firwin(20 * step + 1, 0.8 / step)
    half = len(taps) // 2
    padded = np.concatenate([2 * x[0] - x[half:0:-1], x, 2 * x[-1] - x[-2 : -half - 2 : -1]])
    out: Array = np.convolve(padded, taps, "valid")[::step]
    return out


def _stacked(rows: Sequence[tuple[Array, Array, int, int]], size: int, dt: float) -> Segments:
    if not rows:
        none = np.zeros((0, size))
        return Segments(none, none, np.zeros(0, np.int64), np.zeros(0, np.int64), dt, 0.0)
    error = -np.array([row[0] for row in rows])
    mean = float(error.mean())
    return Segments(
        error - mean,
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
        dt,
        mean,
    )


def _listed(numbers: Sequence[int]) -> str:
    """Numbers of segments in a few words.

    >>> _listed([3]), _listed([3, 4, 9])
    ('segment 3', '3 segments (3, 4, 9)')
    """
    if len(numbers) == 1:
        return f"segment {numbers[0]}"
    # more than eight fill the line
    shown = ", ".join(str(k) for k in numbers[:8]) + (", ..." if len(numbers) > 8 else "")
    return f"{len(numbers)} segments ({shown})"
