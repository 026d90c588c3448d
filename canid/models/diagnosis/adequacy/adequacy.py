"""Adequacy of a fitted driver: score tests of the residual against alternatives that are not in the catalogue.

Whitened residuals are tested against families of functions of the driver's inputs and outputs (`alternatives`), against
answers that come and go (`intermittent_gain`), and for patterns that are no function of anything measured
(`unnamed_patterns`). What the model's own parameters could still absorb is projected out. A family is tested as a whole
and column by column, by scores that are robust to heteroskedastic noise (White 1980). A family that stands out is tested
once more with the noise model refitted together with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.models.diagnosis.adequacy import (
    held_perception,
    intermittent_gain,
    refit_noise,
    unnamed_patterns,
)
from canid.models.diagnosis.adequacy.alternatives import Shapes, answers, shapes
from canid.models.diagnosis.adequacy.refit_noise import directions
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, K2, TAU1, TAU2, parts
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.model import Columns
from canid.models.diagnosis.fitting.score_test import independent, score_test
from canid.values.types import Array

# probability that a drive without a cause fails in any family, and that a drive with the right cause named does
FAMILY_CHANCE, NAMED_CHANCE = 0.005, 0.02
# s; the autocorrelation that whitening left has died away by then
WHITENED_SCORE_LAG_S = 2.0
# of the residual's variance; what is significant but smaller is reported and does not fail
MATERIAL_RESIDUAL_SHARE = 0.01
# of what the named causes explained: less than this is left by the exact form of a cause, not by another cause. A hard
# dead zone fitted to a soft one leaves 3 to 6 %
LEFT_BEHIND_SHARE = 0.1
# Hz; where the answers to a lead have their power
ANSWER_HZ = 0.05
# of a column's length; a smaller remainder after the projection is rounding
ABSORBED_SHARE = 0.1
# families of the pedal's movement between two decisions, which an intermittent driver leaves unmodelled
DECISION_FAMILIES = ("output rate", "output behind")
# p below which a family is tested once more, with the noise model refitted
REFIT_CHANCE = 0.1


class Family(NamedTuple):
    """One family's outcome."""

    name: str
    says: str
    p: float  # chance of more than was found
    statistic: float
    dimensions: int
    share: float  # of the residual's variance that it would explain


class Adequacy(NamedTuple):
    """Outcome of all tests."""

    passed: bool
    families: tuple[Family, ...]
    failed: tuple[Family, ...]
    bound: float  # a family's p must not be below
    material: float  # and its share not above this
    share: float  # of the residual's variance, the largest of a failed family


def assess(
    search: Search, original: DriverData, explained: float = 0.0, *, material_alone: bool = False
) -> Adequacy:
    """Test what a model leaves against every family.

    Args:
        search: what the search ended with.
        original: the drive, with nothing taken out of it.
        explained: variance that its causes took from the residual, over what they left. The remainder is compared with
            that, because the true form of a cause never is exactly the one that is fitted.
        material_alone: of families that are too small to fail no p is read: they are not tested twice.
    """
    data, solved = search.data, search.solved
    # movements between two decisions are not simulated and stay in the residual
    decides = any(named.effect.intermittent for named in search.named)
    material = max(MATERIAL_RESIDUAL_SHARE, LEFT_BEHIND_SHARE * max(explained, float(decides)))
    by_columns = spanned(shapes(data, solved), data, solved, material if material_alone else 0.0)
    families_tested = [*by_columns, _unsteady(data, solved), _held(data, solved)]
    families_tested += [
        Family(pattern.name, pattern.says, pattern.p, pattern.statistic, 1, pattern.share)
        for pattern in unnamed_patterns.detect(search, original)
    ]
    bound = (NAMED_CHANCE if search.named else FAMILY_CHANCE) / len(families_tested)
    failed = [
        family
        for family in families_tested
        if family.p < bound
        and family.share >= material
        and not (decides and family.name in DECISION_FAMILIES)
    ]
    share = max((family.share for family in failed), default=0.0)
    return Adequacy(not failed, tuple(families_tested), tuple(failed), bound, material, share)


def _white(columns: Array, solved: FittedModel[M]) -> Array:
    """Columns (n, k) as the score weighs them."""
    slope = solved.fitted.scored.slope
    out: Array = np.where(solved.rows[:, None], whitened(solved.noise, columns) * slope[:, None], 0.0)
    return out


