"""Score tests of a response to relative speed that is no straight line, summed over the windows of a drive.

A window of a minute shows little of a bend. Its score and information (Rao 1948) are summed over windows that do not
overlap, each with gains, offset, lags and dead times of its own projected out, so that a driver who slowly changes is no
bend. With a normal prior of its strength each bend is a model of the driver with another gain (Kass & Raftery 1995), and so
is a response to the lead's acceleration (`lead_anticipation.py`). As in `identify`
(models/diagnosis/causes_not_excluded.py), the interval of K is widened until it holds by all these models, and a K that they
put outside of its own interval is not quoted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.estimators.step_watch import Window
from canid.mathematics.identification import lead_anticipation
from canid.mathematics.identification.fopdt import answer_columns
from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.identifiability import quotable
from canid.values.state_constraints import FINITE, TIME
from canid.values.types import NAN, TASK_INPUTS, Array, OtherGain

# s after which what was seen of a bend has faded to 1/e: habits change over minutes (Chen & Ulsoy 2001)
MEMORY_S = 600.0
# share of a window that must be usable, and in which the lead's speed must be known
USABLE_SHARE = 0.75
# m/s; slower relative motion is not seen at usual gaps (Todosiev 1963; Wiedemann 1974)
ZONE_MPS = 0.8
# m; the gap that K refers to where it depends on the gap, as in models/effects/driver/looming_gain.py
GAP_M = 30.0
MIN_GAP_M = 2.0  # m; nobody follows closer


# range rate (n,) m/s and gap (n,) m -> what a bend with a strength of one adds to the range rate, m/s: a dead zone, a
# straight line within; different answers to a closing and an opening gap (Newell 1965; Ahmed 1999); and an answer that
# grows with nearness, as a power of it to first order (Gazis, Herman & Rothery 1961)
BENDS: tuple[Callable[[Array, Array], Array], ...] = (
    lambda rate, gap: -np.clip(rate, -ZONE_MPS, ZONE_MPS),
    lambda rate, gap: -np.abs(rate),
    lambda rate, gap: rate * np.log(GAP_M / np.maximum(gap, MIN_GAP_M)),
)
# standard deviations of their strengths before the drive, as in the literature
TYPICAL = (0.7, 0.3, 0.7)
# whose gain is a power of what they depend on
POWER = np.array([False, False, True])
# of each bend against none, before the drive: as of a cause in `identify`, where a catalogue of forty causes together is as
# likely as none. More would widen the gain of a driver whose gap hardly changes, of whom it cannot be known at other gaps.
PRIOR_ODDS = 1.0 / 40.0
# of a response to the lead's acceleration: lamps are made to be answered. Of quoted gains of ten drives with it 39 of 48
# hold, with 1/40 34 of 58; the intervals of ten drives without it are the same
AHEAD_ODDS = 1.0 / 4.0


class Evidence(NamedTuple):
    """What the windows until a time have shown."""

    # (bends, 3) score and information, summed, and by how much less K is for a strength of one in the last window, over K
    sums: Annotated[Array, FINITE] = np.zeros((len(BENDS), 3))
    # (t, 4) as of `lead_anticipation.compare`: the likelihood summed, the others of the last window; 0: not compared
    ahead: Annotated[Array, FINITE] = np.zeros((len(lead_anticipation.PRIOR), 4))
    until: Annotated[float, TIME] = NAN  # s, of the last row


def learn(evidence: Evidence, fit: ProcessFit, window: Window, seen: Array) -> Evidence:
    """Take in what a window would make of each cause, and once all of its rows are new, what it shows of one.

    Args:
        evidence: so far.
        fit: of the window, as reported.
        window: its rows.
        seen: (2, k + n) gap in m and speed of the lead in m/s at the rows, and before them; NaN = not measured.
    """
    at = answer_columns.reference(fit)
    if window.names != TASK_INPUTS["car_following"] or at is None or not quotable(fit.channels[1], "K"):
        return evidence
    raw, usable = answer_columns.raw(window.layout, window.rows, at)
    made = answer_columns.whitened(window.layout, raw, usable, at, window.output_filter)
    if made is None:
        return evidence
    rate, step = np.nan_to_num(window.rows[:, 3]), window.layout.step
    # at this gap nothing depends on it
    gap, speed = np.nan_to_num(seen[0, -len(rate) :], nan=GAP_M), seen[1]
    delays = at.tau[1:], at.dead_time[1:]
    bends = np.vstack([lead_anticipation.answers(added(rate, gap), *delays, step) for added in BENDS])
    columns = np.vstack([at.K[1] * bends * usable, raw])
    values, _ = answer_columns.white(columns, usable, at, window.output_filter, step)
    sums, until = _scores(made, values[: len(BENDS)], float(at.K[1])), window.t
    ahead = np.zeros_like(Evidence().ahead)
    if np.isfinite(speed).mean() >= USABLE_SHARE:
        accel = lead_anticipation.acceleration_ahead(speed, step)
        ahead = lead_anticipation.compare(window.layout, window.rows, at, made, accel, window.output_filter)
    usable_s = float(usable.sum()) * step
    if window.time_of(0) <= evidence.until or usable_s < USABLE_SHARE * window.seconds:
        sums[:, :2], ahead[:, 0], until = evidence.sums[:, :2], evidence.ahead[:, 0], evidence.until
    elif evidence.until == evidence.until:
        faded = math.exp((evidence.until - until) / MEMORY_S)
        sums[:, :2] += faded * evidence.sums[:, :2]
        ahead[:, 0] += faded * evidence.ahead[:, 0]
    sums.setflags(write=False)
    ahead.setflags(write=False)
    return Evidence(sums, ahead, until)


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


def others(evidence: Evidence) -> tuple[OtherGain, ...]:
    """Gains of relative speed of drivers with one of the causes.

    Args:
        evidence: of the drive so far.

    >>> zone = np.array([[60.0, 64.0, -0.4], *np.zeros((2, 3))])  # 7.5 sd from none: with it K is 36 % larger
    >>> [round(other.gain, 2) for other in others(Evidence(zone))], others(Evidence())
    ([1.36], ())
    """
    some = evidence.sums[:, 1] > 0.0
    score, information, relative = evidence.sums[some].T
    prior = np.array(TYPICAL)[some] ** -2.0
    precision = information + prior
    odds = np.exp(np.minimum(0.5 * score**2 / precision, 50.0)) * np.sqrt(prior / precision) * PRIOR_ODDS
    change = -relative * score / precision
    gain = np.where(POWER[some], np.exp(change), 1.0 + change)
    sd = np.abs(relative) / np.sqrt(precision) * np.where(POWER[some], gain, 1.0)
    some = evidence.ahead[:, 2] != 0.0
    likelihood, delays, gain_ahead, sd_ahead = evidence.ahead[some].T
    ahead = np.exp(np.clip(likelihood + delays, -50.0, 50.0)) * lead_anticipation.PRIOR[some] * AHEAD_ODDS
    columns = np.r_[odds, ahead], np.r_[gain, gain_ahead], np.r_[sd, sd_ahead]
    return tuple(OtherGain(*row) for row in np.column_stack(columns).tolist())
