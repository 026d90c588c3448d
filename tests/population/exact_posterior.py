"""Exact posterior of one parameter of drives and drivers: on a grid of both spreads, the rest in closed form.

y_ij ~ N(mu_i, v_ij + W), mu_i ~ N(mu, B), mu flat, the standard deviations half-t of 2 degrees of freedom (Gelman et al.
2013, section 5.4: the same steps with another prior). No outliers, which canid's own model has. Nothing of canid is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# points along each spread, in equal shares of its prior
POINTS = 240
DRAWS = 20_000


class Exact(NamedTuple):
    """Independent draws of the posterior."""

    mean: Array  # (D,)
    between: Array  # (D,) standard deviation
    within: Array  # (D,)
    driver: Array  # (D, I)


def exact(
    y: Array, v: Array, who: np.ndarray[tuple[int], np.dtype[np.intp]], scales: tuple[float, float], seed: int
) -> Exact:
    """Draw from the posterior.

    Args:
        y: (n,) estimates.
        v: (n,) variances of their errors.
        who: (n,) driver of each, 0 to I - 1.
        scales: of the half-t priors of the standard deviations between drivers, and within one.
        seed: of the draws.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> who = np.repeat(np.arange(30), 5)
        >>> y = rng.normal(5.0, 1.0, 30)[who] + rng.normal(0.0, 0.5, 150)
        >>> of = exact(y, np.full(150, 1e-6), who, (2.0, 1.0), 1)
        >>> bool(abs(np.median(of.mean) - 5.0) < 0.6), round(float(np.median(of.within)), 1)
        (True, 0.5)
    """
    u = (np.arange(POINTS) + 0.5) / POINTS
    # the quantile function of |t| of 2 degrees of freedom
    half_t = np.sqrt(2.0) * u / np.sqrt(1.0 - u * u)
    sd_between, sd_within = scales[0] * half_t, scales[1] * half_t
    drivers = int(who.max()) + 1
    one = (who[:, None] == np.arange(drivers)).astype(float)
    weight = 1.0 / (v + sd_within[:, None] ** 2)  # (W, n)
    known = weight @ one
    own = (weight * y) @ one / known  # (W, I)
    scatter = (weight * y * y).sum(axis=1) - (known * own * own).sum(axis=1)
    precision = 1.0 / (1.0 / known[:, None] + sd_between[None, :, None] ** 2)  # (W, B, I)
    total = precision.sum(axis=2)
    mean = (precision * own[:, None]).sum(axis=2) / total
    apart = (precision * (own[:, None] - mean[..., None]) ** 2).sum(axis=2)
    log = 0.5 * (np.log(weight).sum(axis=1) - np.log(known).sum(axis=1) - scatter)[:, None]
    log = log + 0.5 * (np.log(precision).sum(axis=2) - np.log(total) - apart)
    share = np.exp(log - log.max()).ravel()
    rng = np.random.default_rng(seed)
    w, b = np.unravel_index(rng.choice(share.size, DRAWS, p=share / share.sum()), log.shape)
    mu = mean[w, b] + rng.standard_normal(DRAWS) / np.sqrt(total[w, b])
    # a driver: own drives and the population, each by its precision
    prior = 1.0 / sd_between[b, None] ** 2
    spread = 1.0 / (known[w] + prior)
    driver = (known[w] * own[w] + prior * mu[:, None]) * spread
    driver = driver + np.sqrt(spread) * rng.standard_normal(driver.shape)
    return Exact(mu, sd_between[b], sd_within[w], driver)