def spanned(
    families: list[Shapes], data: Columns, solved: FittedModel[M], material: float = 0.0
) -> list[Family]:
    """Test every family; those that show something, and a share of the residual as large as `material`, twice."""
    memory = refit_noise.noise_memory(solved)
    J = solved.fitted.jacobian
    Q = np.column_stack([memory, qr(J - memory @ (memory.T @ J), mode="economic")[0]])
    e = solved.fitted.scored.e / np.sqrt(max(_even(solved), 1e-300))
    model_directions: Array | None = None
    plain, out = 0.0, []
    for name, says, columns in families:
        X = _white(columns, solved)
        length = np.linalg.norm(X, axis=0)
        X = X - Q @ (Q.T @ X)
        left = np.linalg.norm(X, axis=0)
        kept = left > np.maximum(ABSORBED_SHARE * length, 1e-12)
        if not kept.any():
            out.append(Family(name, says, 1.0, 0.0, 0, 0.0))
            continue
        X = X[:, kept] / left[kept]
        turn = independent(X)
        k = turn.shape[1]
        tested = score_test(X, turn, e, round(WHITENED_SCORE_LAG_S / data.output.dt))
        p, statistic = min(tested.best, tested.p), tested.statistic
        share = _share(tested.gain - k, data, solved)
        if p < REFIT_CHANCE and share >= material:
            if model_directions is None:
                model_directions = directions(data, solved)
                plain = refit_noise.refit(data, solved, model_directions, memory).deviance
            again = refit_noise.refit(
                data, solved, np.column_stack([model_directions, columns[:, kept] @ turn]), memory
            )
            won = max(plain - again.deviance, 0.0) / tested.variance_inflation
            p, statistic = min(p, float(chi2.sf(won, k))), max(statistic, won)
        # the best of two tests
        out.append(Family(name, says, min(1.0, 2 * p), statistic, k, share))
    return out


def _even(solved: FittedModel[M]) -> float:
    scored = solved.fitted.scored
    return float(scored.e @ scored.e) / max(scored.free, 1)


def _unsteady(data: DriverData, solved: FittedDriver) -> Family:
    """Answers that come and go."""
    scored = solved.fitted.scored
    seen = {name: _white(x[:, None], solved)[:, 0] for name, x in answers(data, solved).items()}
    intermittent = intermittent_gain.detect(
        seen, scored.e, solved.rows & (scored.slope == -1.0), data.output.dt
    )
    says = (
        f"answers that come and go ({intermittent.answer})"
        if intermittent.answer
        else "answers that come and go"
    )
    return Family(
        "unsteady", says, intermittent.p, intermittent.score, 1, _share(intermittent.gain, data, solved)
    )


def _held(data: DriverData, solved: FittedDriver) -> Family:
    """Answers to what was seen some seconds before."""
    q, scored = solved.q, solved.fitted.scored
    acted = parts(solved.model, data, q)
    responses = [
        held_perception.Response(acted.e, float(q[K1]), float(q[TAU1])),
        held_perception.Response(acted.w, float(q[K2]), float(q[TAU2])),
    ]
    rows = solved.rows & (scored.slope == -1.0)
    evidence = held_perception.log_evidence(responses, scored.e, rows, solved.noise, data.output.dt)
    says = "answers to what was seen some seconds before, now and then"
    p, gain = float(np.exp(-max(evidence, 0.0))), 2.0 * max(evidence, 0.0)
    return Family("held", says, p, gain, 1, _share(gain, data, solved))


def _share(gain: float, data: Columns, solved: FittedModel[M]) -> float:
    """Share of the residual's variance that a gain in twice the log likelihood is worth.

    What a slow structure with variance s explains of a noise with spectrum S is T·s/S (DESIGN, measured fact 9).
    """
    n = max(solved.fitted.scored.free, 1)
    residual = (data.output.y - solved.fitted.model)[solved.rows & ~data.output.hidden]
    A = solved.noise.A
    turn = np.exp(-2j * np.pi * ANSWER_HZ * data.output.dt * np.arange(A.size))
    spectrum = solved.noise.sd**2 / float(abs(A @ turn) ** 2)
    ratio = max(gain, 0.0) / n * spectrum / max(float(np.var(residual)), 1e-12)
    return float(ratio / (1 + ratio))
