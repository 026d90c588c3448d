"""Score tests of a response to relative speed that is no straight line, over the windows of a drive.

A window of a minute shows little of a bend. Inner products of the columns of windows that do not overlap are summed, each
window with offset, lags and dead times of its own projected out, and with gains that differ between windows as habits do.
From these follow score and information (Rao 1948) of each bend, and the gains with it. With a normal prior of its strength
each bend is a model of the driver with other gains (Kass & Raftery 1995), and so is a response to the lead's acceleration
(`lead_anticipation.py`). As in `identify` (models/diagnosis/causes_not_excluded.py), the interval of K is widened until it
holds by all these models, and a K that they put outside of its own interval is not quoted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.estimators.step_watch import Window
from canid.mathematics.identification import lead_anticipation
from canid.mathematics.identification.fopdt import answer_columns
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
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
TYPICAL = np.array([0.7, 0.3, 0.7])
# whose gain is a power of what they depend on
POWER = np.array([False, False, True])
# of each bend against none, before the drive: as of a cause in `identify`, where a catalogue of forty causes together is as
# likely as none. More would widen the gain of a driver whose gap hardly changes, of whom it cannot be known at other gaps.
PRIOR_ODDS = 1.0 / 40.0
# of a response to the lead's acceleration: lamps are made to be answered. Of quoted gains of ten drives with it 39 of 48
# hold, with 1/40 34 of 58; the intervals of ten drives without it are the same
AHEAD_ODDS = 1.0 / 4.0
# share of a gain by which habits change it between minutes: without it a driver who changes is taken for a bend
HABIT = 0.2


class Evidence(NamedTuple):
    """What the windows until a time have shown."""

    # (c, c) inner products of both answers, bends and output, summed
    products: Annotated[Array, FINITE] = np.zeros((3 + len(BENDS), 3 + len(BENDS)))
    # (2, bends) by how much less each K is for a strength of one in the last window, over K
    last: Annotated[Array, FINITE] = np.zeros((2, len(BENDS)))
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
    (products, last), until = _products(made, values[: len(BENDS)], at), window.t
    ahead = np.zeros_like(Evidence().ahead)
    if np.isfinite(speed).mean() >= USABLE_SHARE:
        accel = lead_anticipation.acceleration_ahead(speed, step)
        ahead = lead_anticipation.compare(window.layout, window.rows, at, made, accel, window.output_filter)
    usable_s = float(usable.sum()) * step
    if window.time_of(0) <= evidence.until or usable_s < USABLE_SHARE * window.seconds:
        products, ahead[:, 0], until = evidence.products, evidence.ahead[:, 0], evidence.until
    elif evidence.until == evidence.until:
        faded = math.exp((evidence.until - until) / MEMORY_S)
        products += faded * evidence.products
        ahead[:, 0] += faded * evidence.ahead[:, 0]
    for each in (products, last, ahead):
        each.setflags(write=False)
    return Evidence(products, last, ahead, until)


def _products(made: Columns, bends: Array, at: Reference) -> tuple[Array, Array]:
    """`products` and `last` of `Evidence`, of a window's whitened columns and bends (k, n)."""
    every = np.vstack([made.values[:2], bends, made.values[-1], made.values[2:-1]])
    n = 3 + len(bends)
    G = _without((every * made.weight) @ every.T, slice(n, None), made.precision[2:])[:n, :n]
    last = np.linalg.solve(_regular(G[:2, :2]), G[:2, 2:-1]) / at.K[:, None]
    return _without(G, slice(0, 2), (HABIT * at.size) ** -2.0), last


def _regular(G: Array) -> Array:
    return G + np.diag(1e-9 * np.diag(G) + 1e-12)


def _without(G: Array, out: slice, precision: Array) -> Array:
    """Take columns out of inner products, as far as a normal prior of their coefficients lets these vary."""
    of_both = _regular(G[out, out]) + np.diag(precision)
    return np.asarray(G - G[:, out] @ np.linalg.solve(of_both, G[out]), float)


def others(evidence: Evidence) -> dict[str, tuple[OtherGain, ...]]:
    """Gains of drivers with one of the causes, by input.

    Args:
        evidence: of the drive so far.

    >>> S = np.diag([100.0, 100.0, 80.0, 0.0, 0.0, 0.0])  # of headway, range rate, a dead zone and the output
    >>> S[1, 2], S[1, 5], S[2, 5] = -40.0, 100.0, 20.0  # with a strength of 0.92 K is 36 % larger
    >>> found = others(Evidence(np.triu(S) + np.triu(S, 1).T))["range_rate"][0]
    >>> round(found.drive_gain, 2), others(Evidence())
    (1.36, {})
    """
    S, some, out = evidence.products, evidence.ahead[:, 2] != 0.0, {}
    likelihood, delays, *ahead = evidence.ahead[some].T
    odds = np.exp(np.clip(likelihood + delays, -50.0, 50.0)) * lead_anticipation.PRIOR[some] * AHEAD_ODDS
    of_lead = np.column_stack([odds, *ahead, *ahead])
    by = np.linalg.solve(_regular(S[:2, :2]), S[:2, 2:])
    left = S[2:, 2:] - S[2:, :2] @ by
    score, precision = left[:-1, -1], np.diag(left)[:-1] + TYPICAL**-2.0
    odds = np.exp(np.minimum(0.5 * score**2 / precision, 50.0)) / (TYPICAL * np.sqrt(precision)) * PRIOR_ODDS
    for i, name in enumerate(TASK_INPUTS["car_following"]):
        columns = [odds]
        for relative in (evidence.last[i], by[i, :-1] / (by[i, -1] or 1.0)):
            change, power = -relative * score / precision, POWER & (i == 1)
            gain = np.where(power, np.exp(np.where(power, change, 0.0)), 1.0 + change)
            columns += [gain, np.abs(relative) / np.sqrt(precision) * np.where(power, gain, 1.0)]
        bends = np.column_stack(columns)[: S.any() * len(odds)]
        rows = np.vstack([bends, of_lead[: i * len(of_lead)]])
        out[name] = tuple(OtherGain(*row) for row in rows.tolist())
    return {name: models for name, models in out.items() if models}
