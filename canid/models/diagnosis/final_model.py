"""The final model of a diagnosis: baseline, or with its causes where they hold, as a simulation takes it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from canid.models.diagnosis.driver import closed_loop
from canid.models.diagnosis.driver.driver_data import DriverData, braking
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import BASE
from canid.models.diagnosis.fitting.uncertainty import sandwich
from canid.models.diagnosis.vehicle.vehicle_block import Vehicle
from canid.models.diagnosis.vehicle.vehicle_model import DRAG, LAG, ROLLING, STRENGTH
from canid.values.findings import Finding
from canid.values.identified_model import CarLaw, IdentifiedModel, NoiseLaw
from canid.values.types import Array, Interval, Trace

# effects on these are in the model; one of a sensor is not: the drive was corrected for it
IN_MODEL = ("driver", "vehicle", "remnant")
# %; the range that was driven is between these points
RANGE_PERCENT = (50.0, 5.0, 95.0)


def final_model(
    trace: Trace,
    data: DriverData,
    solved: FittedDriver,
    vehicle: Vehicle,
    findings: Iterable[Finding],
    role: str,
) -> IdentifiedModel | None:
    """Return the model; None: the output is neither a pedal with a fitted car nor an acceleration.

    Args:
        trace: of the drive, on the driver's grid.
        data: the driver's columns.
        solved: the driver's fit; with the causes that hold.
        vehicle: its block.
        findings: all that hold, in any block.
        role: of the output.
    """
    if role not in (closed_loop.PEDAL, closed_loop.ACCEL):
        return None
    car = _car(trace, data, solved, vehicle) if role == closed_loop.PEDAL else None
    if role == closed_loop.PEDAL and car is None:
        return None
    of_effects = [
        f"{effect.id}.{parameter.name}" for effect in solved.model.effects for parameter in effect.parameters
    ]
    further = [f"offset of drive {k} less that of 1" for k in range(2, 2 + len(solved.model.begins))]
    used = data.output.usable & ~data.output.below
    return IdentifiedModel(
        output=role,
        form=solved.model.form.value,
        driver={name: float(x) for name, x in zip(BASE, solved.q, strict=False)},
        covariance=_covariance(solved, data.output.dt),
        names=(*BASE, *further, *of_effects),
        effects=_effects(solved, findings),
        noise=NoiseLaw(
            data.output.dt,
            tuple(float(-a) for a in solved.noise.A[1:]),
            solved.noise.sd * solved.noise.deviation * float(np.sqrt(np.mean(solved.noise.size[used] ** 2))),
        ),
        car=car,
        driven={
            role: Interval(*(float(x) for x in np.percentile(column[used], RANGE_PERCENT)))
            for role, column in (
                ("speed", data.seen.speed),
                ("gap", data.seen.gap),
                ("headway", data.seen.headway),
                ("range_rate", data.seen.range_rate),
            )
        },
    )


def _effects(solved: FittedDriver, findings: Iterable[Finding]) -> dict[str, dict[str, float]]:
    """Parameters of every effect: those of the fit, and of what was found in pedal, car and remnant as reported."""
    out = {
        effect.id: {p.name: float(x) for p, x in zip(effect.parameters, solved.q[where], strict=True)}
        for effect, where in zip(solved.model.effects, solved.model.where, strict=True)
    }
    for finding in findings:
        if finding.where in IN_MODEL and finding.effect not in out:
            out[finding.effect] = {name: estimate.value for name, estimate in finding.parameters.items()}
    return out


def _covariance(solved: FittedDriver, dt: float) -> Array:
    """Of all parameters; 0 where one was held."""
    out = np.zeros((solved.q.size, solved.q.size))
    free = np.array(solved.fitted.free)
    out[np.ix_(free, free)] = sandwich(solved.fitted, dt).C
    return out


def _car(trace: Trace, data: DriverData, solved: FittedDriver, vehicle: Vehicle) -> CarLaw | None:
    if vehicle.cars is None:
        return None
    q = vehicle.cars[1].q
    driven = closed_loop.car(vehicle.cars[1], vehicle, solved.fitted.model, braking(trace), data.output.dt)
    return CarLaw(float(q[STRENGTH]), float(q[LAG]), float(q[ROLLING]), float(q[DRAG]), driven.brake)
