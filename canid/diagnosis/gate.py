"""Does the model leave anything that something could explain? The gate that a named cause must pass.

Whitened residuals are held against families of functions of what the driver saw and did (`families`), against answers
that come and go (`unsteady`), and against signs that are no function of anything measured (`signs`). What the model's own
parameters could still absorb is taken out. A family is tested as a whole and column by column, by scores that hold under
uneven noise (White 1980); one that shows something, once more with the noise's colour fitted anew beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.diagnosis import instead, recoloured, signs, unsteady
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.evidence import spread
from canid.diagnosis.families import Shapes, answers, shapes
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.naming import Search
from canid.diagnosis.recoloured import directions
from canid.diagnosis.solved import Solved
from canid.types import Array

# chance that a drive without a cause fails in any family, and one whose cause is the right one: where something was
# wrong anyway, more may be
FAMILY, NAMED = 0.005, 0.02
# s; the noise's colour that whitening left has died away by then
REACH = 2.0
# of the residual's variance; what is significant but smaller than this is said, and blames nobody
MATERIAL = 0.01
# of what the named causes explained: less than this left behind is a matter of form, not of another cause. A hard dead
# zone fitted to a soft one leaves 3 to 6 %
FORM = 0.1
# Hz; where the answers to a lead have their power
SLOW = 0.05
# directions of a family that are smaller than this share of its largest tell nothing of their own
INDEPENDENT = 0.05
# of a column's length: what the model absorbs but for this is rounding
ABSORBED = 0.1
# what a foot does between two decisions, whose course nobody knows
BETWEEN = ("output rate", "output behind")
# chance below which a family is looked at once more, with the noise's colour fitted anew
AGAIN = 0.1


class Family(NamedTuple):
    """One family's outcome."""

    name: str
    says: str
    p: float  # chance of more than was found
    statistic: float
    dimensions: int
    share: float  # of the residual's variance that it would explain


class Gate(NamedTuple):
    """The gate's outcome."""

    passed: bool
    families: tuple[Family, ...]
    failed: tuple[Family, ...]
    bound: float  # a family's p must not be below
    material: float  # and its share not above this
    share: float  # of the residual's variance, the largest of a failed family


def look(found: Search, original: DriverData, explained: float = 0.0) -> Gate:
    """Hold what a model leaves against every family.

    Args:
        found: what the search ended with.
        original: the drive, with nothing taken out of it.
        explained: variance that its causes took from the residual, over what they left: what they leave behind is
            measured by that, as the smooth form that nature gave a cause never is quite the one that is fitted.
    """
    data, solved = found.data, found.solved
    families = shapes(data, solved)
    told = [*_spanned(families, data, solved), _unsteady(data, solved)]
    told += [
        Family(one.name, one.says, one.p, one.statistic, 1, one.share) for one in signs.look(found, original)
    ]
    other = instead.look(found, families)
    if other is not None:
        told.append(Family("instead of a wander", *other))
    bound = (NAMED if found.named else FAMILY) / len(told)
    # what he decides between two moments is not simulated: what is left holds it
    decides = any(one.effect.id == "act_and_wait" for one in found.named)
    material = max(MATERIAL, FORM * max(explained, float(decides)))
    failed = [
        family
        for family in told
        if family.p < bound and family.share >= material and not (decides and family.name in BETWEEN)
    ]
    share = max((family.share for family in failed), default=0.0)
    return Gate(not failed, tuple(told), tuple(failed), bound, material, share)


def _white(columns: Array, solved: Solved) -> Array:
    """Columns (n, k) as the score weighs them."""
    slope = solved.fitted.scored.slope
    out: Array = np.where(solved.rows[:, None], whitened(solved.noise, columns) * slope[:, None], 0.0)
    return out


