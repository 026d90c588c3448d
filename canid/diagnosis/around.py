"""What is around the driver, looked at before him: do the sensors agree, and does the car do what its pedal asks for?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis import masks, sensing, vehicle_block
from canid.diagnosis.sensing import Sensed
from canid.diagnosis.vehicle_block import Vehicle
from canid.effects.cause import Effect
from canid.findings import Finding, Flags, Masked
from canid.types import Trace


class Around(NamedTuple):
    """A drive as the driver's block may take it, and what was found on the way."""

    trace: Trace  # with what is surely measured wrongly put right
    usable: Flags  # (n,) samples that no mask has taken
    masked: tuple[Masked, ...]
    sensing: Sensed
    vehicle: Vehicle
    steps: tuple[str, ...]


def look(trace: Trace, catalogue: tuple[Effect, ...]) -> Around:
    """Look at sensing, then at the vehicle.

    Args:
        trace: of a drive.
        catalogue: the causes that may be named.
    """
    sensed = sensing.look(trace, {effect.id for effect in catalogue})
    right, steps = corrected(trace, sensed.findings)
    usable, masked = masks.recognise(right)
    effects = tuple(effect for effect in catalogue if effect.where == "vehicle")
    vehicle = vehicle_block.look(right, usable, effects)
    found = [
        f"{f.effect} in the {f.where}: evidence {f.evidence:.0f}"
        for f in (*sensed.findings, *vehicle.findings)
    ]
    return Around(right, usable, masked, sensed, vehicle, (*steps, *found))


def corrected(trace: Trace, findings: tuple[Finding, ...]) -> tuple[Trace, list[str]]:
    """Put right what has a wrong scale or sign; the driver saw the road, not the radar's DBC file.

    A late radar stays late: the driver's dead time takes that up, which the finding says.

    Returns:
        the trace, and a sentence per correction.
    """
    by = {finding.effect: finding for finding in findings}
    signals, steps = dict(trace.signals), []
    ratio = -1.0 if "range_rate_sign" in by else 1.0
    if "range_rate_scale" in by:
        ratio *= 1 + by["range_rate_scale"].parameters["share"].value
    if ratio != 1.0:
        # the smoother has mixed a gap and a range rate that contradict each other: back to the reports
        for role in ("gap", "range_rate"):
            signals[role] = signals.get(f"{role}_reported", signals[role])
        signals["range_rate"] = signals["range_rate"] / ratio
        signals["range_rate_reported"] = signals["range_rate"]
        steps.append(f"range rate divided by {ratio:.3f} before car and driver were looked at")
    if "speed_scale" in by:
        share = by["speed_scale"].parameters["share"].value
        signals["speed"] = signals["speed"] / (1 + share)
        steps.append(f"speed divided by {1 + share:.4f} before car and driver were looked at")
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
