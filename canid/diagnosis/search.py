"""Which cause explains most, one after another: screened along its direction, then fitted in full."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.diagnosis import moment
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import (
    DESIRED,
    K1,
    K2,
    OFFSET,
    TAU1,
    TAU2,
    THETA2,
    DriverModel,
    lagged,
    parts,
    pedal,
    with_effects,
)
from canid.diagnosis.evidence import inflation
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.solved import Solved, polished, solve
from canid.effects.cause import Effect
from canid.types import Array

# quantiles of the headway at which a desired one is tried, where a cause makes it visible: who tolerates too much of it
# drives at the edge of what he tolerates
DESIRED_AT = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98)
# a candidate whose direction explains less than this is not fitted: a full fit finds a little more than its
# direction at a start, but not four times as much
WORTH = 3.0
# at most so many candidates are fitted in full per step
FITTED = 9
# and from so many starts where the cost has several valleys
BEGINS = 2
# evidence from which on a candidate may win, and its fit is looked at twice
POLISHED = 8.0
# of the best one's evidence, that another must have to come first by a second look
PART = 0.4
# s by which a dead time may have come out too short
AHEAD = (0.15, 0.35, 0.7)


class Candidate(NamedTuple):
    """One cause added to a model."""

    effect: Effect
    solved: Solved
    evidence: float  # 2 Δ log likelihood over the model without it, robust
    parameters: int  # that it added


class Start(NamedTuple):
    """Where a candidate's fit begins, and what its direction explains there."""

    q: Array
    explains: float


def starts(effect: Effect, data: DriverData, without: Solved) -> Iterator[Array]:
    """Parameters at which a cause may begin: the model without it, and the cause's own."""
    free = data.output.usable & ~data.output.below
    base = without.q
    own = [parameter.starts or _found(effect.id, parameter.name, data) for parameter in effect.parameters]
    desired = (
        [float(x) for x in np.quantile(data.seen.headway[free], DESIRED_AT)]
        if effect.centred and not without.model.centred
        else [float(base[DESIRED])]
    )
    for headway, values in product(desired, product(*own)):
        q = np.r_[base, values]
        q[OFFSET] += q[K1] * (headway - q[DESIRED])
        q[DESIRED] = headway
        yield q


def led(without: Solved, by: float) -> Array:
    """Begin where the dead time was `by` s longer, and a cause with one gain has made up for it."""
    q: Array = np.r_[without.q, by * without.q[K2]]
    q[THETA2] += by
    return q


def _found(effect: str, parameter: str, data: DriverData) -> tuple[float, ...]:
    """Starts that only the drive itself can tell."""
    free = data.output.usable & ~data.output.below
    if (effect, parameter) == ("gain_change", "time"):
        return tuple(float(x) for x in np.linspace(0.1, 0.9, 9) * data.seen.drive)
    if (effect, parameter) == ("comfort_speed", "speed"):
        return tuple(float(x) for x in np.quantile(data.seen.speed[free], (0.3, 0.5, 0.7, 0.85)))
    if (effect, parameter) == ("pedal_ceiling", "level"):
        return tuple(float(x) for x in np.quantile(data.output.y[free], (0.7, 0.85, 0.94, 0.98)))
    raise ValueError(f"{effect}.{parameter} has no starts")


def screen(effect: Effect, data: DriverData, without: Solved) -> list[Start]:
    """Price every start by what its direction explains of the residual, the model's own directions taken out.

    A start far from the model without it is priced by its gains, fitted anew, as well: a direction is the first step only.
    """
    model = with_effects((*without.model.effects, effect))
    Q = qr(without.fitted.jacobian, mode="economic")[0]
    e = without.fitted.scored.e
    slope = without.fitted.scored.slope
    out = []
    for q in starts(effect, data, without):
        d = whitened(without.noise, pedal(model, data, q) - without.fitted.model) * slope
        d = d - Q @ (Q.T @ d)
        size = float(d @ d)
        along = float(d @ e)
        # −e·d is how far along the direction the residual lies; a start of the wrong sign explains nothing
        out.append(Start(q, along * along / size if size > 1e-9 and along < 0 else 0.0))
        if all(each.foot is None for each in model.effects):
            out.append(regained(model, data, without, q))
    return sorted(out, key=lambda start: -start.explains)


def regained(model: DriverModel, data: DriverData, without: Solved, q: Array) -> Start:
    """Fit offset and both gains anew, everything else held: they are linear."""
    dt, noise = data.output.dt, without.noise
    of = parts(model, data, q)
    first = lagged(of.gain * of.e, float(q[TAU1]), dt)
    second = lagged(of.gain * of.w, float(q[TAU2]), dt)
    beside = lagged(of.extra + np.zeros_like(first), float(q[TAU2]), dt)
    rows = without.fitted.scored.slope == -1.0
    X = whitened(noise, np.stack([np.ones_like(first), first, second], axis=1))[rows]
    y = whitened(noise, data.output.y - beside)[rows]
    gains = np.linalg.lstsq(X, y, rcond=None)[0]
    left, before = y - X @ gains, without.fitted.scored.e[rows]
    q = q.copy()
    q[[OFFSET, K1, K2]] = np.clip(gains, model.low[[OFFSET, K1, K2]], model.high[[OFFSET, K1, K2]])
    return Start(q, max(float(before @ before - left @ left), 0.0))


def tried(effect: Effect, data: DriverData, without: Solved, begins: list[Start]) -> Candidate:
    """Fit a candidate in full, from its best starts."""
    best: Solved | None = None
    some = [start.q for start in begins[: BEGINS if effect.centred else 1]]
    for q in [*some, *(led(without, by) for by in AHEAD if effect.leads)]:
        solved = solve(data, (*without.model.effects, effect), q, without.noise, without.rows)
        if best is None or solved.deviance < best.deviance:
            best = solved
    assert best is not None
    return priced_in(effect, moment.settled(data, best), without, data.output.dt)


def priced_in(effect: Effect, solved: Solved, without: Solved, dt: float) -> Candidate:
    """Tell the evidence of any cause of a model."""
    where = solved.model.where[[e.id for e in solved.model.effects].index(effect.id)]
    gained = max(without.deviance - solved.deviance, 0.0)
    added = len(solved.fitted.free) - len(without.fitted.free)
    moved = [k for k in range(where.start, where.stop) if k in solved.fitted.free]
    return Candidate(effect, solved, gained / (inflation(solved, moved, dt) if moved else 1.0), added)


def candidates(effects: tuple[Effect, ...], data: DriverData, without: Solved) -> list[Candidate]:
    """Try every cause that is not in the model yet; best first."""
    have = {effect.id for effect in without.model.effects}
    screened = [
        (effect, screen(effect, data, without))
        for effect in effects
        if effect.kind == "curve" and effect.id not in have
    ]
    screened.sort(key=lambda pair: (-pair[0].leads, -pair[1][0].explains))
    # along its direction nothing is left of a cause that a dead time has taken up
    worth = [pair for pair in screened if pair[1][0].explains > WORTH or pair[0].leads][:FITTED]
    found = [tried(effect, data, without, begins) for effect, begins in worth]
    least = max(POLISHED, PART * max((one.evidence for one in found), default=0.0))
    return [
        priced_in(one.effect, polished(data, one.solved), without, data.output.dt)
        if one.evidence > least
        else one
        for one in found
    ]