def _spanned(families: list[Shapes], data: DriverData, solved: Solved) -> list[Family]:
    """Test every family; those that show something twice."""
    memory = recoloured.remembered(solved)
    Q = qr(np.column_stack([solved.fitted.jacobian, memory]), mode="economic")[0]
    e = solved.fitted.scored.e / np.sqrt(max(_even(solved), 1e-300))
    own: Array | None = None
    plain, out = 0.0, []
    for name, says, columns, _ in families:
        X = _white(columns, solved)
        length = np.linalg.norm(X, axis=0)
        X = X - Q @ (Q.T @ X)
        left = np.linalg.norm(X, axis=0)
        kept = left > np.maximum(ABSORBED * length, 1e-12)
        if not kept.any():
            out.append(Family(name, says, 1.0, 0.0, 0, 0.0))
            continue
        X = X[:, kept] / left[kept]
        _, S, Vt = np.linalg.svd(X, full_matrices=False)
        turn = Vt[INDEPENDENT * S[0] < S].T / S[INDEPENDENT * S[0] < S]
        k = turn.shape[1]
        score = X.T @ e
        tested = _test(score, turn, spread(X * e[:, None], round(REACH / data.output.dt)))
        p, statistic = tested.p, tested.statistic
        if p < AGAIN:
            if own is None:
                own = directions(data, solved)
                plain = recoloured.beside(data, solved, own, memory).deviance
            again = recoloured.beside(data, solved, np.column_stack([own, columns[:, kept] @ turn]), memory)
            won = max(plain - again.deviance, 0.0) / tested.overstated
            p, statistic = min(p, float(chi2.sf(won, k))), max(statistic, won)
        z = turn.T @ score
        # the best of two tests
        share = _share(float(z @ z) - k, data, solved)
        out.append(Family(name, says, min(1.0, 2 * p), statistic, k, share))
    return out


class Scored(NamedTuple):
    """What the score of a family says."""

    p: float  # of the whole, or of its best column, all columns counted
    statistic: float
    overstated: float  # how much wider the score spreads than in even noise, at least 1


def _test(score: Array, turn: Array, each: Array) -> Scored:
    """Test a score of even noise's variance 1.

    Args:
        score: (m,) of columns of unit length.
        turn: (m, k) columns -> independent directions.
        each: (m, m) how the score spreads.
    """
    # the larger of both spreads in each direction: neither few blocks nor an even noise may make a finding
    alone = score**2 / np.maximum(np.diag(each), 1.0)
    best = min(1.0, score.size * float(chi2.sf(float(alone.max()), 1)))
    values, vectors = np.linalg.eigh(turn.T @ each @ turn)
    statistic = float(np.sum((vectors.T @ (turn.T @ score)) ** 2 / np.maximum(values, 1.0)))
    overstated = max(float(values.mean()), 1.0)
    return Scored(min(best, float(chi2.sf(statistic, turn.shape[1]))), statistic, overstated)


def _even(solved: Solved) -> float:
    scored = solved.fitted.scored
    return float(scored.e @ scored.e) / max(scored.free, 1)


def _unsteady(data: DriverData, solved: Solved) -> Family:
    """Answers that come and go."""
    scored = solved.fitted.scored
    seen = {name: _white(x[:, None], solved)[:, 0] for name, x in answers(data, solved).items()}
    found = unsteady.look(seen, scored.e, solved.rows & (scored.slope == -1.0), data.output.dt)
    says = f"answers that come and go ({found.answer})" if found.answer else "answers that come and go"
    return Family("unsteady", says, found.p, found.score, 1, _share(found.gain, data, solved))


def _share(gain: float, data: DriverData, solved: Solved) -> float:
    """Share of the residual's variance that a gain in twice the log likelihood is worth.

    What a slow structure with variance s explains of a noise with spectrum S is T·s/S (DESIGN, measured fact 9).
    """
    n = max(solved.fitted.scored.free, 1)
    residual = (data.output.y - solved.fitted.model)[solved.rows & ~data.output.hidden]
    A = solved.noise.A
    turn = np.exp(-2j * np.pi * SLOW * data.output.dt * np.arange(A.size))
    spectrum = solved.noise.sd**2 / float(abs(A @ turn) ** 2)
    ratio = max(gain, 0.0) / n * spectrum / max(float(np.var(residual)), 1e-12)
    return float(ratio / (1 + ratio))
