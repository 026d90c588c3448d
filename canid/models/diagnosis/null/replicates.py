"""Drives of the fitted driver behind the recorded lead, in closed loop with his own noise, as the sensors would have them.

Gap and speed start from the measured ones and follow from the simulated output; where a mask lies, nobody is ahead or the
car stands, the recorded drive stays. Masks and gates are those of the drive, except those that the pedal itself opens and
closes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple
from zlib import crc32

import numpy as np

from canid.models.diagnosis.causal_smoothing import QUIETEST_GAP, QUIETEST_RATE, Motion, roughness
from canid.models.diagnosis.driver import closed_loop
from canid.models.diagnosis.driver.closed_loop import (
    ACCEL,
    MIN_GAP_M,
    ON_BRAKE_PERCENT,
    PEDAL,
    Ride,
    Road,
    Stretch,
)
from canid.models.diagnosis.driver.driver_data import PEDAL_FLOOR_PERCENT, DriverData, braking
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1
from canid.models.diagnosis.driver.driver_simulation import HISTORY_S
from canid.models.diagnosis.null import noise_source
from canid.models.diagnosis.null.noise_source import Source, sampler
from canid.models.diagnosis.prepared_drive import Prepared
from canid.models.diagnosis.remnant.innovations import innovations
from canid.models.diagnosis.vehicle.vehicle_block import Vehicle
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import Flags
from canid.values.output_role import output_role
from canid.values.runs import runs
from canid.values.types import LearnGate, Trace

# s; the loop forgets its start within a minute, and a gap that a weak driver lets go is not lost for the whole drive
MAX_STRETCH_S, MIN_STRETCH_S = 150.0, 20.0
# of the simulated samples; with more of them at the least gap the fitted driver does not follow this lead
MAX_CRASHED_SHARE = 0.01
# of the usable samples that must be simulated
MIN_SIMULATED_SHARE = 0.5
# m/s, below which a car stands or creeps
STANDSTILL_SPEED = 1.0
FROM_THE_PEDAL = (LearnGate.OPEN, LearnGate.PEDAL_FLOOR, LearnGate.BRAKE, LearnGate.OUTPUT_LIMIT)


class Drive(NamedTuple):
    """What is simulated again."""

    trace: Trace
    usable: Flags  # (n,) outside of every mask
    data: DriverData
    role: str  # of the output
    vehicle: Vehicle


class Replicate(NamedTuple):
    """A simulated drive."""

    trace: Trace
    usable: Flags  # (n,)
    motions: tuple[Motion, Motion]  # of the recorded drive: its lead, and a driver like its own


def simulated(
    drive: Drive, driver: FittedDriver, noise: Source, count: int, seed: list[int]
) -> Iterator[Replicate]:
    """Simulate the drive again, several times side by side; each is made when it is asked for.

    Args:
        drive: the recorded one.
        driver: who drives.
        noise: of the driver.
        count: of replicates.
        seed: of the draws.

    Yields:
        those in which the driver follows; none where the loop cannot be closed.
    """
    data, dt = drive.data, drive.trace.dt
    if drive.role not in (PEDAL, ACCEL) or (drive.role == PEDAL and drive.vehicle.cars is None):
        return
    where = _stretches(drive)
    seconds = sum(stretch.stop - stretch.start for stretch in where)
    if seconds < MIN_SIMULATED_SHARE * float(np.count_nonzero(data.output.usable)):
        return
    rng = np.random.default_rng(seed)
    # a gain of headway below 0, which is chance, lets every gap go
    q = driver.q.copy()
    q[K1] = max(q[K1], 0.0)
    driver = driver._replace(fitted=driver.fitted._replace(q=q))
    car, push = None, None
    if drive.role == PEDAL and drive.vehicle.cars is not None:
        brake = braking(drive.trace)
        car = closed_loop.car(drive.vehicle.cars[1], drive.vehicle, driver.fitted.model, brake, dt)
        n = data.seen.t.size
        every = max(drive.vehicle.left.size // max(n, 1), 1)
        push = np.where(brake | data.output.below, 0.0, np.nan_to_num(drive.vehicle.left[::every][:n]))
    road = Road(data, data.seen.speed + data.seen.range_rate, drive.trace.output, push)
    past = round(HISTORY_S / dt)
    columns = where * count
    rows = np.arange(-past, max(stretch.stop - stretch.start for stretch in where))[:, None] + np.array(
        [stretch.start for stretch in columns]
    )
    rows = np.clip(rows, 0, data.seen.t.size - 1)
    ride = Ride((driver,), (None,), (), car)
    done = closed_loop.driven(road, ride, columns, sampler(noise, rows, past, rng))
    for k in range(count):
        made = _replicate(drive, done, where, k * len(where), rng)
        if made is not None:
            yield made


def _stretches(drive: Drive) -> tuple[Stretch, ...]:
    """Where the loop is closed."""
    trace, dt = drive.trace, drive.trace.dt
    by_pedal = np.array([gate in FROM_THE_PEDAL for gate in trace.gate])
    known = np.isfinite(trace.signals["gap"]) & np.isfinite(trace.signals["range_rate"])
    known &= np.isfinite(trace.signals["speed"]) & np.isfinite(trace.output) & by_pedal & drive.usable
    size, least = round(MAX_STRETCH_S / dt), round(MIN_STRETCH_S / dt)
    out = []
    for segment in np.unique(trace.segment[known]):
        for first, stop in runs(known & (trace.segment == segment)):
            parts = -(-(stop - first) // size)
            edges = np.linspace(first, stop, parts + 1).astype(int)
            out += [Stretch(int(a), int(b), 0) for a, b in pairwise(edges) if b - a >= least]
    return tuple(out)


def _replicate(
    drive: Drive, done: closed_loop.Driven, where: tuple[Stretch, ...], first: int, rng: np.random.Generator
) -> Replicate | None:
    """One replicate from its columns; None: its driver does not follow."""
    trace, n = drive.trace, drive.trace.t.size
    usable = np.zeros(n, dtype=bool)
    y, gap = trace.output.copy(), trace.signals["gap"].copy()
    speed, rate = trace.signals["speed"].copy(), trace.signals["range_rate"].copy()
    segment = trace.segment.copy()
    history = round(HISTORY_S / trace.dt)
    pedal = drive.role == PEDAL
    brake = braking(trace)
    crashed = total = 0
    for m, stretch in enumerate(where, first):
        # the last row has no output
        here, length = slice(stretch.start, stretch.stop - 1), stretch.stop - 1 - stretch.start
        column = slice(done.past, done.past + length)
        y[here], gap[here] = done.output[column, m], done.late.gap[column, m]
        speed[here], rate[here] = done.late.speed[column, m], done.late.range_rate[column, m]
        crashed += int(np.count_nonzero((gap[here] <= MIN_GAP_M) | (speed[here] < STANDSTILL_SPEED)))
        total += length
        usable[stretch.start + history : stretch.stop - 1] = True
        segment[stretch.start :] += 1
        segment[stretch.stop - 1 :] += 1
        if pedal:
            brake[here] = y[here] < -ON_BRAKE_PERCENT
    if not np.isfinite(y[usable]).all() or crashed > MAX_CRASHED_SHARE * max(total, 1):
        return None
    gate = list(trace.gate)
    if pedal:
        for k in np.flatnonzero(usable):
            low = y[k] <= PEDAL_FLOOR_PERCENT
            gate[k] = LearnGate.BRAKE if brake[k] else LearnGate.PEDAL_FLOOR if low else LearnGate.OPEN
        y = np.maximum(y, 0.0)
    bound = np.full(n, np.nan)
    low, high = drive.data.output.floor, drive.data.output.ceiling
    for k in np.flatnonzero(usable & (y >= high)):
        gate[k], bound[k] = LearnGate.OUTPUT_LIMIT, math.nextafter(high, -math.inf)
    for k in np.flatnonzero(usable & (y <= low)) if not pedal else ():
        gate[k], bound[k] = LearnGate.OUTPUT_LIMIT, low
    signals = dict(trace.signals)
    signals |= {"gap": gap, "range_rate": rate, "speed": speed, drive.role: y}
    if "brake" in signals:
        signals["brake"] = brake.astype(float)
    for role, x, order, least in (("gap", gap, 3, QUIETEST_GAP), ("range_rate", rate, 2, QUIETEST_RATE)):
        reported = trace.signals.get(f"{role}_reported")
        measured = trace.signals[role] if reported is None else reported
        sd = roughness(measured, order)
        noisy = x + (rng.normal(0.0, sd, n) if sd > least else 0.0)
        signals[f"{role}_reported"] = np.where(np.isfinite(measured), noisy, np.nan)
    made = trace._replace(output=y, signals=signals, gate=tuple(gate), segment=segment, bound=bound)
    return Replicate(made, usable & drive.usable, drive.data.known.motions)


class Null(NamedTuple):
    """What findings are held against: the drive, simulated again with its driver's own noise."""

    drive: Drive
    catalogue: tuple[Effect, ...]
    progress: Callable[[float], None]
    gains: bool = True  # is what the simulation gains on them asked for?

    @property
    def seed(self) -> int:
        """The same drive gives the same replicates."""
        return crc32(np.ascontiguousarray(self.drive.trace.output).tobytes())

    def noise(self, data: DriverData, solved: FittedDriver) -> Source:
        """Noise of a fitted driver."""
        effects = [effect for effect in self.catalogue if effect.kind is Kind.REMNANT]
        innovated = innovations(self.drive.trace, data, solved)
        left = data.output.y - solved.fitted.model
        return noise_source.source(
            innovated, solved.noise, left, effects, self.drive.trace.signals.get("accel")
        )


def recorded_drive(prepared: Prepared, usable: Flags, vehicle: Vehicle, dt: float) -> Drive:
    """The drive on the grid that the driver was fitted on."""
    trace = prepared.trace
    role = output_role(trace)
    return Drive(trace, usable[:: round(trace.dt / dt)], prepared.data, role, vehicle)
