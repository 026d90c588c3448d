"""Diagnosis of sensors and vehicle before the driver's, and the trace corrected by the findings of the sensors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis import masks
from canid.diagnosis.sensing import sensing_block
from canid.diagnosis.sensing.sensing_block import SensingFindings
from canid.diagnosis.vehicle import vehicle_block
from canid.diagnosis.vehicle.vehicle_block import Vehicle
from canid.effects.effect import Effect
from canid.findings import Finding, Flags, Masked
from canid.types import Trace

# gap and range rate are smoothed jointly: where one is wrong, only the reports themselves can be corrected
SMOOTHED = ("gap", "range_rate")


class Context(NamedTuple):
    """Input of the driver's block, and the findings of the other two blocks."""

    trace: Trace  # corrected
    usable: Flags  # (n,) samples outside of every mask
    masked: tuple[Masked, ...]
    sensing: SensingFindings
    vehicle: Vehicle
    steps: tuple[str, ...]


def diagnose_context(trace: Trace, catalogue: tuple[Effect, ...]) -> Context:
    """Diagnose the sensors, correct the trace, then diagnose the vehicle.

    Args:
        trace: of a drive.
        catalogue: the effects that may be named.
    """
    sensed = sensing_block.diagnose_sensing(trace, catalogue)
    right, steps = corrected(trace, sensed.findings, catalogue)
    usable, masked = masks.recognise(right, catalogue)
    effects = tuple(effect for effect in catalogue if effect.where == "vehicle")
    vehicle = vehicle_block.diagnose_vehicle(right, usable, effects)
    found = [
        f"{f.effect} in the {f.where}: evidence {f.evidence:.0f}"
        for f in (*sensed.findings, *vehicle.findings)
    ]
    return Context(right, usable, masked, sensed, vehicle, (*steps, *found))


def corrected(
    trace: Trace, findings: tuple[Finding, ...], catalogue: tuple[Effect, ...]
) -> tuple[Trace, list[str]]:
    """Correct signals with a wrong scale or sign: the driver saw the road, not the signals.

    Args:
        trace: of a drive.
        findings: of the sensing block.
        catalogue: the effects; those without `correct` change nothing.

    Returns:
        the trace, and a sentence per correction.
    """
    by_id = {finding.effect: finding for finding in findings}
    signals, steps = dict(trace.signals), list[str]()
    for effect in catalogue:
        if effect.id not in by_id or effect.correct is None:
            continue
        estimates = by_id[effect.id].parameters
        p = [estimates[parameter.name].value for parameter in effect.parameters]
        reports = {role: signals.get(f"{role}_reported", signals[role]) for role in SMOOTHED}
        fixed = effect.correct(p, signals | reports)
        of_radar = {role: x for role, x in fixed.items() if role in SMOOTHED}
        if of_radar:
            signals |= reports | {f"{role}_reported": x for role, x in of_radar.items()}
        signals |= fixed
        numbers = ", ".join(f"{name} {iv.value:.4g}" for name, iv in estimates.items())
        steps.append(
            f"{effect.id} corrected before vehicle and driver were diagnosed{numbers and ': ' + numbers}"
        )
    if not steps:
        return trace, []
    inputs = trace.inputs.copy()
    if trace.input_names == ("headway_error", "range_rate"):
        with np.errstate(divide="ignore", invalid="ignore"):
            before = trace.signals["gap"] / trace.signals["speed"]
            headway = np.where(signals["speed"] > 0, signals["gap"] / signals["speed"], np.nan)
        inputs[:, 0] += headway - before
        inputs[:, 1] = signals["range_rate"]
        if "headway" in signals:
            signals["headway"] = np.where(np.isfinite(signals["headway"]), headway, np.nan)
    return trace._replace(signals=signals, inputs=inputs), steps
