"""Score tests of a response to relative speed that is no straight line, summed over the windows of a drive.

A window of a minute shows little of a bend. Its score and information (Rao 1948) are summed over windows that do not
overlap, each with gains, offset, lags and dead times of its own projected out, so that a driver who slowly changes is no
bend. With a normal prior of its strength each bend is a model of the driver with another gain (Kass & Raftery 1995). As in
`identify` (models/diagnosis/causes_not_excluded.py), the interval of K is widened until it holds by all these models, and a
K that they put outside of its own interval is not quoted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.estimators import agreement, plausibility
from canid.mathematics.estimators.step_watch import Window
from canid.mathematics.identification import first_order
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt import answer_columns, gain_step
from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.identifiability import quotable, with_gain
from canid.values.state_constraints import FINITE, TIME
from canid.values.types import NAN, TASK_INPUTS, Array, Channel, Estimate, Interval

# s after which what was seen of a bend has faded to 1/e: habits change over minutes (Chen & Ulsoy 2001)
MEMORY_S = 600.0
# share of a window that must be usable
USABLE_SHARE = 0.75
# m/s; slower relative motion is not seen at usual gaps (Todosiev 1963; Wiedemann 1974)
ZONE_MPS = 0.8
# of each bend against none, before the drive: as of a cause in `identify`, where a catalogue of forty causes together is as
# likely as none
PRIOR_ODDS = 1.0 / 40.0


# range rate (n,) -> what a bend with a strength of one adds to it, m/s: a dead zone, a straight line within; and different
# answers to a closing and an opening gap (Newell 1965; Ahmed 1999)
BENDS: tuple[Callable[[Array], Array], ...] = (
    lambda rate: -np.clip(rate, -ZONE_MPS, ZONE_MPS),
    lambda rate: -np.abs(rate),
)
# standard deviations of their strengths before the drive, as in the literature
TYPICAL = (0.7, 0.3)


class Evidence(NamedTuple):
    """What the windows until a time have shown."""

    # (bends, 3) score and information, summed, and by how much less K is for a strength of one in the last window, over K
    sums: Annotated[Array, FINITE] = np.zeros((len(BENDS), 3))
    until: Annotated[float, TIME] = NAN  # s, of the last row


def learn(evidence: Evidence, fit: ProcessFit, window: Window) -> Evidence:
    """Take in what a window would make of a bend, and once all of its rows are new, what it shows of one.

    Args:
        evidence: so far.
        fit: of the window, as reported.
        window: its rows.
    """
    at = answer_columns.reference(fit)
    if window.names != TASK_INPUTS["car_following"] or at is None or not quotable(fit.channels[1], "K"):
        return evidence
    raw, usable = answer_columns.raw(window.layout, window.rows, at)
    made = answer_columns.whitened(window.layout, raw, usable, at, window.output_filter)
    if made is None:
        return evidence
    rate = np.nan_to_num(window.rows[:, 3])
    tau, dead_time = at.tau[1] / window.layout.step, at.dead_time[1] / window.layout.step
    bends = np.array([at.K[1] * _answer(added(rate), tau, dead_time) for added in BENDS])
    columns = np.vstack([bends * usable, raw])
    values, _ = answer_columns.white(columns, usable, at, window.output_filter, window.layout.step)
    sums, until = _scores(made, values[: len(BENDS)], float(at.K[1])), window.t
    usable_s = float(usable.sum()) * window.layout.step
    if window.time_of(0) <= evidence.until or usable_s < USABLE_SHARE * window.seconds:
        sums[:, :2], until = evidence.sums[:, :2], evidence.until
    elif evidence.until == evidence.until:
        sums[:, :2] += math.exp((evidence.until - until) / MEMORY_S) * evidence.sums[:, :2]
    sums.setflags(write=False)
    return Evidence(sums, until)


def _answer(u: Array, tau: float, dead_time: float) -> Array:
    """Answer (n,) of first order and unit gain after a dead time, both in rows."""
    alpha = math.exp(-1.0 / tau)
    middle = 0.5 * (u + np.r_[u[0], u[:-1]]) - u[0]
    answer = u[0] + first_order.scan((1.0 - alpha) * middle, np.array([alpha]))
    return np.asarray(np.interp(np.arange(len(u)) - dead_time, np.arange(len(u)), answer), float)


def _scores(made: Columns, bends: Array, gain: float) -> Array:
    """Scores (k, 3), as in `Evidence.sums`, of whitened columns (k, n) with the others projected out."""
    X, both = made.values[:-1], np.vstack([bends, made.values[-1]])
    weighted = X * made.weight
    G = weighted @ X.T
    G.flat[:: len(G) + 1] += made.precision + 1e-9 * (np.diag(G) + 1e-300)
    by = np.linalg.solve(G, weighted @ both.T)  # (c, k + 1)
    left = both - by.T @ X
    products = (left[:-1] * made.weight) @ left.T
    return np.column_stack([products[:, -1], np.diag(products), by[1, :-1] / gain])


def judged(evidence: Evidence, made: Estimate) -> Estimate:
    """Widen K of relative speed by the bends that the drive does not exclude, or withhold it.

    Args:
        evidence: of the drive so far.
        made: of a window.

    >>> from canid.values.types import Identifiable, Status
    >>> known = {"range_rate": Channel(Interval(4.0, 3.6, 4.4), status=Identifiable.GAIN_ONLY)}
    >>> made = Estimate(60.0, "fopdt", Status.OK, "range rate: K only", known)
    >>> judged(Evidence(), made) == made
    True
    >>> zone = np.array([[60.0, 64.0, -0.4], [0.0, 0.0, 0.0]])  # 7.5 sd from none: with it K is 38 % larger
    >>> judged(Evidence(zone), made).says.partition(":")[0]
    'K of range rate is probably an average over a cause that the model does not have'
    """
    name = TASK_INPUTS["car_following"][1]
    channel, some = made.channels.get(name, Channel()), evidence.sums[:, 1] > 0.0
    if not some.any() or not quotable(channel, "K"):
        return made
    score, information, relative = evidence.sums[some].T
    prior = np.array(TYPICAL)[some] ** -2.0
    precision = information + prior
    odds = np.exp(np.minimum(0.5 * score**2 / precision, 50.0)) * np.sqrt(prior / precision) * PRIOR_ODDS
    weights = np.r_[1.0, odds] / (1.0 + odds.sum())
    K = channel.K
    sd = (K.high - K.low) / (2.0 * NORMAL_QUANTILE)
    values = np.r_[K.value, K.value * (1.0 - relative * score / precision)]
    sds = np.r_[sd, np.hypot(sd, K.value * relative / np.sqrt(precision))]
    models = [NormalDist(m, s) for m, s in zip(values, sds, strict=True)]
    outside = np.array([0.0, *(1.0 - model.cdf(K.high) + model.cdf(K.low) for model in models[1:])])
    if float(weights @ outside) >= plausibility.OUTSIDE:
        return agreement.without_gains(made, {name: plausibility.average_over_cause(name)})
    wide = gain_step.mixture(values, sds, weights)
    widened = with_gain(channel, Interval(K.value, min(K.low, wide.low), max(K.high, wide.high)))
    return made._replace(channels={**made.channels, name: widened})
