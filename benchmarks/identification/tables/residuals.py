"""Residual tests of FOPDT on drivers who are just that: how often they alarm, and what an alarm is worth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.identification import acceleration, bus, canid_side, loop_a, loop_b
from benchmarks.identification.loops import Lead
from benchmarks.identification.noise_models import NOISE_MODELS
from benchmarks.identification.table import Settings, Table, each
from canid.mathematics.estimators.plausibility import MAX_LEFT_OVER
from canid.values.types import Driver, OutputFilter

SECONDS = 420.0
SHORT = 60.0  # s, of a window
# Savitzky-Golay over so many samples
TAPS = 11


class Judged(NamedTuple):
    """One fit with its tests."""

    kind: str  # whole, or window
    alarm: bool  # a left-over response at 99 %
    share: float  # of the model's own response, where it alarms
    K: bool  # the interval of K2 holds the truth
    total: bool  # that of tau2 + dead time 2
    better: bool  # than the mean


def table(settings: Settings) -> list[Table]:
    """Print alarms, their sizes, and coverage with and without a large one."""
    rows: list[tuple[object, ...]] = []
    fits, worse = 0, 0
    for name, world in WORLDS:
        done = [one for run in each(settings, world) for one in run]
        fits, worse = fits + len(done), worse + sum(not one.better for one in done)
        some, windows = ([one for one in done if one.kind == kind] for kind in ("whole", "window"))
        large = [one for one in some if one.share > MAX_LEFT_OVER]
        small = [one for one in some if one.share <= MAX_LEFT_OVER]
        rows.append(
            (
                name,
                float(np.mean([one.alarm for one in windows])),
                float(np.mean([one.alarm for one in some])),
                max(one.share for one in some),
                len(large),
                *(_held(part, what) for part in (small, large) for what in ("K", "total")),
            )
        )
    return [
        Table(
            f"Residual tests on clean drives, {SECONDS / 60.0:.0f} min, and on windows of {SHORT:.0f} s",
            (
                "drives",
                "alarm at 99 %, windows",
                "whole drives",
                "largest share",
                f"share > {MAX_LEFT_OVER}",
                "K2 held below",
                "τ2+θ2 held below",
                "K2 held above",
                "τ2+θ2 held above",
            ),
            rows,
            (
                "Alarm: either input's response is left over. Share: of the model's own response, in whitened rms. "
                "Sensor of the speed: its error is in the acceleration and in both inputs. "
                f"{settings.runs} fits a row; of all {fits} fits {worse} explain no more than the mean.",
            ),
        )
    ]


def _held(part: list[Judged], what: str) -> float:
    return float(np.mean([getattr(one, what) for one in part])) if part else float("nan")


def _judge(
    output: np.ndarray,
    inputs: np.ndarray,
    usable: np.ndarray,
    segment: np.ndarray,
    truth: tuple[float, float],
    output_filter: OutputFilter | None = None,
) -> list[Judged]:
    """Fit the whole drive and a window in its middle."""
    n, half = len(output), round(0.5 * SHORT / bus.GRID)
    middle = slice(max(n // 2 - half - round(4.5 / bus.GRID), 0), n // 2 + half)
    out = []
    for kind, rows in (("whole", slice(0, n)), ("window", middle)):
        columns = (output[rows], inputs[rows], usable[rows], segment[rows])
        fit, tests = canid_side.tested(*columns, bus.GRID, output_filter)
        if tests is None:
            continue
        channel = fit.channels[1]
        held = [
            iv.low <= x <= iv.high
            for iv, x in zip((channel.K, channel.tau_plus_dead_time), truth, strict=True)
        ]
        share = max((tests.left_over_share[name] for name in tests.left_over), default=0.0)
        out.append(Judged(kind, bool(tests.left_over), share, *held, fit.fit_percent > 0.0))
    return out


def _a(seed: int) -> list[Judged]:
    of = loop_a.drive(seed, SECONDS, noise_model=NOISE_MODELS[seed % len(NOISE_MODELS)])
    return _pedal(of, seed)


def _b(seed: int) -> list[Judged]:
    return _pedal(loop_b.drive(seed, SECONDS, lead=Lead("normal", 1.8, 0.05), shift=1.0), seed)


def _pedal(of: loop_a.Drive, seed: int) -> list[Judged]:
    seen = bus.through_canid(bus.sensed(of, seed), Driver(headway_desired=of.headway_desired))
    two = of.channels[1]
    return _judge(seen.output, seen.inputs, seen.usable, seen.segment, (two.K, two.tau + two.dead_time))


def _acceleration(seed: int, speed_noise: float, smoothed: bool, shared: bool) -> list[Judged]:
    of = acceleration.drive(seed, SECONDS / 60.0, NOISE_MODELS[seed % len(NOISE_MODELS)])
    n = len(of.speed)
    error = speed_noise * np.random.default_rng((seed, 3)).standard_normal(n)
    speed, inputs = of.speed + error, of.inputs.copy()
    if shared:
        inputs -= error[:, None] * np.column_stack([acceleration.HEADWAY / of.speed, np.ones(n)])
    if smoothed:
        output = savgol_filter(speed, TAPS, 2, deriv=1, delta=acceleration.DT)
        of_output = OutputFilter("savitzky_golay", TAPS * acceleration.DT)
    else:
        output, of_output = np.gradient(speed, acceleration.DT), None
    two = of.channels[1]
    everywhere, one_segment = np.full(n, True), np.zeros(n, dtype=np.int64)
    return _judge(output, inputs, everywhere, one_segment, (two.K, two.tau + two.dead_time), of_output)


def _independent(seed: int) -> list[Judged]:
    return _acceleration(seed, 0.02, False, False)


def _smoothed(seed: int) -> list[Judged]:
    return _acceleration(seed, 0.02, True, False)


def _good_sensor(seed: int) -> list[Judged]:
    return _acceleration(seed, 0.01, True, True)


def _fair_sensor(seed: int) -> list[Judged]:
    return _acceleration(seed, 0.04, True, True)


def _poor_sensor(seed: int) -> list[Judged]:
    return _acceleration(seed, 0.12, True, True)


WORLDS = (
    ("loop A, pedal", _a),
    ("loop B, pedal, floor and brake", _b),
    ("accelerations", _independent),
    ("accelerations, Savitzky-Golay 1.1 s", _smoothed),
    ("the same, sensor of the speed ±0.01 m/s", _good_sensor),
    ("the same, ±0.04 m/s", _fair_sensor),
    ("the same, ±0.12 m/s", _poor_sensor),
)
