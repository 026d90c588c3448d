"""Gibbs sampler of the hierarchical normal model of estimates with known covariances of their errors.

y_ij ~ N(m_g(ij) + b_i, (S_ij + W) / lambda_ij), b_i ~ N(0, B / kappa_i) of drive j of driver i in group g; flat prior of m,
Huang & Wand's (2013) of B and W. lambda is 1 of an ordinary drive; of an outlier it is gamma, so that its estimate is
Student's t of NU_OUTLIER degrees of freedom and SCALE_OUTLIER times the spread (a scale mixture with a mass at 1: Box & Tiao
1968 with t in the place of their wider normal, so that the influence of an estimate falls to 0 with its distance). kappa
likewise of drivers. An outlier says nothing of W (a cut: Plummer 2015): by its scaled deviation 10 % of gross errors would
raise W's standard deviations by a third.
Collapsed where it can be (van Dyk & Park 2008): lambda without the drive's true parameters, m without b, both without the
true parameters; and B and W are rescaled together with their deviations (`covariance_prior.rescale`).

Arrays: parameters first, then chains C, then drives n or drivers I last, so that each operation runs over all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from canid.mathematics.population import covariance_prior
from canid.mathematics.population.batched_inverse import inverse, times
from canid.mathematics.population.drive_table import Flags, Index
from canid.values.types import Array

# Student's t of outliers: 3 degrees of freedom, the fewest whole number with a variance
NU_OUTLIER = 3.0
# its scale in standard deviations: 3, 5 and 8 find the same gross errors, and where a tenth of the drives has one 3 calls
# 1.5 % of the others outliers, too, 5 a half percent
SCALE_OUTLIER = 5.0
# Beta prior of the share of outliers: 5 % with the weight of 20 drives, gross errors of field data are 1 to 10 % (Hampel et
# al. 1986, section 1.2c)
SHARE_OUTLIER = (1.0, 19.0)
# drivers from which on one of them may be an outlier: of fewer it cannot be separated from a wide spread
MIN_DRIVERS = 5
# scales of the half-t priors of standard deviations between drivers and between drives of one, in units of `scaling`, which
# is the whole spread of the estimates. Between drivers twice it: of 2 to 4 drivers the unit is often too small, and at 1 the
# intervals of means cover 0.89 to 0.93, at 2 0.94 to 0.96 (`python -m benchmarks.fleet.pooling`)
SCALE = (2.0, 1.0)
# variance of means that no drive knows, in units of the scaled parameters: no information, and finite
VAGUE = 1e6


class Data(NamedTuple):
    """Estimates in units in which the scale of the prior is 1; drives in the order of drivers, and of groups in each.

    Chains may have data of their own (many fleets of one shape at once).
    """

    y: Array  # (p, C, n) 0 where not known
    s: Array  # (p, p, C, n) covariance of the error, 0 where not known
    known: Flags  # (p, C, n)
    driver: Index  # (n,) 0 to I - 1, none without a drive, in ascending order
    group: Index  # (n,) 0 to G - 1, ascending within a driver


class Draws(NamedTuple):
    """D draws of each chain, and what was averaged over them."""

    mean: Array  # (D, C, G, p) m
    mean_hat: Array  # (D, C, G p) expectation of m given B, W and the weights
    mean_covariance: Array  # (D, C, G p, G p) of m, likewise
    between: Array  # (D, C, p, p) B
    within: Array  # (D, C, p, p) W
    deviation: Array  # (D, p, C, I) b
    drive_outlier: Array  # (C, n) probability
    driver_outlier: Array  # (C, I)
    drive_weight: Array  # (C, n) mean of lambda
    driver_weight: Array  # (C, I) mean of kappa
    pull: Array  # (p, C, I) share of the shrunken estimate that is the population's mean


def sample(
    data: Data,
    rng: np.random.Generator,
    burn: int,
    keep: int,
    scale: tuple[float, float] = SCALE,
    *,
    fixed: Array | None = None,
    fixed_within: Array | None = None,
) -> Draws:
    """Draw from the posterior.

    Args:
        data: of n >= 1 drives.
        rng: random numbers; the same give the same draws.
        burn: steps that are dropped.
        keep: D.
        scale: of the half-t priors of standard deviations between and within.
        fixed: (p, p) B, where it is not to be estimated: a wide one makes drivers fixed effects.
        fixed_within: (p, p) W, likewise.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> y = np.repeat(rng.standard_normal(20), 5)[None, None] + 0.5 * rng.standard_normal((1, 1, 100))
        >>> driver, group = np.repeat(np.arange(20), 5), np.zeros(100, dtype=int)
        >>> data = Data(y, np.full((1, 1, 1, 100), 0.01), np.ones((1, 1, 100), bool), driver, group)
        >>> draws = sample(data, rng, 100, 300)
        >>> sd = np.sqrt(draws.within[:, 0, 0, 0]).mean(), np.sqrt(draws.between[:, 0, 0, 0]).mean()
        >>> bool(abs(sd[0] - 0.5) < 0.1), bool(0.4 < sd[1] < 1.6)
        (True, True)
    """
    p, chains, n = data.y.shape
    eye = np.eye(p)
    drivers, groups = int(data.driver[-1]) + 1, int(data.group.max()) + 1
    both = data.known[:, None] & data.known[None, :]
    count = data.known.sum(axis=0)
    # exact estimates have no inverse: 1e-5 of the prior's scale is added to their standard deviations
    s = np.where(both, data.s + (1e-10 * eye)[:, :, None, None], 0.0)
    s_inverse = np.where(both, inverse(np.where(both, s, eye[:, :, None, None])), 0.0)
    s_root = np.moveaxis(_root(np.moveaxis(s, (0, 1), (-2, -1))), (-2, -1), (0, 1))
    cell_first, cell_driver, cell_group = _cells(data.driver, data.group)
    # outliers' density over ordinary drives', without what depends on the distance, by the number of known parameters
    constant, d_constant = t_constant(count), t_constant(np.full(drivers, p))

    between = np.tile(eye if fixed is None else fixed, (chains, 1, 1))
    within = np.tile(eye if fixed_within is None else fixed_within, (chains, 1, 1))
    mean = _start(data, groups)
    b = np.zeros((p, chains, drivers))
    share, driver_share = np.full(chains, 0.05), np.full(chains, 0.05)
    kappa = np.ones((chains, drivers))
    out: list[tuple[Array, ...]] = []
    total = [np.zeros((chains, n)), np.zeros((chains, drivers)), np.zeros((chains, n))]
    total += [np.zeros((chains, drivers)), np.zeros((p, chains, drivers))]
    for step in range(burn + keep):
        # drives: distance, and whether an outlier
        w = np.moveaxis(within, 0, -1)[..., None]
        precision = np.where(both, inverse(np.where(both, s + w, eye[:, :, None, None])), 0.0)
        residual = np.where(data.known, data.y - mean[:, :, data.group] - b[:, :, data.driver], 0.0)
        distance = np.asarray(np.sum(residual * times(precision, residual), axis=0))
        p_outlier, lam = _weights(rng, distance, count, constant, share)
        flagged = lam[1]
        share = rng.beta(SHARE_OUTLIER[0] + flagged.sum(axis=1), SHARE_OUTLIER[1] + n - flagged.sum(axis=1))
        # means of groups without the drivers' deviations, then the deviations
        weighted = precision * lam[0]
        cell_q = np.zeros((p, p, chains, drivers, groups))
        cell_h = np.zeros((p, chains, drivers, groups))
        cell_q[..., cell_driver, cell_group] = np.add.reduceat(weighted, cell_first, axis=-1)
        cell_h[..., cell_driver, cell_group] = np.add.reduceat(times(weighted, data.y), cell_first, axis=-1)
        b_inverse = _inverse(between) * kappa
        q = np.asarray(cell_q.sum(axis=-1))
        t = inverse(q + b_inverse)
        pull = np.einsum("klci,lkci->kci", t, b_inverse)
        hat, hat_covariance = _means(cell_q, cell_h, t)
        mean_flat = (
            hat + (np.linalg.cholesky(hat_covariance) @ rng.standard_normal(hat.shape)[..., None])[..., 0]
        )
        mean = mean_flat.reshape(chains, groups, p).transpose(2, 0, 1)
        left = np.asarray(cell_h.sum(axis=-1))
        for g in range(groups):
            left -= times(cell_q[..., g], mean[:, :, g, None])
        root = _roots(t)
        b = times(t, left) + times(root, rng.standard_normal(b.shape))
        # spread between drivers
        d_outlier = np.zeros((chains, drivers))
        if fixed is None:
            information = np.einsum("kci,lci,klci->ckl", b, b, q)
            score = np.einsum("kci,kci->ck", b, left)
            factor = covariance_prior.rescale(rng, between, information, score, scale[0])
            b *= factor.T[:, :, None]
            between *= factor[:, :, None] * factor[:, None, :]
            if drivers >= MIN_DRIVERS:
                distance = np.sum(b * times(_inverse(between), b), axis=0)
                d_outlier, (kappa, d_flagged) = _weights(
                    rng, distance, np.full(drivers, p), d_constant, driver_share
                )
                flags = d_flagged.sum(axis=1)
                driver_share = rng.beta(SHARE_OUTLIER[0] + flags, SHARE_OUTLIER[1] + drivers - flags)
            scatter = np.einsum("kci,lci,ci->ckl", b, b, kappa)
            between = covariance_prior.draw(rng, between, scatter, np.full(chains, float(drivers)), scale[0])
        if fixed_within is None:
            within = _drawn_within(rng, data, within, precision, lam, (s_root, s_inverse), mean, b, scale[1])
        if step >= burn:
            out.append((mean.transpose(1, 2, 0), hat, hat_covariance, between.copy(), within.copy(), b))
            for sum_, new in zip(total, (p_outlier, d_outlier, lam[0], kappa, pull), strict=True):
                sum_ += new / keep
    stacked = [np.array([draw[k] for draw in out]) for k in range(6)]
    return Draws(*stacked, *total)


def _drawn_within(
    rng: np.random.Generator,
    data: Data,
    within: Array,
    precision: Array,
    lam: tuple[Array, Array],
    of_error: tuple[Array, Array],
    mean: Array,
    b: Array,
    scale: float,
) -> Array:
    """W, by the true deviations of the drives: a draw from the prior and its residual (Matheron's rule).

    Args:
        rng: random numbers.
        data: drives.
        within: (C, p, p) W.
        precision: (S + W)^-1.
        lam: weights of the drives, and which are outliers.
        of_error: root and inverse of S.
        mean: (p, C, G) m.
        b: (p, C, I).
        scale: of the half-t prior.
    """
    s_root, s_inverse = of_error
    w = np.moveaxis(within, 0, -1)[..., None]
    residual = np.where(data.known, data.y - mean[:, :, data.group] - b[:, :, data.driver], 0.0)
    w_root = _roots(w)
    sigma = lam[0] ** -0.5
    u = times(w_root, rng.standard_normal(residual.shape)) * sigma
    error = times(s_root, rng.standard_normal(residual.shape)) * sigma
    u = u + times(w, times(precision, np.where(data.known, residual - u - error, 0.0)))
    # an outlier says nothing of the ordinary spread
    ordinary = 1.0 - lam[1]
    weighted_u = u * ordinary
    information = np.einsum("kcn,lcn,klcn->ckl", u, weighted_u, s_inverse)
    score = np.einsum("kcn,kcn->ck", weighted_u, times(s_inverse, residual))
    factor = covariance_prior.rescale(rng, within, information, score, scale)
    u *= factor.T[:, :, None]
    within *= factor[:, :, None] * factor[:, None, :]
    scatter = np.einsum("kcn,lcn,cn->ckl", u, u, ordinary)
    return covariance_prior.draw(rng, within, scatter, ordinary.sum(axis=1), scale)


def _cells(driver: Index, group: Index) -> tuple[Index, Index, Index]:
    """Runs of drives of one driver in one group: where each begins, its driver, its group."""
    key = driver * (int(group.max()) + 1) + group
    first = np.flatnonzero(np.diff(key, prepend=-1)).astype(np.intp)
    return first, driver[first], group[first]


def _root(s: Array) -> Array:
    """Symmetric roots of covariances, which may be singular."""
    value, vector = np.linalg.eigh(s)
    return np.asarray(vector * np.sqrt(np.maximum(value, 0.0))[..., None, :])


def _inverse(covariance: Array) -> Array:
    """Of each chain's (C, p, p), as (p, p, C, 1)."""
    return np.asarray(np.moveaxis(np.linalg.inv(covariance), 0, -1)[..., None])


def _roots(t: Array) -> Array:
    """Cholesky factors of many covariances, (p, p, C, m)."""
    return np.asarray(np.moveaxis(np.linalg.cholesky(np.moveaxis(t, (0, 1), (-2, -1))), (-2, -1), (0, 1)))


def _start(data: Data, groups: int) -> Array:
    """Medians of what is known, which outliers do not move; (p, C, G)."""
    out = np.zeros((*data.y.shape[:2], groups))
    for g in range(groups):
        in_group = data.group == g
        y = np.where(data.known[..., in_group], data.y[..., in_group], np.nan)
        some = np.isfinite(y).any(axis=-1)
        out[..., g][some] = np.nanmedian(y[some], axis=-1)
    return out


def t_constant(count: Array | Index) -> Array:
    """Logarithm of the ratio of Student's t density to the normal one, at a distance of 0.

    Args:
        count: known parameters.

    Example:
        >>> round(float(t_constant(np.array(1))), 2)
        -1.69
    """
    k = np.asarray(count, dtype=np.float64)
    return np.asarray(
        gammaln(0.5 * (NU_OUTLIER + k))
        - gammaln(0.5 * NU_OUTLIER)
        + 0.5 * k * np.log(2.0 / (NU_OUTLIER * SCALE_OUTLIER**2))
    )


def outlier_probability(distance: Array, count: Array | Index, constant: Array, share: Array) -> Array:
    """Probability that an estimate is an outlier's.

    Args:
        distance: (C, n) squared, in standard deviations of an ordinary one.
        count: known parameters.
        constant: of `t_constant`.
        share: (C,) of outliers.

    Example:
        >>> distance, count = np.array([[0.0, 100.0]]), np.array([1, 1])
        >>> far = outlier_probability(distance, count, t_constant(count), np.array([0.05]))
        >>> np.round(far, 2).tolist()
        [[0.01, 1.0]]
    """
    t = NU_OUTLIER * SCALE_OUTLIER**2
    log_odds = constant - 0.5 * (NU_OUTLIER + count) * np.log1p(distance / t) + 0.5 * distance
    log_odds = log_odds + np.log(share / (1.0 - share))[:, None]
    # beyond 50 the probability is 1 to the last bit
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -50.0, 50.0))))


