"""Prior of a covariance matrix whose standard deviations are half-t and whose correlations are uniform (Huang & Wand 2013).

W | a ~ inverse Wishart(NU + p - 1, 2 NU diag(1/a)), a_k ~ inverse gamma(1/2, 1/A_k²); with NU = 2 each correlation is
uniform on (-1, 1). Unlike an inverse Wishart prior alone it holds no spread away from 0 (Gelman 2006), and unlike REML its
posterior is not a point at 0 where drivers are few. Bayesian Analysis 8, 439-452.
"""

from __future__ import annotations

import numpy as np

from canid.values.types import Array

# degrees of freedom of the half-t priors: 2 makes every correlation uniform (Huang & Wand 2013, property 3)
NU = 2.0


def draw(rng: np.random.Generator, covariance: Array, scatter: Array, count: Array, scale: float) -> Array:
    """Gibbs step: a covariance given deviations, each chain by itself.

    Args:
        rng: random numbers.
        covariance: (C, p, p) of the step before, for the auxiliary a.
        scatter: (C, p, p) sum of squares and products of the deviations.
        count: (C,) deviations in it.
        scale: A, the half-t prior's scale.

    Returns:
        (C, p, p).

    Example:
        >>> rng, unit = np.random.default_rng(1), np.eye(2)[None]
        >>> drawn = np.array([draw(rng, unit, 4000.0 * unit, np.array([1000.0]), 1.0)[0] for _ in range(200)])
        >>> np.round(drawn.mean(axis=0), 1).tolist()
        [[4.0, 0.0], [0.0, 4.0]]
    """
    chains, p = covariance.shape[:2]
    precision = np.einsum("ckk->ck", np.linalg.inv(covariance))
    # a_k | W (Huang & Wand 2013, section 4.1): inverse gamma is one over gamma
    a_inverse = rng.gamma(0.5 * (NU + p), size=(chains, p)) / (NU * precision + scale**-2)
    total = scatter + 2.0 * NU * np.einsum("ck,kl->ckl", a_inverse, np.eye(p))
    # Bartlett 1933: X X' is Wishart where X is the Cholesky factor of its scale times a triangle of chi and normal variates
    triangle = np.tril(rng.standard_normal((chains, p, p)), -1)
    freedom = NU + p - 1.0 + count[:, None] - np.arange(p)
    triangle[:, np.arange(p), np.arange(p)] = np.sqrt(2.0 * rng.gamma(0.5 * freedom, size=(chains, p)))
    # W = L (A A')^-1 L' with total = L L', so that W = F F' with F = L A'^-1
    factor = np.linalg.cholesky(total) @ np.linalg.inv(triangle).swapaxes(1, 2)
    return np.asarray(factor @ factor.swapaxes(1, 2))


def rescale(
    rng: np.random.Generator, covariance: Array, information: Array, score: Array, scale: float
) -> Array:
    """Factors by which deviations and their standard deviations are multiplied together (generalised Gibbs, Liu & Wu 1999).

    Where errors of the estimates exceed the spread, deviations and spread hold each other and the plain step hardly moves:
    its autocorrelation time grows with the number of drives. Multiplied by one factor each, they move freely. With the
    auxiliary a integrated out the target is L(f) times the product of (NU (W^-1)_kk + f_k²/A²)^(-(NU + p)/2), L the
    estimates' likelihood, which is normal in f; a draw of L is accepted by the ratio of the rest (Metropolis & Hastings).

    Args:
        rng: random numbers.
        covariance: (C, p, p).
        information: (C, p, p) of the factors.
        score: (C, p), the likelihood's linear term.
        scale: A.

    Returns:
        (C, p), 1 where the proposal is refused.

    Example:
        >>> unit = np.eye(1)[None]
        >>> f = rescale(np.random.default_rng(1), unit, 1e6 * unit, 0.5e6 * np.ones((1, 1)), 10.0)
        >>> bool(0.49 < f[0, 0] < 0.51)
        True
    """
    chains, p = score.shape
    # a parameter that nothing is known of has no information: its factor stays within the prior's reach
    ridge = 1e-9 * np.einsum("ckk->c", information)[:, None, None] + 1e-12
    root = np.linalg.cholesky(information + ridge * np.eye(p))
    inner = np.linalg.solve(root, score[:, :, None])
    noise = rng.standard_normal((chains, p, 1))
    proposal = np.linalg.solve(root.swapaxes(1, 2), inner + noise)[:, :, 0]
    precision = NU * np.einsum("ckk->ck", np.linalg.inv(covariance))
    log_ratio = (
        0.5
        * (NU + p)
        * np.sum(np.log(precision + scale**-2) - np.log(precision + proposal**2 * scale**-2), axis=1)
    )
    taken = np.log(rng.random(chains)) < log_ratio
    return np.where(taken[:, None], proposal, 1.0)
