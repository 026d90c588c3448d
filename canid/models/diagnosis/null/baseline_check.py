"""Does the baseline describe the drive?

Behind a lead the driver's own noise comes back through headway and range rate, and the driver's answers work against it:
with much noise the answer to the measured inputs alone varies more than the output does, and the true model's simulation
fits worse than the mean. A poor fit speaks against a baseline only where its one-step predictions of held-out data, which
know the past noise, gain nothing from the answers either.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from canid.mathematics.identification import closed_loop_stability
from canid.mathematics.identification.closed_loop_stability import DIRECT, VehicleLoop
from canid.models.diagnosis.driver import driver_intervals, driver_search, pedal_holds
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import (
    BASE,
    DESIRED,
    HIGH,
    K1,
    K2,
    LOW,
    OFFSET,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
)  # fmt: skip
from canid.models.diagnosis.fitting.candidates import BOUND_RANGE_SHARE
from canid.models.diagnosis.null import predictive_score
from canid.models.diagnosis.prepared_drive import Prepared
from canid.models.diagnosis.vehicle.vehicle_block import Vehicle
from canid.models.diagnosis.vehicle.vehicle_model import DRAG, LAG, STRENGTH
from canid.models.diagnosis.vehicle.vehicle_search import FittedVehicle
from canid.models.effects.wanted_gap import REFERENCE_SPEED, Form
from canid.values.text.numbers import number
from canid.values.types import Channel, Identifiable

# of the upper end of a gain's interval: a gain that controls nothing
SMALL_GAIN_SHARE = 1e-2
# lags and dead times of a channel; no reaction takes as long as their upper bounds
DELAYS = {"headway_error": (TAU1, THETA1), "range_rate": (TAU2, THETA2)}


def fit_percent(data: DriverData, solved: FittedDriver) -> float:
    """Fit of the simulation on the samples that are free: 100 (1 − |y − simulated| / |y − mean|)."""
    free = data.output.usable & ~data.output.hidden
    y = data.output.y[free]
    variation = float(np.linalg.norm(y - y.mean()))
    left = float(np.linalg.norm(y - solved.fitted.model[free]))
    return 100 * (1 - left / variation) if variation > 0 else math.nan


def refusal(
    data: DriverData,
    solved: FittedDriver,
    car: FittedVehicle | None,
) -> str:
    """Why the baseline does not describe the drive, and what would help; "": it may be judged.

    Args:
        data: the driver's columns.
        solved: the baseline.
        car: the fitted car behind a pedal; None: not known.
    """
    unit = "%" if data.pedal else "m/s²"
    at = _bounds(solved, unit)
    if at:
        return f"{at} at the bound of what is searched: check units and signs of the signals (canid check)"
    channels = driver_intervals.channels(solved, data.output.dt)
    why = (
        _wrong_sign(channels, unit) or _bounded_delay(solved, channels) or _loop(data, solved, channels, car)
    )
    if why:
        return why
    fit = fit_percent(data, solved)
    if fit <= 0.0 and not predictive_score.of_answers(data, solved).low > 0:
        return (
            f"its simulation fits worse than the mean of the output (fit {number(fit, '%', 2)}), and its predictions of "
            "the next sample gain nothing from the lead: something else moves the output. What would help: 10 min in one "
            "stretch behind a lead whose speed changes, without cruise control"
        )
    return ""


def _near(solved: FittedDriver, k: int, limit: float) -> bool:
    return abs(float(solved.q[k]) - limit) < BOUND_RANGE_SHARE * (HIGH[k] - LOW[k])


def _bounds(solved: FittedDriver, unit: str) -> str:
    """Offset or gain at an end of its box; `unit`: of the output."""
    units = {OFFSET: unit, K1: f"{unit} per s", K2: f"{unit} per m/s"}
    at = [k for k in (OFFSET, K1, K2) if any(_near(solved, k, limit) for limit in (LOW[k], HIGH[k]))]
    return ", ".join(f"{BASE[k]} is {solved.q[k]:.3g} {units[k]}" for k in at)


def _wrong_sign(channels: Mapping[str, Channel], unit: str) -> str:
    per = {"headway_error": "s", "range_rate": "m/s"}
    for name, channel in channels.items():
        if channel.K.high < 0.0:
            return (
                f"the gain of {name.replace('_', ' ')} is negative, {channel.K.value:.3g} "
                f"[{channel.K.low:.3g}, {channel.K.high:.3g}] {unit} per {per[name]}: nobody follows like that. "
                "What would help: check the signs of the signals (canid check), or a drive in which the lead changes its "
                "speed at several headways"
            )
    return ""


def _bounded_delay(solved: FittedDriver, channels: Mapping[str, Channel]) -> str:
    """A response as late as the search goes, lag and dead time both, is no reaction. A gain near 0 has no delay."""
    for name, delays in DELAYS.items():
        if channels[name].status is not Identifiable.NOT and all(_near(solved, k, HIGH[k]) for k in delays):
            late = sum(HIGH[k] for k in delays)
            return (
                f"the response to {name.replace('_', ' ')} is as late as the search goes, {late:.1f} s: it is no reaction. "
                "What would help: a lead whose speed changes more often"
            )
    return ""


def vehicle_loop(car: FittedVehicle | None, pedal: bool, speed: float) -> VehicleLoop | None:
    """From the output to the acceleration, at a speed (m/s); None: not known."""
    if not pedal:
        return DIRECT
    if car is None:
        return None
    return VehicleLoop(float(car.q[STRENGTH]), float(car.q[LAG]), max(2.0 * float(car.q[DRAG]) * speed, 0.0))


def not_surely_negative(channel: Channel) -> Channel:
    """The channel with a gain of next to 0 where the estimate is negative and its interval is not.

    A gain that is not distinguishable from 0 is as often of the wrong sign, and a headway that is not controlled drifts
    slowly: that does not speak against the model. A response that overshoots does.
    """
    K = channel.K
    if not K.value < 0.0 < K.high:
        return channel
    return channel._replace(K=K._replace(value=SMALL_GAIN_SHARE * K.high))


def _loop(
    data: DriverData, solved: FittedDriver, channels: Mapping[str, Channel], car: FittedVehicle | None
) -> str:
    """Sentence on an unstable loop, at the median speed and headway of the drive."""
    free = data.output.usable
    speed, headway = (float(np.median(x[free])) for x in (data.seen.speed, data.seen.headway))
    vehicle = vehicle_loop(car, data.pedal, speed)
    # of a gap error, K1 per 20 m/s multiplies gap − T·v
    at = (
        (speed, headway) if solved.model.form is not Form.GAP else (REFERENCE_SPEED, float(solved.q[DESIRED]))
    )
    both = [not_surely_negative(channel) for channel in channels.values()]
    if vehicle is None or not closed_loop_stability.is_unstable(both, *at, vehicle):
        return ""
    gains = " and ".join(f"{channel.K.value:.3g}" for channel in channels.values())
    return (
        f"with its gains ({gains}) and delays the following would be unstable at {speed:.0f} m/s. What would help: a longer "
        "drive, over which the headway changes by more than the driver's noise"
    )


def refused_baseline(prepared: Prepared, vehicle: Vehicle) -> str:
    """Why no cause may be named on this baseline; "": it may be judged.

    Stretches in which the pedal stands still are seen in the pedal itself: without them the baseline may hold.
    """
    car = vehicle.cars[0] if vehicle.cars is not None else None
    why = refusal(prepared.data, prepared.fitted, car)
    if not why:
        return ""
    seen = pedal_holds.detect(prepared.data, prepared.fitted)
    if seen.pattern is None:
        return why
    data, fitted = driver_search.without_holds(prepared.data, prepared.fitted, seen)
    return refusal(data, fitted, car)
