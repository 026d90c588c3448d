"""Robust intervals of a fitted driver and of its causes: sandwich covariance (White 1982), then the profile likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.confidence import SIGMAS
from canid.mathematics.identification.movement_rhythm import RHYTHM_STEP_HZ
from canid.models.diagnosis.driver import local_minima, spectral_line
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import HIGH, K1, K2, SCALE, TAU1, TAU2, THETA1, THETA2
from canid.models.diagnosis.driver.model_averaging import Alternative, Spread, averaged
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.fitting.uncertainty import profiled, sandwich, widened
from canid.models.effects.effect import Detector, Kind
from canid.values.types import NAN, Channel, Interval

# A sandwich from one drive is too narrow, most for delays: a radar and a bus have some of their own, and the split into
# lag and dead time is no parabola. By how much was measured on 188 clean drives of two simulators that are not canid's:
# errors over stated sd are 1.07 (gains) and 1.3 (delays).
GAINS_WIDER, DELAYS_WIDER = 1.1, 1.3
# of a parameter's scale; a lag or dead time that ends nearer to the upper bound than this is at it
BOUND_SCALE_SHARE = 1e-3


def interval(value: float, sd: float, low: float = -np.inf, high: float = np.inf) -> Interval:
    """95 %, within what is possible.

    Example:
        >>> interval(0.5, 0.5, low=0.0)
        Interval(value=0.5, low=0.0, high=1.48)
    """
    return Interval(float(value), float(max(value - SIGMAS * sd, low)), float(min(value + SIGMAS * sd, high)))


def parameters(solved: FittedDriver, data: DriverData) -> dict[str, dict[str, Interval]]:
    """Intervals of every cause's parameters: effect id -> name -> interval."""
    robust = sandwich(solved.fitted, data.output.dt)
    place = {k: i for i, k in enumerate(solved.fitted.free)}
    estimates: dict[str, dict[str, Interval]] = {}
    for effect, where in zip(solved.model.effects, solved.model.where, strict=True):
        estimates[effect.id] = {}
        for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True):
            if k not in place:
                continue
            i = place[k]
            if p.change_point:
                estimates[effect.id][p.name] = local_minima.interval(
                    data, solved, k, float(robust.variance_inflation[i])
                )
                continue
            narrow = interval(solved.q[k], float(np.sqrt(robust.C[i, i])), p.low, p.high)
            # an interval that holds "no effect" although the likelihood has found one is of a curvature that says little
            none = bool(p.typical) and narrow.low <= 0.0 <= narrow.high
            ends = profiled if none else widened
            estimates[effect.id][p.name] = ends(data, solved, k, narrow, float(robust.variance_inflation[i]))
        if effect.kind is Kind.LINE:
            estimates[effect.id] = spectral_line.with_phase_drift(data, solved, where, estimates[effect.id])
    return estimates


def channels(
    solved: FittedDriver, dt: float, data: DriverData | None = None, others: Sequence[Alternative] = ()
) -> Mapping[str, Channel]:
    """The driver's two answers, and which of their parameters may be quoted.

    Args:
        solved: a fit.
        dt: s.
        data: what was fitted; given, the intervals follow the likelihood instead of its curvature.
        others: models with one more effect, that widen the intervals.
    """
    robust = sandwich(solved.fitted, dt)
    place = {k: i for i, k in enumerate(solved.fitted.free)}

    def sd(*these: int) -> float:
        index = [place[k] for k in these]
        return wider(these[0]) * float(np.sqrt(robust.C[np.ix_(index, index)].sum()))

    def spread(*these: int, quoted: bool = False) -> Spread:
        gain = these[0] in (K1, K2)
        low, high = (-np.inf, np.inf) if gain else (0.0, sum(HIGH[k] for k in these))
        narrow = interval(sum(q[k] for k in these), sd(*these), low, high)
        # a profile interval takes several fits: only of what is quoted
        if quoted and data is not None:
            narrow = widened(
                data, solved, these[0], narrow, float(robust.variance_inflation[place[these[0]]])
            )
        return averaged(narrow, sd(*these), others, these, wider(these[0]), low, high)

    q = solved.q
    out = {}
    for name, gain, tau, theta in (("headway_error", K1, TAU1, THETA1), ("range_rate", K2, TAU2, THETA2)):
        K, total = spread(gain, quoted=True), spread(tau, theta)
        free = all(q[k] < HIGH[k] - BOUND_SCALE_SHARE * SCALE[k] for k in (tau, theta))
        status = identifiability.judge(K.interval, K.sd, spread(tau).sd, spread(theta).sd, total.sd, free)
        each = "tau" in identifiability.QUOTABLE[status]
        out[name] = identifiability.channel(
            status,
            K.interval,
            tau=spread(tau, quoted=each).interval,
            dead_time=spread(theta, quoted=each).interval,
            total=total.interval,
        )
    return out


def wider(k: int) -> float:
    """By how much the sandwich of a parameter is too narrow."""
    return GAINS_WIDER if k in (K1, K2) else DELAYS_WIDER


def episode_parameters(named: Named, seconds: float) -> dict[str, Interval]:
    """How often and how long, or at what interval, from the episodes themselves."""
    lengths = np.array([stop - start for start, stop in named.episodes])
    n = len(lengths)
    names = [parameter.name for parameter in named.effect.parameters]
    if Detector.PEDAL_RHYTHM in named.effect.detectors:
        # half a step of the frequency grid to either side
        half = 0.5 * RHYTHM_STEP_HZ * named.level**2
        return {names[0]: Interval(named.level, named.level - half, named.level + half)}
    rate = 60 * n / seconds
    # the standard deviation of a count is its square root; that of a mean is its values' over the root of their number
    wide = SIGMAS * rate / np.sqrt(n)
    mean, sd = float(lengths.mean()), float(lengths.std(ddof=1) / np.sqrt(n)) if n > 1 else NAN
    return {
        names[0]: Interval(rate, max(rate - wide, 0.0), rate + wide),
        names[1]: Interval(mean, mean - SIGMAS * sd, mean + SIGMAS * sd),
    }
