"""Variance components, drift over the segments and the local level of vectors, against second routes."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from canid.mathematics.identification import local_level
from canid_study.chen_ulsoy import between
from canid_study.chen_ulsoy.driver_drift import drift_of
from tests.seeds import mostly

# Snedecor & Cochran 1967, sec. 10.13: calcium of four turnip leaves, four determinations each
LEAVES = np.array(
    [[3.28, 3.09, 3.03, 3.03], [3.52, 3.48, 3.38, 3.38], [2.88, 2.80, 2.81, 2.76], [3.34, 3.38, 3.23, 3.26]]
)


def test_reml_of_a_balanced_random_effects_table_is_its_analysis_of_variance():
    """Turnip leaves: the component between leaves is (MS_between - MS_within) / 4 = 0.0724, as the textbook prints."""
    within = float(LEAVES.var(axis=1, ddof=1).mean())
    found = between.component([(LEAVES.mean(axis=1), np.full(4, within / 4))])
    expected = (4 * float(LEAVES.mean(axis=1).var(ddof=1)) - within) / 4
    assert round(expected, 4) == 0.0724
    assert found.sd.value**2 == pytest.approx(expected, rel=1e-3)
    assert found.mean == pytest.approx(LEAVES.mean(), abs=1e-12)


def test_the_restricted_likelihood_is_that_of_contrasts(seed):
    """Any n - 1 contrasts have the same likelihood but for a constant: a dense Gaussian of differences, unequal errors."""
    rng = np.random.default_rng(seed)
    x, v = rng.normal(size=7), rng.uniform(0.2, 2.0, 7)
    D = np.diff(np.eye(7), axis=0)

    def dense(tau):
        return multivariate_normal(np.zeros(6), D @ np.diag(v + tau) @ D.T).logpdf(D @ x)

    mine = [between.restricted_log_likelihood(x, v, tau) for tau in (0.0, 0.5, 3.0)]
    # |D V D'| = |V| sum(1/V) with differences of neighbours, so that only the factor 2 pi is left out
    assert np.diff(mine) == pytest.approx(np.diff([dense(t) for t in (0.0, 0.5, 3.0)]), abs=1e-9)


def test_several_parameters_with_equal_errors_have_the_closed_form(seed):
    """Equal R: the covariance between members is the sample covariance minus R."""
    rng = np.random.default_rng(seed)
    L = np.array([[1.0, 0.0], [-0.9, 0.3]])
    R = np.array([[0.04, 0.01], [0.01, 0.02]])
    x = rng.normal(size=(300, 2)) @ L.T + rng.multivariate_normal(np.zeros(2), R, 300)
    found = between.covariance([(x, np.tile(R, (300, 1, 1)))])
    assert found.between == pytest.approx(np.cov(x.T) - R, abs=0.01 * np.cov(x.T).max())
    assert found.mean == pytest.approx(x.mean(axis=0), abs=1e-9)


@mostly(0.95)
def test_the_split_finds_what_was_drawn_and_zero_where_nothing_was(seed):
    """12 drivers of 60 minutes: sampling 1, between minutes 2, between drivers 1.5; and none of the two."""
    rng = np.random.default_rng(seed)
    R = np.ones((60, 1, 1))
    many = [
        (1.5 * rng.normal() + 2.0 * rng.normal(size=(60, 1)) + rng.normal(size=(60, 1)), R) for _ in range(12)
    ]
    found = between.split(("x",), many)[0]
    assert found.minutes.low < 2.0 < found.minutes.high
    assert found.drivers.low < 1.5 < found.drivers.high
    assert found.naive > 2.2
    still = [(rng.normal(size=(60, 1)), R) for _ in range(12)]
    found = between.split(("x",), still)[0]
    assert found.minutes.low == 0.0
    assert found.drivers.low == 0.0


@mostly(0.95)
def test_intervals_of_a_component_hold_it(seed):
    """100 groups with sd 0.7 and unequal errors: the interval holds it in 95 %, at least in 88; of sd 0 likewise."""
    rng = np.random.default_rng(seed)
    for sd in (0.0, 0.7):
        held = 0
        for _ in range(100):
            v = rng.uniform(0.3, 1.0, 40)
            x = sd * rng.normal(size=40) + np.sqrt(v) * rng.normal(size=40)
            found = between.component([(x, v)]).sd
            held += found.low <= sd <= found.high
        assert held >= 88


def vectors(rng, n=7, d=3):
    roots = rng.normal(size=(n, d, d)) * 0.3 + np.eye(d)
    R = roots @ roots.swapaxes(1, 2)
    half = rng.normal(size=(n - 1, d, d)) * 0.3
    return rng.normal(size=(n, d)), R, half @ half.swapaxes(1, 2) + 0.05 * np.eye(d)


def test_the_likelihood_of_vectors_is_a_dense_gaussian(seed):
    """Differences of neighbours hold all that an unknown first level leaves; also with a window missing."""
    rng = np.random.default_rng(seed)
    y, R, Q = vectors(rng)
    n, d = y.shape
    for missing in ((), (3,)):
        values = y.copy()
        values[list(missing)] = np.nan
        known = [i for i in range(n) if i not in missing]
        levels = np.zeros((n, n, d, d))
        for i in range(n):
            for j in range(n):
                levels[i, j] = Q[: min(i, j)].sum(axis=0)
        V = np.block([[levels[i, j] + (R[i] if i == j else 0.0) for j in known] for i in known])
        D = np.kron(np.diff(np.eye(len(known)), axis=0), np.eye(d))
        expected = multivariate_normal(np.zeros(len(D)), D @ V @ D.T).logpdf(D @ y[known].ravel())
        found = local_level.log_likelihood_of_vectors(values, R, Q[None])
        assert found[0] == pytest.approx(expected, abs=1e-8)


def test_the_smoothed_vectors_are_the_conditional_mean(seed):
    """filterpy's smoother with a missing window against the information form of a dense Gaussian."""
    rng = np.random.default_rng(seed)
    y, R, Q = vectors(rng)
    n, d = y.shape
    values = y.copy()
    values[4] = np.nan
    H, g = np.zeros((n * d, n * d)), np.zeros(n * d)
    for i in range(n):
        at = slice(i * d, (i + 1) * d)
        if i != 4:
            H[at, at] += np.linalg.inv(R[i])
            g[at] += np.linalg.solve(R[i], y[i])
        if i:
            D = np.zeros((d, n * d))
            D[:, at], D[:, (i - 1) * d : i * d] = np.eye(d), -np.eye(d)
            H += D.T @ np.linalg.solve(Q[i - 1], D)
    covariance = np.linalg.inv(H)
    mean, of_mean = local_level.smoothed_vectors(values, R, Q)
    assert mean.ravel() == pytest.approx(covariance @ g, abs=1e-8)
    for i in range(n):
        at = slice(i * d, (i + 1) * d)
        assert of_mean[i] == pytest.approx(covariance[at, at], abs=1e-8)


