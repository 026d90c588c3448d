"""Closed-loop simulation of gap and speed behind the lead of the log, with the baseline and the extended driver.

Stretches of at most half a minute that neither driver was fitted to (the folds of `held_out`), each started from the
measured state. All of them use the same car: the comparison is between drivers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis.driver import pedal_holds
from canid.models.diagnosis.driver.driver_data import DriverData, braking, filled
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, K2, TAU1, TAU2, DriverModel, lagged, parts
from canid.models.diagnosis.driver.driver_simulation import HISTORY_S, Late, SimulatedDriver, driver
from canid.models.diagnosis.driver.held_out import FOLD_BLOCK_S, Fold
from canid.models.diagnosis.driver.pedal_holds import Holds
from canid.models.diagnosis.fitting import uncertainty
from canid.models.diagnosis.fitting.held_out_gain import gain
from canid.models.diagnosis.masks import extended as followed_by
from canid.models.diagnosis.vehicle.vehicle_block import Vehicle
from canid.models.diagnosis.vehicle.vehicle_data import AFTER_BRAKE_S
from canid.models.diagnosis.vehicle.vehicle_model import STRENGTH, FittedCar, drivable
from canid.models.diagnosis.vehicle.vehicle_search import FittedVehicle
from canid.values.findings import Flags, Trajectory
from canid.values.runs import runs
from canid.values.types import NAN, Array, Interval, Trace

# s; in a shorter stretch gap and speed hardly leave their initial values
MIN_STRETCH_S = 12.0
# m; least gap: cars do not pass through each other
MIN_GAP_M = 0.5
# m/s; an unstable driver's error stays a number
MAX_SPEED = 100.0
# strength of the brake over that of the engine: where the drive does not show it (as `models.simulation.car`), and its
# bounds
BRAKE_RATIO, MIN_BRAKE_RATIO, MAX_BRAKE_RATIO = 3.0, 1.0, 10.0
# s of braking needed to estimate it; % of demand below the floor from which on the brake is pressed
MIN_BRAKING_S, ON_BRAKE_PERCENT = 5.0, 3.0
# outputs that are simulated: a pedal through the fitted car, an acceleration as it is
PEDAL, ACCEL = "pedal", "accel"

Rows = npt.NDArray[np.int64]


class Stretch(NamedTuple):
    """A part of the drive, in samples."""

    start: int
    stop: int
    block: int  # of `held_out`


class Car(NamedTuple):
    """A car with its brake, along the drive."""

    fitted: FittedCar
    brake: float  # m/s² per % of demand below the floor
    slope: Array  # (n,) as the car's step takes it
    gear: Array  # (n,)


class Road(NamedTuple):
    """What the log gives, (n,) each."""

    data: DriverData
    lead_speed: Array  # m/s
    output: Array  # measured
    push: Array | None = None  # m/s², what car and road add to the fitted car; None: nothing


class Ride(NamedTuple):
    """Drivers and car of one simulation."""

    fits: tuple[FittedDriver, ...]  # one per fold
    added: tuple[
        Array | None, ...
    ]  # (n,) output unit per fold: contribution of a random walk of the desired headway
    held: tuple[Holds, ...]  # a ceiling and episodes that were seen in the pedal itself
    car: Car | None  # None: the output is the acceleration itself


def simulate(
    trace: Trace,
    data: DriverData,
    role: str,
    folds: tuple[Fold[DriverModel], ...],
    held: tuple[Holds, ...],
    vehicle: Vehicle,
) -> tuple[Trajectory, ...]:
    """Simulate gap and speed with the baseline and with the extended model.

    Args:
        trace: of the drive, on the driver's grid.
        data: the driver's columns, before anything was taken out.
        role: of the output.
        folds: both drivers, fitted to all but each fold.
        held: what was seen in the pedal itself.
        vehicle: what was found of the car, on its own grid.

    Returns:
        gap and speed; () where the output is neither pedal nor acceleration, no car was fitted, no stretch is long
        enough, or a cause is not in the model of every fold.
    """
    dt, n = data.output.dt, trace.t.size
    if role not in (PEDAL, ACCEL) or (role == PEDAL and vehicle.cars is None):
        return ()
    brake = braking(trace)
    usable = data.output.usable.copy()
    for start, stop in (span for episodes in held for span in episodes.episodes):
        usable[start:stop] = True
    where = stretches(usable & ~_after_brake(brake, dt), dt)
    # a fold whose data show nothing of a cause has a model without it
    if not where or len({fold.extended.q.size for fold in folds}) > 1:
        return ()
    cars: tuple[Car | None, Car | None] = (None, None)
    if vehicle.cars is not None and role == PEDAL:
        demand = folds[0].base.fitted.model
        baseline_car = car(vehicle.cars[0], vehicle, demand, brake, dt)
        cars = (
            baseline_car,
            baseline_car
            if vehicle.cars[0] is vehicle.cars[1]
            else car(vehicle.cars[1], vehicle, demand, brake, dt),
        )
    road = Road(data, data.seen.speed + data.seen.range_rate, trace.output)
    same = cars[0] is cars[1] and all(fold.extended is fold.base for fold in folds)
    base = Ride(tuple(fold.base for fold in folds), (None,) * len(folds), (), cars[0])
    before = drive(road, base, where)
    after = before
    if not same:
        added = tuple(None if fold.random_walk is None else fold.random_walk.added for fold in folds)
        after = drive(road, Ride(tuple(fold.extended for fold in folds), added, held, cars[1]), where)
    number = np.full(n, -1, dtype=np.int64)
    for k, stretch in enumerate(where):
        number[stretch.start : stretch.stop] = k
    inside = number >= 0
    out = []
    for name, measured, old, new in zip(
        ("gap", "speed"), (data.seen.gap, data.seen.speed), before, after, strict=True
    ):
        errors = (old - measured)[inside] ** 2, (new - measured)[inside] ** 2
        gained = Interval() if same else gain(*errors, number[inside], uncertainty.MIN_BLOCKS)
        out.append(Trajectory(name, measured, old, new, gained))
    return tuple(out)


def gap_error(trace: Trace, data: DriverData, solved: FittedDriver) -> float:
    """Mean square error of the gap, m², of a driver whose output is an acceleration, over all stretches; NaN: none.

    In closed loop a driver's own noise is not in his inputs, as it is in the measured ones: in open loop the true model
    may simulate worse than a wrong one, the more so the larger K1 (IDM, K1 0.75: error variance + 43 % in open loop,
    − 41 % in closed loop, against a constant time headway with K1 0.08).

    Args:
        trace: of the drive, on the driver's grid.
        data: the driver's columns.
        solved: the driver, fitted to the whole drive.
    """
    dt = data.output.dt
    where = stretches(data.output.usable & ~_after_brake(braking(trace), dt), dt)
    if not where:
        return float("nan")
    road = Road(data, data.seen.speed + data.seen.range_rate, trace.output)
    gap, _ = drive(road, Ride((solved,), (None,), (), None), where)
    return float(np.nanmean((gap - data.seen.gap) ** 2))


def _after_brake(brake: Flags, dt: float) -> Flags:
    """The brake, and what follows it."""
    return followed_by(brake, round(AFTER_BRAKE_S / dt))


def stretches(usable: Flags, dt: float, block_s: float = FOLD_BLOCK_S) -> tuple[Stretch, ...]:
    """Take the longest usable run out of each block of the drive; by default those of `held_out`.

    Example:
        >>> usable = np.ones(700, dtype=bool)
        >>> usable[:100] = usable[350:] = False
        >>> stretches(usable, 0.1)
        (Stretch(start=100, stop=300, block=0),)
    """
    size, out = round(block_s / dt), []
    for block, start in enumerate(range(0, usable.size, size)):
        usable_runs = runs(usable[start : start + size])
        if not usable_runs:
            continue
        first, stop = max(usable_runs, key=lambda run: run[1] - run[0])
        if (stop - first) * dt >= MIN_STRETCH_S:
            out.append(Stretch(start + first, start + stop, block))
    return tuple(out)


def car(solved: FittedVehicle, vehicle: Vehicle, demand: Array, brake: Flags, dt: float) -> Car:
    """Make a fitted car drivable, with the brake that this drive shows.

    Args:
        solved: the car.
        vehicle: its block, on its own grid.
        demand: (n,) % that the driver's model asks for, below the floor as well.
        brake: (n,) is it pressed?
        dt: s, of the driver's grid: the car's or a multiple.
    """
    n = demand.size
    every = max(vehicle.left.size // max(n, 1), 1)
    left, slope, gear = (x[::every][:n] for x in (vehicle.left, vehicle.slope, vehicle.gear))
    strength = float(solved.q[STRENGTH])
    pressed = brake & (demand < -ON_BRAKE_PERCENT) & np.isfinite(left)
    weakest, ratio = MIN_BRAKE_RATIO * strength, BRAKE_RATIO * strength
    if pressed.sum() * dt >= MIN_BRAKING_S:
        estimate = float(left[pressed] @ demand[pressed]) / float(demand[pressed] @ demand[pressed])
        ratio = float(np.clip(estimate, weakest, MAX_BRAKE_RATIO * strength))
    return Car(drivable(solved.model, solved.q, dt), ratio, slope, gear)


class Driven(NamedTuple):
    """A simulated drive: rows are samples, columns are stretches; the first rows are history, as measured."""

    late: Late
    output: Array  # with noise, before the floor; NaN in the history
    past: int  # rows of history


# (row, own acceleration (m,) of the row before) -> noise of the output (m,)
Noise = Callable[[int, Array], Array]


def drive(road: Road, ride: Ride, where: tuple[Stretch, ...]) -> tuple[Array, Array]:
    """Drive all stretches, side by side.

    Returns:
        gap (n,) m and speed (n,) m/s; NaN outside the stretches.
    """
    n = road.output.size
    late, _, past = driven(road, ride, where)
    gap, speed = np.full(n, NAN), np.full(n, NAN)
    for m, stretch in enumerate(where):
        here = slice(past, past + stretch.stop - stretch.start)
        gap[stretch.start : stretch.stop] = late.gap[here, m]
        speed[stretch.start : stretch.stop] = late.speed[here, m]
    return gap, speed


def driven(road: Road, ride: Ride, where: tuple[Stretch, ...], noise: Noise | None = None) -> Driven:
    """Drive all stretches, side by side; a stretch that comes several times is several columns.

    Args:
        road: what the log gives.
        ride: drivers and car.
        where: the stretches.
        noise: of the driver; None: none.
    """
    data, dt, n = road.data, road.data.output.dt, road.output.size
    past, length = round(HISTORY_S / dt), max(stretch.stop - stretch.start for stretch in where)
    # (past + length, m) into the drive; what lies behind a stretch's end is computed and thrown away
    rows = np.arange(-past, length)[:, None] + np.array([stretch.start for stretch in where])[None, :]
    rows = np.clip(rows, 0, n - 1)
    lead = road.lead_speed[rows]
    seen = data.seen
    # what the lead did: as the driver could know it, it would be late
    accel = data.known.lead_moved
    late = Late(seen.gap[rows], seen.range_rate[rows], seen.speed[rows], accel[rows], seen.t[rows])
    init, step = driver(_drivers(road, ride, where, rows), dt)
    person = init()
    # before a stretch the log may hold nothing, as between two drives
    pressed = np.maximum(filled(road.output)[rows], 0.0)
    engine = None
    if ride.car is not None:
        # the engine's lags hold what was pressed before
        engine = ride.car.fitted.init(pressed[0])
        for k in range(past):
            at = rows[k]
            engine, _ = ride.car.fitted.step(
                engine, pressed[k], late.speed[k], ride.car.slope[at], ride.car.gear[at]
            )
    output = np.full(rows.shape, NAN)
    own_accel = np.zeros(rows.shape[1])
    last: Array | None = None
    for k in range(past, past + length - 1):
        person, demand = step(person, late, k)
        if noise is not None:
            demand = np.minimum(demand + noise(k, own_accel), pedal_holds.ceiling(ride.held))
        demand = np.minimum(demand, data.output.ceiling)
        if engine is None:
            demand = np.maximum(demand, data.output.floor)
        output[k] = demand
        accel = demand
        if ride.car is not None and engine is not None:
            at = rows[k]
            engine, accel = ride.car.fitted.step(
                engine, np.maximum(demand, 0.0), late.speed[k], ride.car.slope[at], ride.car.gear[at]
            )
            accel = accel + ride.car.brake * np.minimum(demand, 0.0)
        if road.push is not None:
            accel = accel + road.push[rows[k]]
        # Adams and Bashforth's second order: the driver answers what the car has done, so nothing ahead is known
        mean = accel if last is None else 1.5 * accel - 0.5 * last
        last = own_accel = accel
        late.speed[k + 1] = np.maximum(late.speed[k] + dt * mean, 0.0)
        np.minimum(late.speed[k + 1], MAX_SPEED, out=late.speed[k + 1])
        opening = 0.5 * (lead[k] + lead[k + 1] - late.speed[k] - late.speed[k + 1])
        late.gap[k + 1] = np.maximum(late.gap[k] + dt * opening, MIN_GAP_M)
        late.range_rate[k + 1] = lead[k + 1] - late.speed[k + 1]
    return Driven(late, output, past)


def _drivers(road: Road, ride: Ride, where: tuple[Stretch, ...], rows: Rows) -> SimulatedDriver:
    """The driver of each stretch: fitted to the other folds, lags filled with what was measured before."""
    data, dt, n = road.data, road.data.output.dt, road.output.size
    folds = [stretch.block % len(ride.fits) for stretch in where]
    states = {}
    for fold in set(folds):
        solved = ride.fits[fold]
        inputs = parts(solved.model, data, solved.q)
        gain = inputs.gain * np.ones(n)
        states[fold] = (
            lagged(gain * solved.q[K1] * inputs.e, float(solved.q[TAU1]), dt),
            lagged(gain * solved.q[K2] * inputs.w + inputs.extra, float(solved.q[TAU2]), dt),
        )
    first, second = (
        np.array([states[fold][k][stretch.start] for fold, stretch in zip(folds, where, strict=True)])
        for k in (0, 1)
    )
    added = np.zeros(rows.shape)
    for m, fold in enumerate(folds):
        column = ride.added[fold]
        if column is not None:
            added[:, m] = column[rows[:, m]]
    away = np.zeros(n, dtype=bool)
    for start, stop in pedal_holds.away(ride.held):
        away[start:stop] = True
    q = np.array([ride.fits[fold].q for fold in folds]).T
    return SimulatedDriver(
        ride.fits[0].model,
        q,
        (first, second),
        added,
        away[rows],
        pedal_holds.ceiling(ride.held),
        data.seen.duration,
    )
