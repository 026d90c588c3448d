"""What a drive can show: the evidence that each effect would leave at its typical strength, and the power of the drive.

Power: from which strength on an effect would have shown, and what a weaker one would do to K of range rate. To first order
an effect of one strength adds its direction to the whitened residual: its expected evidence is the squared length of what
the fitted parameters cannot take up, and what they do take up is the bias of omitting it. A strength is visible where the
evidence, normal about the square root of its expectation (Wald 1943), exceeds what is needed nine times out of ten.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lstsq
from scipy.stats import norm

from canid.models.diagnosis.driver.driver_candidates import starts
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import DESIRED, K1, K2, OFFSET, pedal
from canid.models.diagnosis.fitting.candidates import direction, model_directions
from canid.models.diagnosis.fitting.fitted_model import extended
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.effects.effect import Effect, Kind, Parameter
from canid.values.findings import NotTestable, Visible
from canid.values.text.numbers import number
from canid.values.types import NAN, Array

PEDAL_UNIT, ACCELERATION_UNIT = "%", "m/s²"


def in_output_unit(text: str, *, pedal: bool) -> str:
    """An effect's sentence or unit in the unit of the output.

    Args:
        text: with "%" or "output units" (in a unit: "output") where the output's unit belongs.
        pedal: is the output a pedal? Else it is an acceleration.

    Example:
        >>> in_output_unit("by {gain} % per m/s", pedal=False), in_output_unit("output/(m/s²)", pedal=True)
        ('by {gain} m/s² per m/s', '% per m/s²')
    """
    unit = PEDAL_UNIT if pedal else ACCELERATION_UNIT
    for word in ("output units", "output/", PEDAL_UNIT):
        text = text.replace(word, unit + "/" * word.endswith("/"))
    return text.replace("/(", " per ").removesuffix(")") if "/(" in text and "{" not in text else text


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
    typical_ones = [parameter for parameter in effect.parameters if parameter.typical]
    return typical_ones[0] if len(typical_ones) == 1 else None


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
        d = direction(data, without, Q, pedal(model, data, q, A=without.noise.A) - without.fitted.model)
        out.append(Shown(effect, float(d @ d), d))
    return out


def undecided(
    priced: list[Shown],
    data: DriverData,
    tried: int,
    named: frozenset[str] = frozenset(),
    shows: frozenset[str] = frozenset(),
) -> list[NotTestable]:
    """Effects that this drive cannot show, and pairs that it does not distinguish.

    Args:
        priced: along the drive, with the baseline's noise.
        data: of the driver.
        tried: candidates.
        named: effects that are found: nothing is undecided of them.
        shows: effects whose typical strength the final model would have shown, whose noise is smaller.
    """
    out = []
    seen = []
    for shown in priced:
        if shown.effect.id in named:
            continue
        bound = needed(len(shown.effect.parameters), tried)
        if shown.expected < bound and shown.effect.id not in shows:
            why = shown.effect.absorbed or "a typical strength of it leaves too little on this drive"
            at = ", ".join(
                f"{p.name} {number(typical(p, data), digits=2)} {in_output_unit(p.unit, pedal=data.pedal)}".removesuffix(
                    " 1"
                )
                for p in shown.effect.parameters
                if p.typical
            )
            at = f", at {at}" if at else ""
            says = f"{why} (expected evidence {shown.expected:.0f} of the {bound:.0f} needed{at})"
            if shown.effect.decides:
                says += f"; what would decide: {shown.effect.decides}"
            out.append(NotTestable((shown.effect.id,), says, shown.expected, bound))
        else:
            seen.append(shown)
    for k, a in enumerate(seen):
        for b in seen[k + 1 :]:
            cosine = abs(float(a.direction @ b.direction)) / np.sqrt(a.expected * b.expected)
            if cosine > SAME_DIRECTION_COSINE:
                says = f"along this drive they do the same (cosine {cosine:.2f})"
                says += f"; what would decide: {a.effect.decides or b.effect.decides}"
                out.append(NotTestable((a.effect.id, b.effect.id), says))
    return out


# chance that a visible strength is seen
POWER = 0.9
# of the typical strength; between the first and the last, by steps of 2^(1/2)
LEAST, MOST, STEPS = 0.125, 8.0, 13


def visible(effects: tuple[Effect, ...], data: DriverData, solved: FittedDriver) -> tuple[Visible, ...]:
    """Price effects by strength, along this drive; those that could bend K of range rate most come first.

    Args:
        effects: candidates of the driver's block.
        data: the driver's columns, with what the search took out of them.
        solved: the final model; what is in it is left out.
    """
    have = {effect.id for effect in solved.model.effects}
    Q, out = model_directions(solved), []
    tried = sum(effect.kind is not Kind.MASK for effect in effects)
    for effect in effects:
        parameter = strength(effect)
        if effect.kind is Kind.PARAMETRIC and effect.id not in have and parameter is not None:
            out.append(_visible(effect, parameter, data, solved, Q, needed(len(effect.parameters), tried)))
    return tuple(sorted(out, key=lambda seen: -abs(seen.bends) if np.isfinite(seen.bends) else 0.0))


def at_typical(
    visibles: tuple[Visible, ...], effects: tuple[Effect, ...], data: DriverData
) -> frozenset[str]:
    """Effects that would have shown at their typical strength already."""
    typical_ones = {
        effect.id: typical(parameter, data)
        for effect in effects
        if (parameter := strength(effect)) is not None
    }
    return frozenset(
        visible.effect for visible in visibles if visible.strength <= 1.001 * typical_ones[visible.effect]
    )


def _visible(
    effect: Effect, parameter: Parameter, data: DriverData, solved: FittedDriver, Q: Array, bound: float
) -> Visible:
    model = extended(solved.model, effect)
    function = model.bind(data, solved.noise)
    begin = list(starts(effect, data, solved))
    q = begin[len(begin) // 2].copy()
    if effect.shows_desired_headway:
        median = float(np.median(data.seen.headway[data.output.usable]))
        q[OFFSET] += q[K1] * (median - q[DESIRED])
        q[DESIRED] = median
    at = solved.q.size + effect.parameters.index(parameter)
    most = model.high[at]
    wanted = (np.sqrt(bound) + norm.isf(1.0 - POWER)) ** 2
    unit = in_output_unit(parameter.unit, pedal=data.pedal)
    change = np.zeros(data.output.y.size)
    for share in np.geomspace(LEAST, MOST, STEPS):
        value = share * typical(parameter, data)
        if value > most:
            break
        q[at] = value
        change = whitened(solved.noise, function(q) - solved.fitted.model) * solved.fitted.scored.slope
        left = change - Q @ (Q.T @ change)
        if float(left @ left) >= wanted:
            return Visible(effect.id, parameter.name, float(value), unit, _bends(solved, change))
    return Visible(effect.id, parameter.name, NAN, unit, _bends(solved, change))


def _bends(solved: FittedDriver, change: Array) -> float:
    """Bias of K of range rate, relative, where an effect with this whitened change is there and left out."""
    K = float(solved.q[K2])
    if K2 not in solved.fitted.free or K == 0.0:
        return NAN
    scale = np.linalg.norm(solved.fitted.jacobian, axis=0)
    scale[scale == 0] = 1.0
    moved = lstsq(solved.fitted.jacobian / scale, change)[0] / scale
    return float(moved[solved.fitted.free.index(K2)]) / K
