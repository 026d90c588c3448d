"""Dead zones whose threshold varies: intervals of the threshold hold it for each spread that the drive does not exclude.

A threshold of perception is no fixed number: the same stimulus is responded to at one time and not at another (Green &
Swets 1966), so that on average a response begins gradually. A zone with sharp corners that is fitted to such a driver comes
out too narrow, with too small an interval: 0.46 [0.41, 0.50] s for 0.52. So the spread is a nuisance parameter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE
from canid.models.diagnosis.driver import local_minima
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import NODES
from canid.models.diagnosis.fitting.fitted_model import solve
from canid.models.effects.effect import Effect

# standard deviations of the threshold, of its mean; beyond one half it would often be negative
SPREADS = (0.25, 0.5)


def varying(effect: Effect, spread: float) -> Effect:
    """Return a dead zone with a normal threshold: its mean response. Three-node Gauss-Hermite.

    Example:
        >>> from canid.models.effects import CATALOGUE
        >>> zone = next(effect for effect in CATALOGUE if effect.has_threshold and effect.headway)
        >>> varying(zone, 0.5).headway([0.4], np.array([-0.1, 0.4, 2.0]), None).round(3)
        array([-0.008,  0.058,  1.6  ])
    """

    def mean(hook: Any) -> Any:
        return hook and (
            lambda p, x, seen: np.sum(
                [weight * hook((p[0] * (1.0 + spread * node), *p[1:]), x, seen) for node, weight in NODES],
                axis=0,
            )
        )

    return effect._replace(headway=mean(effect.headway), range_rate=mean(effect.range_rate))


def not_excluded(data: DriverData, solved: FittedDriver, effect: Effect) -> list[tuple[Effect, FittedDriver]]:
    """Fits with a threshold that varies, those that are as likely as the likeliest, 95 %; none: the effect has no threshold.

    Args:
        data: what was fitted.
        solved: with the effect, its threshold fixed.
        effect: of its model.
    """
    out = []
    for spread in SPREADS if effect.has_threshold else ():
        other = varying(effect, spread)
        effects = [other if each.id == effect.id else each for each in solved.model.effects]
        fit = solve(data, solved.model.with_effects(effects), solved.q, solved.noise, solved.rows)
        out.append((other, local_minima.at_best_edges(data, fit, other)))
    lowest = min((solved.deviance, *(fit.deviance for _, fit in out)))
    return [(other, fit) for other, fit in out if fit.deviance - lowest <= CHI_SQUARED_QUANTILE]
