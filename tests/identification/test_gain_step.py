"""A step of the gains: the Bayes factors are those of textbook regressions, and as rare under no step as they promise."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from canid.mathematics.identification.fopdt import drifting_level, gain_segments, gain_step
from canid.mathematics.identification.fopdt.answer_columns import Columns
from tests.seeds import mostly

BLOCK = 5
SIZE = np.array([5.0])


def columns(rng, n, before=5.0, after=5.0, at=None, slope=0.4):
    """One input whose noise has variance one; the gain steps at row `at`."""
    x = rng.normal(size=n)
    slopes = rng.normal(size=(2, n))
    gain = np.where(np.arange(n) < (n if at is None else at), before, after)
    y = gain * x + 2.0 + slope * slopes[0] + rng.normal(size=n)
    values = np.vstack([x, np.ones(n), slopes, y])
    precision = np.array([0.0, 0.0, 4.0, 4.0])
    return Columns(values, np.ones(n), np.full(n, True), 1, precision, 1.0)


def test_a_bayes_factor_is_the_ratio_of_two_marginal_likelihoods(seed):
    """Against dense Gaussians, flat coefficients with a variance of 1e6: to 1e-3 of the log."""
    made = columns(np.random.default_rng(seed), 60, after=7.0, at=35)
    found = gain_step.steps(made, SIZE, BLOCK)
    X, y = made.values[:-1], made.values[-1]
    for row, log_bayes in zip(found.rows, found.log_bayes, strict=True):
        after = np.arange(60) >= row
        variance = np.array([1e6, 1e6, 0.25, 0.25, 1e6])
        Z = np.vstack([X, after])
        null = (Z.T * variance) @ Z + np.eye(60)
        step = (gain_step.CHANGE_SD * SIZE[0]) ** 2 * np.outer(X[0] * after, X[0] * after)
        zero = np.zeros(60)
        expected = multivariate_normal(zero, null + step).logpdf(y) - multivariate_normal(zero, null).logpdf(
            y
        )
        assert log_bayes == pytest.approx(expected, abs=1e-3)


@mostly(0.95)
def test_gains_before_and_after_are_those_of_separate_regressions(seed):
    """Where both stretches are long: to a tenth of a standard error; and the row of the step is found."""
    made = columns(np.random.default_rng(seed), 2000, after=7.5, at=1000)
    found = gain_step.steps(made, SIZE, BLOCK)
    assert abs(found.rows[found.best] - 1000) <= 2 * BLOCK
    k = int(np.argmin(np.abs(found.rows - 1000)))
    X, y = made.values[:-1], made.values[-1]
    for part, value, sd in (
        (slice(0, 1000), found.before[k, 0], found.before_sd[k, 0]),
        (slice(1000, 2000), found.after[k, 0], found.after_sd[k, 0]),
    ):
        alone = np.linalg.lstsq(X[:, part].T, y[part], rcond=None)[0][0]
        assert value == pytest.approx(alone, abs=0.5 * sd)
        assert sd == pytest.approx(1000**-0.5, rel=0.1)


@mostly(0.95)
def test_without_a_step_large_evidence_is_as_rare_as_markov_says(seed):
    """Of 400 windows of 60 candidates without a step, at most 5 % (and 3 sd) sum to 20 times 60."""
    rng = np.random.default_rng(seed)
    exceeded = 0
    for _ in range(400):
        found = gain_step.steps(columns(rng, 60 * BLOCK), SIZE, BLOCK)
        exceeded += found.evidence > np.log(20.0 * 60)
    assert exceeded <= 0.05 * 400 + 3 * (400 * 0.05 * 0.95) ** 0.5


@mostly(0.95)
def test_a_drive_is_cut_where_its_gains_step_and_nowhere_else(seed):
    """Two steps of 40 %, found within 5 s; a constant drive is not cut at the same threshold."""
    rng = np.random.default_rng(seed)
    n = 6000
    made = columns(rng, n, after=7.0, at=2000)
    made.values[-1, 4000:] += (4.6 - 7.0) * made.values[0, 4000:]
    threshold = np.log(144_000.0)
    parts = gain_step.grams(made, 10)
    found = gain_segments.segment(parts, np.ones(len(parts)), made, SIZE, threshold)
    assert [abs(c.block - truth) <= 5 for c, truth in zip(found, (200, 400), strict=True)] == [True, True]
    clean = columns(rng, n)
    assert not gain_segments.segment(gain_step.grams(clean, 10), np.ones(n // 10), clean, SIZE, threshold)


ROWS_A_SECOND, SECONDS = 2, 900
THRESHOLD = np.log(360_000.0)


def pushed(rng, walk, factor=1.0):
    """A drive at 2 Hz whose slow input answers the driver's own slow offset; the gain steps halfway."""
    n = ROWS_A_SECOND * SECONDS
    slow = drifting_level.raw(n, 1.0 / ROWS_A_SECOND)
    level = (walk * SECONDS / np.arange(1, len(slow) + 1) * rng.normal(size=len(slow))) @ slow
    x = np.zeros(n)
    kicks = rng.normal(size=n)
    for k in range(1, n):
        x[k] = 0.95 * x[k - 1] + 0.3 * kicks[k] - 0.02 * level[k]
    slopes = 0.1 * rng.normal(size=(2, n))
    gain = np.where(np.arange(n) < n // 2, 5.0, 5.0 * factor)
    values = np.vstack([x, np.ones(n), slopes, gain * x + level + rng.normal(size=n)])
    made = Columns(values, np.ones(n), np.full(n, True), 1, np.array([0.0, 0.0, 4.0, 4.0]), 1.0)
    return made, drifting_level.grams(made, slow, ROWS_A_SECOND)


def cut(made, level):
    parts = gain_step.grams(made, ROWS_A_SECOND)
    return gain_segments.segment(parts, np.ones(len(parts)), made, SIZE, THRESHOLD, level)


def test_a_bayes_factor_under_a_drifting_level_is_the_ratio_of_two_marginal_likelihoods(seed):
    """Against dense Gaussians whose offset follows the cosines: to 1e-3 of the log."""
    rng = np.random.default_rng(seed)
    made = columns(rng, 60, after=7.0, at=35)
    slow = np.cumsum(rng.normal(size=(3, 60)), axis=1)
    made.values[-1] += 4.0 * slow[0]
    parts, level = gain_step.grams(made, BLOCK), drifting_level.grams(made, slow, BLOCK)
    found = gain_step.of_grams(parts, made, SIZE, BLOCK * np.arange(12.0), level=level)
    drifts = drifting_level.likeliest(parts, level, made.precision)
    assert drifts is not None
    X, y = made.values[:-1], made.values[-1]
    zero = np.zeros(60)
    for row, log_bayes in zip(found.rows, found.log_bayes, strict=True):
        after = np.arange(60) >= row
        Z = np.vstack([X, after])
        null = (Z.T * np.array([1e6, 1e6, 0.25, 0.25, 1e6])) @ Z + np.eye(60) + (slow.T * drifts) @ slow
        step = (gain_step.CHANGE_SD * SIZE[0]) ** 2 * np.outer(X[0] * after, X[0] * after)
        of = [multivariate_normal(zero, C).logpdf(y) for C in (null + step, null)]
        assert log_bayes == pytest.approx(of[0] - of[1], abs=2e-3)


@pytest.mark.slow("a share of drives")
def test_a_level_that_walks_is_no_change_of_the_gain():
    """Of 60 constant drives at most one is cut, where a quarter is without the level in the null; steps of 1.5 are found."""
    rng = np.random.default_rng(5)
    drives = [pushed(rng, 0.001) for _ in range(60)]
    assert sum(bool(cut(made, None)) for made, _ in drives) >= 15
    assert sum(bool(cut(*drive)) for drive in drives) <= 1
    stepped = [cut(*pushed(rng, 0.001, 1.5)) for _ in range(20)]
    assert sum(any(abs(c.block - SECONDS // 2) < 20 for c in found) for found in stepped) >= 18


@pytest.mark.slow("a share of drives")
@pytest.mark.parametrize("walk", [0.0, 0.001])
def test_a_change_that_is_said_to_be_visible_is_seen(walk):
    """A step by the factor that is stated for the second half is found in 0.9 of 40 drives, less what chance allows."""
    rng = np.random.default_rng(6)
    made, level = pushed(rng, walk)
    parts = gain_step.grams(made, ROWS_A_SECOND)
    each = (parts, np.ones(len(parts)), made, np.array([5.0]), SIZE, THRESHOLD)
    factor = gain_segments.visible_factor(*each, SECONDS / 2.0, level)
    assert 1.0 < factor < 2.0
    assert sum(bool(cut(*pushed(rng, walk, factor))) for _ in range(40)) >= 32
