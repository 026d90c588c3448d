"""Power of a drive: from which strength on an effect would have shown, and what a weaker one would do to K of range rate.

To first order an effect of one strength adds its direction to the whitened residual: its expected evidence is the squared
length of what the fitted parameters cannot take up, and what they do take up is the bias of omitting it. A strength is
visible where the evidence, normal about the square root of its expectation (Wald 1943), exceeds what is needed nine times
out of ten.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lstsq
from scipy.stats import norm

from canid.diagnosis.driver import detectability
from canid.diagnosis.driver.driver_candidates import starts
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_model import DESIRED, K1, K2, OFFSET
from canid.diagnosis.driver.output_unit import in_output_unit
from canid.diagnosis.fitting.candidates import model_directions
from canid.diagnosis.fitting.fitted_model import extended
from canid.diagnosis.fitting.likelihood import whitened
from canid.diagnosis.fitting.robust_covariance import needed
from canid.effects.effect import Effect, Kind, Parameter
from canid.findings import Visible
from canid.types import NAN, Array

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
        own = detectability.strength(effect)
        if effect.kind is Kind.PARAMETRIC and effect.id not in have and own is not None:
            out.append(_visible(effect, own, data, solved, Q, needed(len(effect.parameters), tried)))
    return tuple(sorted(out, key=lambda one: -abs(one.bends) if np.isfinite(one.bends) else 0.0))


def _visible(
    effect: Effect, own: Parameter, data: DriverData, solved: FittedDriver, Q: Array, bound: float
) -> Visible:
    model = extended(solved.model, effect)
    function = model.bind(data)
    begin = list(starts(effect, data, solved))
    q = begin[len(begin) // 2].copy()
    if effect.shows_desired_headway:
        median = float(np.median(data.seen.headway[data.output.usable]))
        q[OFFSET] += q[K1] * (median - q[DESIRED])
        q[DESIRED] = median
    at = solved.q.size + effect.parameters.index(own)
    most = model.high[at]
    wanted = (np.sqrt(bound) + norm.isf(1.0 - POWER)) ** 2
    unit = in_output_unit(own.unit, pedal=data.pedal)
    change = np.zeros(data.output.y.size)
    for share in np.geomspace(LEAST, MOST, STEPS):
        value = share * detectability.typical(own, data)
        if value > most:
            break
        q[at] = value
        change = whitened(solved.noise, function(q) - solved.fitted.model) * solved.fitted.scored.slope
        left = change - Q @ (Q.T @ change)
        if float(left @ left) >= wanted:
            return Visible(effect.id, own.name, float(value), unit, _bends(solved, change))
    return Visible(effect.id, own.name, NAN, unit, _bends(solved, change))


def _bends(solved: FittedDriver, change: Array) -> float:
    """Bias of K of range rate, relative, where an effect with this whitened change is there and left out."""
    K = float(solved.q[K2])
    if K2 not in solved.fitted.free or K == 0.0:
        return NAN
    scale = np.linalg.norm(solved.fitted.jacobian, axis=0)
    scale[scale == 0] = 1.0
    moved = lstsq(solved.fitted.jacobian / scale, change)[0] / scale
    return float(moved[solved.fitted.free.index(K2)]) / K