def test_one_parameter_is_the_scalar_local_level(seed):
    """The likelihood of vectors of length one is the scalar one."""
    rng = np.random.default_rng(seed)
    y, v, q = rng.normal(size=9), rng.uniform(0.1, 1.0, 9), rng.uniform(0.01, 0.3, 8)
    one = local_level.log_likelihood(y, v, q[None])
    assert local_level.log_likelihood_of_vectors(
        y[:, None], v[:, None, None], q[None, :, None, None]
    ) == pytest.approx(one)


@mostly(0.95)
def test_the_order_of_segments_moves_the_likelihood_ratio_and_not_the_std(seed):
    """A drift over 100 segments: found in order, not when shuffled; the standard deviation is the same."""
    rng = np.random.default_rng(seed)
    R = np.tile(np.diag([0.04, 0.09]), (100, 1, 1))
    theta = np.linspace(-0.5, 0.5, 100)[:, None] * [1.0, -1.5] + rng.normal(size=(100, 2)) * [0.2, 0.3]
    number = np.arange(100)
    drifting = drift_of(number, theta, R)
    shuffled = rng.permutation(theta)
    mixed = drift_of(number, shuffled, R)
    assert drifting.p_value <= 0.01
    assert drifting.statistic > 50.0
    assert mixed.statistic < 0.4 * drifting.statistic
    assert shuffled.std(axis=0) == pytest.approx(theta.std(axis=0), abs=1e-12)
    truth = np.linspace(-0.5, 0.5, 100)
    inside = (drifting.low[:, 0] <= truth) & (truth <= drifting.high[:, 0])
    assert inside.mean() > 0.8


@mostly(0.95)
def test_a_constant_driver_is_rejected_as_often_as_the_level_says(seed):
    """20 constant drivers of 25 segments: p < 0.05 in at most 5 (99.97 % of chance)."""
    rng = np.random.default_rng(seed)
    R = np.tile(0.04 * np.eye(2), (25, 1, 1))
    p = [drift_of(np.arange(25), 0.2 * rng.normal(size=(25, 2)), R, seed=k).p_value for k in range(20)]
    assert sum(x < 0.05 for x in p) <= 5


def test_missing_segments_widen_the_band(seed):
    """Ten segments without a fit: the band is there, and wider than next to them."""
    rng = np.random.default_rng(seed)
    number = np.concatenate([np.arange(30), np.arange(40, 70)])
    theta = np.cumsum(0.15 * rng.normal(size=(70, 1)), axis=0)[number] + 0.2 * rng.normal(size=(60, 1))
    found = drift_of(number, theta, np.full((60, 1, 1), 0.04))
    width = (found.high - found.low)[:, 0]
    assert len(found.number) == 70
    assert width[35] >= width[15]
