"""Diagnosis of sensors and vehicle before the driver's; the trace corrected by what was found, and what of it is usable."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis import masks
from canid.models.diagnosis.sensing import sensing_block
from canid.models.diagnosis.sensing.sensing_block import SensingFindings
from canid.models.diagnosis.vehicle import vehicle_block
from canid.models.diagnosis.vehicle.vehicle_block import Vehicle
from canid.models.effects.effect import Effect
from canid.values.findings import Blocked, Finding, Flags, Masked, masked_for
from canid.values.text.names import readable
from canid.values.text.numbers import number
from canid.values.types import Trace

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
    remnant: Blocked | None = (
        None  # of a task in which only the mean law of the driver is diagnosed; None: all is
    )

    @property
    def whole(self) -> bool:
        """Is the whole loop diagnosed, not the driver alone?"""
        return self.remnant is None


class Several(NamedTuple):
    """Drives on one trace."""

    spans: tuple[tuple[float, float], ...] = ()  # s, [begin, end) of each; (): it is one
    names: tuple[str, ...] = ()

    @property
    def begins(self) -> tuple[float, ...]:
        """Of each further drive, s."""
        return tuple(begin for begin, _ in self.spans[1:])


class Settings(NamedTuple):
    """What is asked of a diagnosis."""

    catalogue: tuple[Effect, ...]  # effects that may be named
    minimum: float  # s of driving that must be there
    progress: Callable[[float], None]  # is given the fraction of the replicates that are done
    rivals: bool = False  # calibrate published models as well
    several: Several = Several()
    null_gain: bool = True  # say what the simulation gains without the causes


class TooLittleError(Exception):
    """A drive decides nothing: why, and the steps until then. Caught in `diagnose`, where it becomes a verdict."""

    def __init__(self, why: str, steps: tuple[str, ...]) -> None:
        super().__init__(why)
        self.why, self.steps = why, steps


class Corrected(NamedTuple):
    """A drive as its driver is diagnosed from it: corrected, and without what is masked or wrong."""

    given: Trace
    trace: Trace  # corrected
    usable: Flags  # (n,)
    masked: tuple[Masked, ...]
    lacking: str  # the signals whose findings leave too little of it; "": enough is left
    context: Context
    settings: Settings
    steps: tuple[str, ...]


def correct(given: Trace, context: Context, settings: Settings) -> Corrected:
    """Leave out what a finding on a signal touches and nothing has corrected.

    Args:
        given: the drive as measured.
        context: what was found in its sensors and its car.
        settings: what is asked.
    """
    wrong = masks.untrusted(given, context.sensing.findings)
    sound, stretches = masks.left_out(given, wrong)
    masked = tuple(sorted((*context.masked, *stretches), key=lambda stretch: stretch.start))
    trace, steps = context.trace, [f"{given.t.size} samples at {given.dt:g} s"]
    if masked:
        spans = (f"{effect} {seconds:.0f} s" for effect, seconds in masked_for(masked).items())
        steps.append(f"masked before any fit: {', '.join(spans)}")
    lacking = masks.lacking_signals(wrong, sound, settings.minimum, trace.dt)
    return Corrected(given, trace, context.usable & sound, masked, lacking, context, settings, tuple(steps))


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
    named = [
        f"{readable(f.effect)} in the {f.where}: evidence {f.evidence:.0f}"
        for f in (*sensed.findings, *vehicle.findings)
    ]
    return Context(right, usable, masked, sensed, vehicle, (*steps, *named))


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
        # of rivals none is corrected: the other signal may be the wrong one
        if effect.id not in by_id or effect.correct is None or by_id[effect.id].rivals:
            continue
        estimates = by_id[effect.id].parameters
        p = [estimates[parameter.name].value for parameter in effect.parameters]
        reports = {role: signals.get(f"{role}_reported", signals[role]) for role in SMOOTHED}
        fixed = effect.correct(p, signals | reports)
        of_radar = {role: x for role, x in fixed.items() if role in SMOOTHED}
        if of_radar:
            signals |= reports | {f"{role}_reported": x for role, x in of_radar.items()}
        signals |= fixed
        numbers = ", ".join(f"{name} {number(iv.value, digits=4)}" for name, iv in estimates.items())
        steps.append(
            f"{readable(effect.id)} corrected before vehicle and driver were diagnosed{numbers and ': ' + numbers}"
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
