"""Detectability of effects on a drive: the evidence that each would leave at its typical strength."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver.driver_candidates import starts
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_model import DESIRED, K1, OFFSET, pedal
from canid.diagnosis.driver.output_unit import in_output_unit
from canid.diagnosis.fitting.candidates import direction, model_directions
from canid.diagnosis.fitting.fitted_model import extended
from canid.diagnosis.fitting.robust_covariance import needed
from canid.effects.effect import Effect, Kind, Parameter
from canid.findings import NotTestable
from canid.types import Array

# cosine between the directions of two effects, above which a drive does not distinguish them
SAME_DIRECTION_COSINE = 0.95
# %, standard deviation of a pedal in following (simulated and measured ones): typical strengths are stated for
# such a pedal
TYPICAL_PEDAL_SD_PERCENT = 6.0


class Shown(NamedTuple):
    """What one cause at a typical strength would leave on this drive."""

    effect: Effect
    expected: float  # evidence
    direction: Array  # (n,) whitened, baseline's own directions taken out


def strength(effect: Effect) -> Parameter | None:
    """The one parameter that says how strong an effect is."""
    own = [parameter for parameter in effect.parameters if parameter.typical]
    return own[0] if len(own) == 1 else None


def typical(parameter: Parameter, data: DriverData) -> float:
    """A parameter's typical strength; those in the output's unit are stated for a pedal, and scaled for another output."""
    if data.pedal or not parameter.unit.startswith(("%", "output")):
        return parameter.typical
    return parameter.typical * float(np.std(data.output.y[data.output.usable])) / TYPICAL_PEDAL_SD_PERCENT


def shown(effects: tuple[Effect, ...], data: DriverData, without: FittedDriver) -> list[Shown]:
    """Price every parametric cause at its typical strength, along this drive."""
    out = []
    Q = model_directions(without)
    for effect in effects:
        if effect.kind is not Kind.PARAMETRIC:
            continue
        begin = list(starts(effect, data, without))
        q = begin[len(begin) // 2].copy()
        first = without.q.size
        for k, parameter in enumerate(effect.parameters):
            if parameter.typical and not callable(parameter.initial):
                q[first + k] = typical(parameter, data)
        median = float(np.median(data.seen.headway[data.output.usable]))
        if effect.shows_desired_headway:
            q[OFFSET] += q[K1] * (median - q[DESIRED])
            q[DESIRED] = median
        model = extended(without.model, effect)
        d = direction(data, without, Q, pedal(model, data, q) - without.fitted.model)
        out.append(Shown(effect, float(d @ d), d))
    return out


def undecided(
    priced: list[Shown], data: DriverData, tried: int, named: frozenset[str] = frozenset()
) -> list[NotTestable]:
    """Effects that this drive cannot show, and pairs that it does not distinguish; none of those that it has `named`."""
    out = []
    seen = []
    for one in priced:
        if one.effect.id in named:
            continue
        bound = needed(len(one.effect.parameters), tried)
        if one.expected < bound:
            why = one.effect.absorbed or "a typical strength of it leaves too little on this drive"
            at = ", ".join(
                f"{p.name} {typical(p, data):.2g} {in_output_unit(p.unit, pedal=data.pedal)}".removesuffix(
                    " 1"
                )
                for p in one.effect.parameters
                if p.typical
            )
            at = f", at {at}" if at else ""
            says = f"{why} (expected evidence {one.expected:.0f} of the {bound:.0f} needed{at})"
            if one.effect.decides:
                says += f"; what would decide: {one.effect.decides}"
            out.append(NotTestable((one.effect.id,), says))
        else:
            seen.append(one)
    for k, a in enumerate(seen):
        for b in seen[k + 1 :]:
            cosine = abs(float(a.direction @ b.direction)) / np.sqrt(a.expected * b.expected)
            if cosine > SAME_DIRECTION_COSINE:
                says = f"along this drive they do the same (cosine {cosine:.2f})"
                says += f"; what would decide: {a.effect.decides or b.effect.decides}"
                out.append(NotTestable((a.effect.id, b.effect.id), says))
    return out
