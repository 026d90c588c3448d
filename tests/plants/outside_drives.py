"""Drives of two outside simulators with known truth, as tables: a driver at a pedal, and one who asks for an acceleration.

Neither imports anything of canid's simulation: what is estimated must never meet its own formulas. Both integrate in
steps of 0.01 s, with the driver's lag, dead time and noise inside the loop; the sensors sample and add their noise.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.table import open_table, trace_of
from canid.models.pipeline import pipeline
from canid.values.types import Driver, OutputFilter, Trace
from tests.plants.planted_drive import Array

# s; a tenth of the shortest lag that is drawn, so that the integration's error is below every interval
STEP = 0.01
# headings as loggers write them, by role
HEADINGS = {
    "speed": "speed [m/s]",
    "gap": "gap [m]",
    "range_rate": "range rate [m/s]",
    "pedal": "pedal [%]",
    "accel": "acceleration [m/s2]",
    "brake": "brake",
    "steering_angle": "steering angle [deg]",
    "lateral_offset": "lateral offset [m]",
}


class Truth(NamedTuple):
    """The driver: output = level + K e^(-theta s)/(1 + tau s) of each input + noise."""

    k_range_rate: float  # % per m/s of a pedal; 1/s of an acceleration
    k_headway: float  # % per s of a pedal; m/s² per s of an acceleration; headway = gap over own speed
    tau: float  # s, of both inputs
    theta: float  # s, dead time of both inputs
    output: Literal["pedal", "accel"]

    def of(self, channel: str, parameter: str) -> float:
        """The true value of what canid calls `parameter` of `channel`."""
        gain = {"range_rate": self.k_range_rate, "headway_error": self.k_headway}[channel]
        values = {
            "K": gain,
            "tau": self.tau,
            "dead_time": self.theta,
            "tau_plus_dead_time": self.tau + self.theta,
        }
        return values[parameter]


class Drive(NamedTuple):
    """What the sensors of a drive recorded, and the truth."""

    t: Array  # (n,) s
    columns: Mapping[str, Array]  # role -> (n,) in SI, % and 0/1; the output is columns[truth.output]
    truth: Truth


HELLY = Truth(6.0, 5.0, 0.4, 0.5, "pedal")
ACCELERATING = Truth(0.30, 0.25, 0.35, 0.45, "accel")


def drawn_truth(rng: np.random.Generator, about: Truth) -> Truth:
    """Draw a driver about another one: gains within a quarter, lag and dead time within 0.3 to 0.7 s."""
    scale = rng.uniform(0.75, 1.25, 2)
    return Truth(
        about.k_range_rate * scale[0],
        about.k_headway * scale[1],
        rng.uniform(0.3, 0.7),
        # whole steps: the delay line holds the inputs at steps
        STEP * round(rng.uniform(0.3, 0.7) / STEP),
        about.output,
    )


class _Response:
    """K e^(-theta s)/(1 + tau s) of one input, trapezoidal: its error is of second order in STEP."""

    def __init__(self, truth: Truth) -> None:
        self.decay = math.exp(-STEP / truth.tau)
        delay = round(truth.theta / STEP)
        self.waiting = deque([0.0] * (delay + 2), maxlen=delay + 2)
        self.value = 0.0

    def step(self, x: float) -> float:
        self.waiting.append(x)
        # the delayed input halfway through the step
        middle = 0.5 * (self.waiting[0] + self.waiting[1])
        self.value = self.decay * self.value + (1.0 - self.decay) * middle
        return self.value


def _coloured(rng: np.random.Generator, n: int, sd: float, correlation: float) -> Array:
    """(n,) first-order autoregression of so many s at STEP."""
    decay = math.exp(-STEP / correlation) if correlation > 0.0 else 0.0
    shocks = sd * math.sqrt(1.0 - decay * decay) * rng.standard_normal(n)
    out, value = np.empty(n), sd * rng.standard_normal()
    for k, shock in enumerate(shocks.tolist()):
        value = decay * value + shock
        out[k] = value
    return out


def smooth_lead(rng: np.random.Generator, n: int, mean: float, sd: float) -> Array:
    """(n,) m/s: a random speed whose acceleration is continuous, correlated over some 8 s.

    Two lags of 1.5 and 0.5 s behind an autoregression: traffic that flows.
    """
    drive = _coloured(rng, n, 1.0, 8.0)
    out = drive
    for tau in (1.5, 0.5):
        lagged, value = np.empty(n), out[0]
        for k, x in enumerate(out.tolist()):
            value += STEP / tau * (x - value)
            lagged[k] = value
        out = lagged
    speed: Array = mean + sd * (out - out.mean()) / out.std()
    return speed


def piecewise_lead(rng: np.random.Generator, n: int, mean: float, sd: float) -> Array:
    """(n,) m/s: constant speeds of 5 to 20 s, joined at 0.3 to 1.2 m/s², over 1 s: cars jerk by 1 m/s³, not at once."""
    out, speed, corner = [], mean, round(1.0 / STEP)
    while len(out) < n + corner:
        target = float(np.clip(rng.normal(mean, sd), mean - 2 * sd, mean + 2 * sd))
        rate = rng.uniform(0.3, 1.2)
        steps = max(round(abs(target - speed) / rate / STEP), 1)
        out += np.linspace(speed, target, steps + 1)[1:].tolist()
        out += [target] * round(rng.uniform(5.0, 20.0) / STEP)
        speed = target
    rounded: Array = np.convolve(out, np.full(corner, 1.0 / corner), "valid")[:n]
    return rounded


def helly_drive(
    rng: np.random.Generator,
    *,
    seconds: float = 600.0,
    dt: float = 0.1,
    truth: Truth = HELLY,
    level: float = 35.0,
    limits: tuple[float, float] = (0.0, 100.0),
    engine_lag: float = 0.3,
    speed: float = 25.0,
    lead_sd: float = 1.5,
    driver_noise: tuple[float, float] = (1.0, 1.0),
    noise: float = 1.0,
) -> Drive:
    """Drive a car with drag and an engine lag by a linear driver (Helly 1961) at its pedal.

    Args:
        rng: source of random numbers: the drive is a function of it.
        seconds: of the drive.
        dt: s between samples.
        truth: the driver.
        level: %, pedal that holds the mean speed; near a limit, the limit is met.
        limits: %, of the pedal. Below the lower one the driver brakes; what passes the upper one does nothing.
        engine_lag: s; 0: the car answers at once.
        speed: m/s, mean of the lead's.
        lead_sd: m/s, of the lead's.
        driver_noise: standard deviation (%) and correlation time (s) of the driver's own noise; 0 s: white.
        noise: of the sensors, as a factor of 0.1 m, 0.05 m/s, 0.02 m/s and 0.05 m/s²; 0: none, and no rounding.

    Example:
        >>> drive = helly_drive(np.random.default_rng(1), seconds=60)
        >>> len(drive.t), sorted(drive.columns)
        (601, ['accel', 'brake', 'gap', 'pedal', 'range_rate', 'speed'])
    """
    n = round(seconds / STEP) + 1
    lead = smooth_lead(rng, n, speed, lead_sd)
    own_noise = _coloured(rng, n, *driver_noise)
    power = 0.04  # m/s² per %; drag is such that `level` holds the mean speed
    rolling, drag = 0.2, (power * level - 0.2) / speed**2
    wanted = 2.0  # s
    v, gap = float(lead[0]), wanted * float(lead[0])
    force = power * level
    of_headway, of_rate = _Response(truth), _Response(truth)
    rows = np.empty((n, 6))
    low, high = limits
    for k, (lead_speed, e) in enumerate(zip(lead.tolist(), own_noise.tolist(), strict=True)):
        rate = lead_speed - v
        demand = (
            level
            + truth.k_headway * of_headway.step(gap / v - wanted)
            + truth.k_range_rate * of_rate.step(rate)
            + e
        )
        pedal = min(max(demand, low), high)
        # a brake is three times as strong as an engine at the same demand
        asked = power * (pedal + 3.0 * min(demand - low, 0.0))
        force = asked if engine_lag <= 0.0 else force + STEP / engine_lag * (asked - force)
        accel = force - rolling - drag * v * v
        rows[k] = v, gap, rate, pedal, accel, float(demand < low - 2.0)
        gap += STEP * (rate - 0.5 * STEP * accel)
        v = max(v + STEP * accel, 0.5)
    return _sampled(rng, rows, dt, noise, truth)


def accel_drive(
    rng: np.random.Generator,
    *,
    seconds: float = 600.0,
    dt: float = 0.1,
    truth: Truth = ACCELERATING,
    speed: float = 20.0,
    lead_sd: float = 3.0,
    driver_noise: tuple[float, float] = (0.05, 0.7),
    limits: tuple[float, float] = (-math.inf, math.inf),
    noise: float = 1.0,
) -> Drive:
    """Follow a piecewise lead by a driver whose output is the acceleration.

    The answer to the headway saturates: E tanh(e/E) with E = 4 s, 1 % off linear over the usual 0.4 s.

    Args:
        rng: source of random numbers: the drive is a function of it.
        seconds: of the drive.
        dt: s between samples.
        truth: the driver.
        speed: m/s, mean of the lead's.
        lead_sd: m/s, of the lead's.
        driver_noise: standard deviation (m/s²) and correlation time (s) of the driver's own noise; 0 s: white.
        limits: m/s², of the acceleration.
        noise: of the sensors, as in `helly_drive`.

    Example:
        >>> drive = accel_drive(np.random.default_rng(1), seconds=60)
        >>> len(drive.t), sorted(drive.columns)
        (601, ['accel', 'gap', 'range_rate', 'speed'])
    """
    n = round(seconds / STEP) + 1
    lead = piecewise_lead(rng, n, speed, lead_sd)
    own_noise = _coloured(rng, n, *driver_noise)
    wanted, bend = 1.5, 4.0  # s
    v, gap = float(lead[0]), wanted * float(lead[0])
    of_headway, of_rate = _Response(truth), _Response(truth)
    rows = np.empty((n, 6))
    for k, (lead_speed, e) in enumerate(zip(lead.tolist(), own_noise.tolist(), strict=True)):
        rate = lead_speed - v
        answered = of_headway.step(bend * math.tanh((gap / v - wanted) / bend))
        demand = truth.k_headway * answered + truth.k_range_rate * of_rate.step(rate) + e
        accel = min(max(demand, limits[0]), limits[1])
        rows[k] = v, gap, rate, np.nan, accel, np.nan
        gap += STEP * (rate - 0.5 * STEP * accel)
        v = max(v + STEP * accel, 0.5)
    return _sampled(rng, rows, dt, noise, truth)


SIMULATORS: Mapping[str, tuple[Callable[..., Drive], Truth]] = {
    "Helly": (helly_drive, HELLY),
    "acceleration": (accel_drive, ACCELERATING),
}


def drawn_drive(simulator: str, seed: int, **how: Any) -> Drive:
    """A drive of a drawn driver.

    Args:
        simulator: a name of `SIMULATORS`.
        seed: of driver, lead, noise and sensors.
        **how: settings of the simulator.
    """
    drive, about = SIMULATORS[simulator]
    rng = np.random.default_rng([seed, 46])
    return drive(rng, truth=drawn_truth(rng, about), **how)


def _sampled(rng: np.random.Generator, rows: Array, dt: float, noise: float, truth: Truth) -> Drive:
    """What the sensors make of the motion."""
    every = round(dt / STEP)
    if abs(every * STEP - dt) > 1e-9:
        raise ValueError(f"dt {dt} s is no multiple of {STEP} s")
    speed, gap, rate, pedal, accel, brake = rows[::every].T.copy()
    sd = {"speed": 0.02, "gap": 0.1, "range_rate": 0.05, "accel": 0.05 if truth.output == "pedal" else 0.0}
    columns = {"speed": speed, "gap": gap, "range_rate": rate, "accel": accel}
    columns = {role: x + noise * sd[role] * rng.standard_normal(len(x)) for role, x in columns.items()}
    if truth.output == "pedal":
        columns |= {"pedal": pedal, "brake": brake}
    return Drive(dt * np.arange(len(speed)), columns, truth)


def write_table(drive: Drive, path: str | Path, without: tuple[str, ...] = ()) -> Path:
    """Write a CSV table with headings and units as people write them.

    Args:
        drive: with its columns; NaN is written as an empty cell.
        path: of the table.
        without: roles that are left out.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table = write_table(accel_drive(np.random.default_rng(1), seconds=10), f"{folder}/drive.csv")
        ...     print(table.read_text().splitlines()[0])
        time [s],speed [m/s],gap [m],range rate [m/s],acceleration [m/s2]
    """
    roles = [role for role in drive.columns if role not in without]
    lines = [",".join(["time [s]", *(HEADINGS[role] for role in roles)])]
    cells = zip(drive.t.tolist(), *(drive.columns[role].tolist() for role in roles), strict=True)
    for t, *values in cells:
        lines.append(",".join([f"{t:.4f}", *("" if math.isnan(x) else f"{x:.4f}" for x in values)]))
    path = Path(path)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read_table(path: str | Path, output: str) -> Trace:
    """Read a table as a user does who knows that what it records of the output was not smoothed.

    Args:
        path: of the table.
        output: role of the driver's output.

    Returns:
        what `canid.identify` and `canid.diagnose` take.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table = write_table(accel_drive(np.random.default_rng(1), seconds=10), f"{folder}/drive.csv")
        ...     print(read_table(table, "accel").output_filter.kind)
        none
    """
    task = "lane_keeping" if output == "steering_angle" else "car_following"
    unsmoothed = Driver(task=task, output=output, output_filter=OutputFilter("none"))
    return trace_of(open_table(path, ColumnMap(driver=unsmoothed)), pipeline.DT)
