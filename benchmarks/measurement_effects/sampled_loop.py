"""A following loop integrated at 100 Hz, and its signals as instruments of their own rate, step and lag record them.

None of it is canid's: a driver of one lag and one dead time, a car with an engine lag, behind a lead of random speed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# s; a twentieth of the shortest lag
STEP_S = 0.01
# of a pedal, m/s² per %, and of the air and the road, 1/s: a car of the middle class
PEDAL_GAIN, DRAG = 0.08, 0.02
ENGINE_LAG_S = 0.3
START_SPEED, START_PEDAL, WANTED_HEADWAY_S = 25.0, 20.0, 1.6


class Truth(NamedTuple):
    """The driver: pedal = e^(-theta s) / (1 + tau s) (K (headway - wanted) + K range rate)."""

    headway_error: float = 5.0  # % per s
    range_rate: float = 6.0  # % per m/s
    tau: float = 0.4  # s
    theta: float = 0.5  # s


class Instrument(NamedTuple):
    """How one signal is recorded."""

    hz: float = 10.0  # at which it is measured
    kind: Literal["points", "hold", "line"] = (
        "points"  # between them: nothing, the last value, a line, at 10 Hz
    )
    step: float = 0.0  # resolution in its unit; 0: exact to 4 decimals
    lag: float = 0.0  # s, of first order, before it is measured
    delay: float = 0.0  # s
    drift: float = 0.0  # of its clock, s per s
    start: float = 0.0  # s, of the first reading
    noise: float = 0.0  # standard deviation in its unit


ROLES = ("pedal", "speed", "gap", "range_rate")


def drive(rng: np.random.Generator, seconds: float, truth: Truth) -> dict[str, Array]:
    """Integrate a drive; role -> (n,) every `STEP_S`."""
    n, h = round(seconds / STEP_S), STEP_S
    lead = _lead_speed(rng, n)
    noise = _first_order(rng.standard_normal(n), 0.6, 1.5) + _first_order(rng.standard_normal(n), 0.05, 0.3)
    late = round(truth.theta / h)
    wanted = np.zeros(n)
    out = {role: np.zeros(n) for role in ROLES}
    speed, gap, answer, accel = START_SPEED, WANTED_HEADWAY_S * START_SPEED, 0.0, 0.0
    for k, (ahead, extra) in enumerate(zip(lead.tolist(), noise.tolist(), strict=True)):
        rate = ahead - speed
        wanted[k] = truth.headway_error * (gap / speed - WANTED_HEADWAY_S) + truth.range_rate * rate
        answer += (wanted[max(k - late, 0)] - answer) * h / truth.tau
        pedal = START_PEDAL + answer + extra
        for role, value in zip(ROLES, (pedal, speed, gap, rate), strict=True):
            out[role][k] = value
        demand = PEDAL_GAIN * (pedal - START_PEDAL) - DRAG * (speed - START_SPEED)
        accel += (demand - accel) * h / ENGINE_LAG_S
        speed = max(speed + accel * h, 2.0)
        gap = max(gap + rate * h, 2.0)
    return out


def _first_order(white: Array, lag: float, sd: float) -> Array:
    """Noise of first order, of a correlation time in s and a standard deviation."""
    keep, out, y = math.exp(-STEP_S / lag), np.empty(len(white)), 0.0
    for k, x in enumerate((sd * math.sqrt(1.0 - keep * keep) * white).tolist()):
        y = keep * y + x
        out[k] = y
    return out


def _lead_speed(rng: np.random.Generator, n: int) -> Array:
    """A random speed that changes over 3 and 20 s."""
    white = rng.standard_normal((2, n))
    fast, slow = (
        _first_order(_first_order(x, first, 1.0), second, 1.0)
        for x, first, second in ((white[0], 1.5, 1.5), (white[1], 10.0, 8.0))
    )
    out: Array = START_SPEED + 0.7 * fast / fast.std() + 1.5 * np.clip(slow / slow.std(), -3.0, 3.0)
    return out


def recorded(
    fine: Mapping[str, Array], instruments: Mapping[str, Instrument], rng: np.random.Generator
) -> dict[str, tuple[Array, Array]]:
    """Record a drive: role -> times (m,) s and values (m,)."""
    return {role: _recorded(x, instruments.get(role, Instrument()), rng) for role, x in fine.items()}


def _recorded(x: Array, how: Instrument, rng: np.random.Generator) -> tuple[Array, Array]:
    t = STEP_S * np.arange(len(x))
    if how.lag:
        x = _lagged(x, how.lag)
    measured = np.arange(how.start, t[-1], 1.0 / how.hz)
    value = np.interp(measured - how.delay, t, x) + how.noise * rng.standard_normal(len(measured))
    if how.step:
        value = np.round(value / how.step) * how.step
    stamps = np.round(measured * (1.0 + how.drift), 4)
    if how.kind == "points":
        return stamps, np.round(value, 4)
    dense = np.round(np.arange(0.0, stamps[-1], 0.1), 4)
    if how.kind == "line":
        return dense, np.round(np.interp(dense, stamps, value), 4)
    return dense, np.round(value[np.searchsorted(stamps, dense + 1e-6) - 1], 4)


def _lagged(x: Array, lag: float) -> Array:
    out, y, share = np.empty(len(x)), float(x[0]), STEP_S / lag
    for k, value in enumerate(x.tolist()):
        y += (value - y) * share
        out[k] = y
    return out


def write(path: Path, signals: Mapping[str, tuple[Array, Array]]) -> None:
    """Write them as a table: a row per time, empty where a signal has no value then."""
    rows: dict[float, dict[str, float]] = {}
    for role, (t, value) in signals.items():
        for at, y in zip(t.tolist(), value.tolist(), strict=True):
            rows.setdefault(at, {})[role] = y
    lines = [",".join(("time", *signals))]
    for at in sorted(rows):
        row = rows[at]
        lines.append(
            ",".join((f"{at:.4f}", *(f"{row[role]:.6g}" if role in row else "" for role in signals)))
        )
    path.write_text("\n".join(lines) + "\n")
