"""The local level against textbook Gaussians, and its test of constancy on drives of known truth."""

import numpy as np
import pytest
from scipy.stats import binom, multivariate_normal

from canid.mathematics.identification import local_level
from tests.seeds import mostly

T = 40.0 * np.arange(12.0)


def walks(rng, n):
    """Errors of unequal size, and changes between windows of unequal distance."""
    variance = rng.uniform(0.1, 1.0, n) ** 2
    change = rng.uniform(0.02, 0.3, n - 1)
    level = 5.0 + np.concatenate([[0.0], np.cumsum(np.sqrt(change) * rng.normal(size=n - 1))])
    return level + np.sqrt(variance) * rng.normal(size=n), variance, change


def test_the_likelihood_is_that_of_the_differences(seed):
    """Differences of neighbours hold all that a first value of unknown level leaves: a dense Gaussian, to 1e-9."""
    y, variance, change = walks(np.random.default_rng(seed), 9)
    covariance = np.diag(variance[1:] + variance[:-1] + change)
    for k in range(7):
        covariance[k, k + 1] = covariance[k + 1, k] = -variance[k + 1]
    expected = multivariate_normal(np.zeros(8), covariance).logpdf(np.diff(y))
    assert local_level.log_likelihood(y, variance, change[None])[0] == pytest.approx(expected, abs=1e-9)


def test_the_smoothed_level_is_the_conditional_mean(seed):
    """The smoother against a dense Gaussian of the levels in information form, none known before: to 1e-5."""
    y, variance, change = walks(np.random.default_rng(seed), 9)
    D = np.diff(np.eye(9), axis=0)
    covariance = np.linalg.inv(D.T @ np.diag(1.0 / change) @ D + np.diag(1.0 / variance))
    mean, of_mean = local_level._smoothed(y, variance, change)
    assert mean == pytest.approx(covariance @ (y / variance), abs=1e-5)
    assert of_mean == pytest.approx(np.diag(covariance), abs=1e-5)


@pytest.mark.slow("imports filterpy, and with it matplotlib")
def test_the_smoothed_level_is_that_of_filterpy(seed):
    """Filter and smoother of filterpy, whose operations are written out; its inverse of 1 x 1 rounds as this LAPACK does."""
    kalman = pytest.importorskip(
        "filterpy.kalman", reason="filterpy is not installed (pip install canid[dev])"
    )
    one = np.ones((1, 1))
    y, variance, change = walks(np.random.default_rng(seed), 40)
    theirs = kalman.KalmanFilter(dim_x=1, dim_z=1)
    theirs.x, theirs.P, theirs.F, theirs.H = y[:1, None], local_level.DIFFUSE * variance[0] * one, one, one
    Qs = [0.0 * one, *(q * one for q in change)]
    means, covariances, _, _ = theirs.batch_filter(y[:, None, None], Qs=Qs, Rs=[r * one for r in variance])
    smooth, P, _, _ = theirs.rts_smoother(means, covariances, Fs=[one] * 40, Qs=Qs)
    mean, of_mean = local_level._smoothed(y, variance, change)
    np.testing.assert_allclose(mean, smooth.reshape(40), rtol=1e-13)
    np.testing.assert_allclose(of_mean, P.reshape(40), rtol=1e-13)


@mostly(0.95)
def test_a_constant_level_is_rejected_as_often_as_the_level_says(seed):
    """300 constant drives with unequal errors: p < 0.05 in no more than chance allows (99.9 %)."""
    rng = np.random.default_rng(seed)
    sd = rng.uniform(0.2, 0.6, len(T))
    variance, spans = sd * sd, np.diff(T)
    grid = np.concatenate([[0.0], float(np.median(sd)) * np.geomspace(*local_level.SD_GRID)])
    change = 6.0 / float(spans.sum()) * grid[:, None] ** 2 * spans
    null = local_level.log_likelihood(rng.normal(size=(999, len(T))) * sd, variance, change)
    drawn = local_level.log_likelihood(4.0 + rng.normal(size=(300, len(T))) * sd, variance, change)
    limit = np.quantile(null.max(axis=1) - null[:, 0], 0.95)
    rejected = int(np.sum(drawn.max(axis=1) - drawn[:, 0] > limit))
    assert rejected <= binom(300, 0.05).ppf(0.999) * 1.3  # the limit itself is drawn


@mostly(0.95)
def test_a_level_that_walks_is_found_and_its_band_holds_it(seed):
    """Thirty windows, sd of the walk three standard errors: p < 0.01, most of the level inside the band."""
    rng = np.random.default_rng(seed)
    t = 40.0 * np.arange(30.0)
    walk = np.cumsum(rng.normal(size=30))
    level = 5.0 + 0.9 * (walk - walk.mean()) / walk.std()
    found = local_level.fit(t, level + 0.3 * rng.normal(size=30), np.full(30, 0.3))
    assert found is not None
    assert found.p_value < 0.01
    assert np.mean((found.low <= level) & (level <= found.high)) >= 0.7
    assert found.variation.low > 0.0


def test_too_few_windows_give_no_level():
    """A drive of five windows is too short, and no error."""
    assert local_level.fit(T[:5], np.ones(5), np.ones(5)) is None
