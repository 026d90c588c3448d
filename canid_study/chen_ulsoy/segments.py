"""Segments of a driver's logs (Chen & Ulsoy 2001, sec. 2.1): gaps and standing signals are rejected, and a warm-up.

Segments are counted from the start of each log, so that segment k holds the seconds from 60 k to 60 (k + 1); without a
warm-up from its first usable sample on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import firwin

from canid.values.types import Array, LearnGate, Trace
from canid_study.artifact import Skipped
from canid_study.chen_ulsoy.settings import ChenUlsoySettings

# a driver of fewer segments is reported and left out: 4 variances between minutes need as many again
MIN_SEGMENTS = 6
# samples of a segment below which ARMAX(2,2,1) with its offset, 6 parameters, is not fitted
MIN_SAMPLES = 100
# share of the samples of a grid of step dt that may lie off it before a segment counts as one with a gap
_GRID_TOLERANCE = 0.25
# of the offset's or angle's largest value; below it only the rounding of the sum of numbers moves
_STILL = 1e-9

GAP = "a gap: samples are missing or were not usable"
ASSISTED = "an assistant steers in it"
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

    def take(self, index: npt.NDArray[np.bool_]) -> Segments:
        """Rows of some segments."""
        return self._replace(
            error=self.error[index], angle=self.angle[index], number=self.number[index], log=self.log[index]
        )


class Found(NamedTuple):
    """Segments of a driver's logs."""

    segments: Segments
    skipped: tuple[Skipped, ...]
    counted: int  # segments that the logs hold, without those of the warm-up
    finer: (
        Segments | None
    )  # the same resampled without an anti-aliasing filter; None: the logs have no finer grid


def segments_of(logs: Sequence[tuple[str, Trace]], settings: ChenUlsoySettings) -> Found:
    """Cut a driver's logs into segments.

    Args:
        logs: name and trace of lane keeping each: output steering angle, one input.
        settings: length, step, and how many are left out at the beginning of each log.

    Returns:
        Complete segments, and what is left out by reason. Weak data raise nothing.

    Example:
        >>> trace = planar_trace(np.arange(0.0, 200.0, 0.1))
        >>> selected = segments_of([("a.blf", trace)], ChenUlsoySettings())
        >>> selected.segments.error.shape, selected.segments.number.tolist(), selected.counted
        ((2, 600), [0, 1], 2)
        >>> segments_of([("a.blf", trace)], ChenUlsoySettings(warm_up=0)).counted
        3
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
        start = 0.0 if settings.warm_up else _first_usable(trace)
        last = int(np.floor((trace.t[-1] + trace.dt - start) / settings.segment + 1e-6))
        reasons: dict[str, list[int]] = {}
        for k in range(settings.warm_up, last):
            counted += 1
            cut = _cut(trace, start + k * settings.segment, settings.segment)
            if cut is None:
                why = ASSISTED if _assisted(trace, start + k * settings.segment, settings.segment) else GAP
                reasons.setdefault(why, []).append(k)
                continue
            y, angle = cut
            if _still(y) or _still(angle):
                reasons.setdefault(STILL, []).append(k)
                continue
            number = begin + k - settings.warm_up
            rows.append((_resampled(y, step), _resampled(angle, step), number, index))
            if step > 1:
                plain.append((y[::step], angle[::step], number, index))
        begin += max(last - settings.warm_up, 0)
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
    # the last sample of a log of 60 s is at 59.9 s
    if trace.t[-1] + trace.dt < (1 + settings.warm_up) * settings.segment - 0.5 * trace.dt:
        left_out = "the first segment is left out, so " if settings.warm_up else ""
        return f"{trace.t[-1]:.0f} s long: {left_out}record {(2 + settings.warm_up) * settings.segment:g} s and more"
    return ""


# s; lengths of segments that are tried on short logs, the paper's first; the last holds MIN_SAMPLES of its grid
LENGTHS = (60.0, 30.0, 20.0, 15.0, 10.0)


def fitting_length(drivers: Mapping[str, Sequence[tuple[str, Trace]]], settings: ChenUlsoySettings) -> float:
    """The longest segments by which as many drivers as by the shortest have enough of them, in s.

    Example:
        >>> minute = planar_trace(np.arange(0.0, 60.0, 0.1))
        >>> fitting_length({"S1": [("a.blf", minute)]}, ChenUlsoySettings(warm_up=0))
        10.0
        >>> ten = planar_trace(np.arange(0.0, 600.0, 0.1))
        >>> fitting_length({"S1": [("a.blf", ten)]}, ChenUlsoySettings(warm_up=0))
        60.0
    """

    def enough(length: float) -> int:
        of_length = settings._replace(segment=length)
        return sum(
            len(segments_of(logs, of_length).segments.number) >= MIN_SEGMENTS for logs in drivers.values()
        )

    most = enough(LENGTHS[-1])
    return next(length for length in LENGTHS if enough(length) >= most)


def _first_usable(trace: Trace) -> float:
    """Time of the first sample with both signals, in s; 0 where there is none."""
    usable = np.isfinite(trace.inputs[:, 0]) & np.isfinite(trace.output) & trace.learn
    return float(trace.t[int(np.argmax(usable))]) if usable.any() else 0.0


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


def _assisted(trace: Trace, start: float, length: float) -> bool:
    """Whether an assistant, or as `cruise_active` has it a controller, has the wheel at any time of a segment."""
    first, last = np.searchsorted(trace.t, (start, start + length))
    return any(gate in (LearnGate.ASSIST, LearnGate.CRUISE) for gate in trace.gate[first:last])


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
        return Segments(none, none, np.zeros(0, np.int64), np.zeros(0, np.int64), dt)
    error = -np.array([row[0] for row in rows])
    return Segments(
        error - float(error.mean()),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
        dt,
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