def outlier_weight(distance: Array, count: Array | Index) -> Array:
    """Expected weight of an outlier's estimate, that of Student's t (Lange, Little & Taylor 1989).

    Args:
        distance: squared, in standard deviations of an ordinary one.
        count: known parameters.

    Example:
        >>> float(outlier_weight(np.array(25.0), np.array(1)))
        0.04
    """
    return np.asarray((NU_OUTLIER + count) / (NU_OUTLIER * SCALE_OUTLIER**2 + distance))


def _weights(
    rng: np.random.Generator, distance: Array, count: Array | Index, constant: Array, share: Array
) -> tuple[Array, tuple[Array, Array]]:
    """Probability of an outlier, and a draw: weight and flag."""
    probability = outlier_probability(distance, count, constant, share)
    flag = rng.random(distance.shape) < probability
    t = NU_OUTLIER * SCALE_OUTLIER**2
    drawn = 2.0 * rng.standard_gamma(0.5 * (NU_OUTLIER + count), size=distance.shape) / (t + distance)
    return probability, (np.where(flag, drawn, 1.0), flag.astype(np.float64))


def _means(cell_q: Array, cell_h: Array, t: Array) -> tuple[Array, Array]:
    """Means of groups given B and W, with the drivers' deviations integrated out: expectation and covariance.

    Args:
        cell_q: (p, p, C, I, G) information of a driver's drives in a group.
        cell_h: (p, C, I, G).
        t: (p, p, C, I) covariance of a driver's deviation given the means.

    Returns:
        (C, G p) and (C, G p, G p).
    """
    p, _, chains, _, groups = cell_q.shape
    h_driver = cell_h.sum(axis=-1)
    pulled = times(t, h_driver)
    a = np.zeros((chains, groups, p, groups, p))
    h = np.zeros((chains, groups, p))
    for g in range(groups):
        # q_g T, of each driver
        gain = np.stack([times(t, cell_q[:, k, ..., g]) for k in range(p)])
        h[:, g] = (cell_h[..., g] - times(cell_q[..., g], pulled)).sum(axis=-1).T
        a[:, g, :, g, :] += np.moveaxis(cell_q[..., g].sum(axis=-1), -1, 0)
        for other in range(groups):
            a[:, g, :, other, :] -= np.einsum("kmci,mlci->ckl", gain, cell_q[..., other])
    size = groups * p
    flat = a.reshape(chains, size, size) + np.eye(size) / VAGUE
    covariance = np.linalg.inv(0.5 * (flat + flat.swapaxes(1, 2)))
    return np.asarray((covariance @ h.reshape(chains, size, 1))[..., 0]), np.asarray(covariance)
