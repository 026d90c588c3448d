"""Intervals of the driver that hold also where an effect is there which the drive does not exclude.

Every candidate of the search's last step, none of which was named, is a model of the same drive with other gains and
delays. Bayesian model averaging (Hoeting, Madigan, Raftery & Volinsky 1999) weighs it by its posterior odds against the
final model: Laplace's approximation with a normal prior of the effect's strength, whose standard deviation is the typical
strength (Kass & Raftery 1995). An effect that the drive would show has a small weight; one that it cannot show, as an
answer to the lead's acceleration behind a calm lead, keeps its prior odds and all that it would change.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import model_average
from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.driver import detectability, driver_candidates
from canid.models.diagnosis.driver.driver_candidates import DriverCandidate
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import BASE
from canid.models.diagnosis.fitting.candidates import Candidate
from canid.models.diagnosis.fitting.fitted_model import M
from canid.models.diagnosis.fitting.model import place
from canid.models.diagnosis.fitting.uncertainty import sandwich
from canid.models.effects.effect import Effect, Kind, Parameter
from canid.values.types import Array, Interval

# of an effect against the model without it, before the drive
PRIOR_ODDS = 1.0
# posterior odds below which a model changes no interval
LEAST_ODDS = 1e-3


class Alternative(NamedTuple):
    """The driver, with one more effect."""

    effect: str
    odds: float  # posterior, against the final model
    mean: Array  # (len(BASE),) posterior
    covariance: Array  # (len(BASE), len(BASE))


def alternatives(
    candidates: Iterable[DriverCandidate], withdrawn: Iterable[Effect], data: DriverData, solved: FittedDriver
) -> tuple[Alternative, ...]:
    """Models with one more effect than the final one, those that count.

    Args:
        candidates: of the search's last step.
        withdrawn: effects that the drive seemed to show, and held-out data or the null did not: fitted again, and no
            likelier than the final model.
        data: the driver's columns, as the final model was fitted to them.
        solved: the final model.
    """
    out = [
        _alternative(candidate, data)
        for candidate in candidates
        if candidate.solved.model.effects == (*solved.model.effects, candidate.effect)
    ]
    for effect in withdrawn:
        if effect.kind is Kind.PARAMETRIC and detectability.strength(effect) is not None:
            guesses = driver_candidates.screen(effect, data, solved)
            again = _alternative(driver_candidates.tried(effect, data, solved, guesses), data)
            out.append(None if again is None else again._replace(odds=min(again.odds, PRIOR_ODDS)))
    return tuple(
        alternative for alternative in out if alternative is not None and alternative.odds > LEAST_ODDS
    )


def _alternative(candidate: DriverCandidate, data: DriverData) -> Alternative | None:
    strength = detectability.strength(candidate.effect)
    if strength is None:
        return None
    return alternative(candidate, strength, len(BASE), data.output.dt, detectability.typical(strength, data))


def alternative(
    candidate: Candidate[M], strength: Parameter, size: int, dt: float, typical: float
) -> Alternative | None:
    """One more effect in a model, weighed; None: its strength is at a bound.

    Args:
        candidate: fitted in full.
        strength: the parameter of the effect that says how strong it is.
        size: parameters of the model that are not those of effects, the first ones.
        dt: s.
        typical: standard deviation of the normal prior of the strength.
    """
    at = place(candidate.solved.model, candidate.effect.id).start + candidate.effect.parameters.index(
        strength
    )
    free = candidate.solved.fitted.free
    if at not in free:
        return None
    C = np.zeros((size + 1, size + 1))
    robust = sandwich(candidate.solved.fitted, dt).C
    here = [k for k, q in enumerate((*range(size), at)) if q in free]
    columns = [free.index(q) for q in (*range(size), at) if q in free]
    C[np.ix_(here, here)] = robust[np.ix_(columns, columns)]
    value, variance = float(candidate.solved.q[at]), float(C[-1, -1])
    prior = typical**2
    total = variance + prior
    log_odds = 0.5 * (candidate.evidence + np.log(variance / total) - value**2 / total)
    # the strength moves towards 0 by the prior, and the driver's parameters along with it
    slope = C[:-1, -1] / variance
    mean = candidate.solved.q[:size] - slope * value * variance / total
    covariance = C[:-1, :-1] - np.outer(slope, slope) * variance**2 / total
    return Alternative(candidate.effect.id, PRIOR_ODDS * float(np.exp(min(log_odds, 50.0))), mean, covariance)


class Spread(NamedTuple):
    """A parameter by several models."""

    interval: Interval  # 95 %
    sd: float


def averaged(
    narrow: Interval,
    sd: float,
    others: Sequence[Alternative],
    parameters: Sequence[int],
    wider: float,
    low: float = -np.inf,
    high: float = np.inf,
) -> Spread:
    """Widen an interval of a parameter, or of a sum of parameters, by what other models say of it; never narrow it.

    Args:
        narrow: by the final model, normal on either side.
        sd: the same, its standard deviation.
        others: other models.
        parameters: indices into `BASE`; of several, their sum.
        wider: factor on the standard deviations of the other models.
        low: the least that is possible.
        high: the most that is possible.

    Example:
        >>> covariance = np.diag([0.0, 0.04, *[0.0] * 8])
        >>> other = Alternative("another", 1.0, np.array([0.0, 4.0, *[0.0] * 8]), covariance)
        >>> of = averaged(Interval(5.0, 4.608, 5.392), 0.2, [other], [1], 1.0)
        >>> round(of.interval.low, 2), of.interval.high, round(of.sd, 2)
        (3.67, 5.392, 0.54)
        >>> averaged(Interval(5.0, 4.608, 5.392), 0.2, [], [1], 1.0)
        Spread(interval=Interval(value=5.0, low=4.608, high=5.392), sd=0.2)
    """
    if not others or not np.isfinite(narrow).all():
        return Spread(narrow, sd)
    index = list(parameters)
    # no parameter is less known than by its bounds alone
    widest = (high - low) / np.sqrt(12.0)
    means = np.array([narrow.value, *(float(other.mean[index].sum()) for other in others)])
    variances = [float(other.covariance[np.ix_(index, index)].sum()) for other in others]
    sds = np.array([sd, *(min(wider * np.sqrt(max(x, 0.0)), widest) for x in variances)])
    odds = np.array([other.odds for other in others])
    wide = model_average.widened(narrow, means[1:], sds[1:], odds, SIGMAS)
    ends = max(wide.low, low), min(wide.high, high)
    weights = np.r_[1.0, odds] / (1.0 + odds.sum())
    mean = float(weights @ means)
    spread = float(np.sqrt(weights @ (sds**2 + (means - mean) ** 2)))
    return Spread(Interval(narrow.value, *ends), max(spread, sd))
