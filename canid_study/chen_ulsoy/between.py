"""Variance components by restricted maximum likelihood (Patterson & Thompson 1971): sampling, minutes, drivers.

The random-effects model of DerSimonian & Laird (1986) on (theta_k, R_k), nested: minutes in drivers.

The standard deviation that Chen & Ulsoy 2001 print (Tables 1, 2) adds the three: R_k, the covariance of each minute's
fit, is known, so that the rest can be separated from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE
from canid.values.types import NAN, Array, Interval

# standard deviations that are tried, against the median standard error: below a hundredth nothing changes; a thousand
# times is beyond any parameter
_GRID = np.concatenate([[0.0], np.geomspace(1e-2, 1e3, 120)])
# steps of expectation-maximisation, and the relative change at which it ends
_STEPS, _ENOUGH = 400, 1e-5


class Component(NamedTuple):
    """A mean, and the standard deviation about it that is no sampling."""

    mean: float
    mean_sd: float  # standard error
    sd: Interval  # 95 % by profile likelihood; low 0: none may be there


class Split(NamedTuple):
    """The standard deviation of one parameter, and what it consists of."""

    name: str
    naive: float  # of all minutes of all drivers, as printed
    sampling: float  # root mean square of the fits' standard errors
    minutes: Interval
    drivers: Interval  # NaN where there is one driver


class Covariance(NamedTuple):
    """Mean and covariance between groups' members, of all parameters together."""

    mean: Array  # (d,)
    mean_covariance: Array  # (d, d)
    between: Array  # (d, d)


def component(groups: Sequence[tuple[Array, Array]]) -> Component:
    """Restricted maximum likelihood of one standard deviation within groups that each have their own mean.

    Args:
        groups: values (n,) and their sampling variances (n,), of each group; those of one value say nothing.

    Returns:
        Mean of the first group (of several it is NaN), and the standard deviation. NaN where no group has two values.

    >>> rng = np.random.default_rng(2)
    >>> v = rng.uniform(0.5, 1.5, 200)
    >>> component_sd = component([(3.0 + 2.0 * rng.normal(size=200) + np.sqrt(v) * rng.normal(size=200), v)])
    >>> bool(component_sd.sd.low < 2.0 < component_sd.sd.high), bool(abs(component_sd.mean - 3.0) < 4 * component_sd.mean_sd)
    (True, True)
    """
    used = [(np.asarray(x, float), np.asarray(v, float)) for x, v in groups if len(x) > 1]
    if not used:
        return Component(NAN, NAN, Interval())
    unit = float(np.sqrt(np.median(np.concatenate([v for _, v in used]))))

    def value(sd: float) -> float:
        return sum(restricted_log_likelihood(x, v, sd * sd) for x, v in used)

    grid = unit * _GRID
    likelihood = np.array([value(sd) for sd in grid])
    top = int(np.argmax(likelihood))
    low, high = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
    best = minimize_scalar(
        lambda sd: -value(sd), bounds=(low, high), method="bounded", options={"xatol": 1e-4 * unit}
    )
    sd, peak = (
        (float(best.x), -float(best.fun))
        if -best.fun > likelihood[top]
        else (float(grid[top]), float(likelihood[top]))
    )
    inside = 2.0 * (peak - likelihood) <= CHI_SQUARED_QUANTILE
    ends = []
    for side in (-1, 1):
        at = np.flatnonzero(inside)[0 if side < 0 else -1] if inside.any() else top
        beyond = at + side
        if beyond < 0 or beyond >= len(grid):
            ends.append(float(grid[at]))
            continue
        a, b = float(grid[at]), float(grid[beyond])
        if not inside.any():
            a = sd
        # bisection: twenty halves are below any digit that is shown
        for _ in range(20):
            middle = 0.5 * (a + b)
            a, b = (middle, b) if 2.0 * (peak - value(middle)) <= CHI_SQUARED_QUANTILE else (a, middle)
        ends.append(a)
    x, v = used[0]
    weight = 1.0 / (v + sd * sd)
    mean = float(weight @ x / weight.sum()) if len(used) == 1 else NAN
    return Component(
        mean,
        float(weight.sum() ** -0.5) if len(used) == 1 else NAN,
        Interval(sd, min(ends[0], sd), max(ends[1], sd)),
    )


def restricted_log_likelihood(x: Array, variance: Array, between: float) -> float:
    """Of values N(mean, variance + between) whose mean is integrated out, without constants (Harville 1977, eq. 4).

    Args:
        x: (n,).
        variance: (n,) known.
        between: variance that is added.

    >>> round(restricted_log_likelihood(np.array([0.0, 2.0]), np.array([1.0, 1.0]), 0.0), 4)  # a difference: N(0, 2)
    -1.3466
    """
    total = variance + between
    weight = 1.0 / total
    all_weight = float(weight.sum())
    mean = float(weight @ x) / all_weight
    return float(-0.5 * (np.log(total).sum() + np.log(all_weight) + weight @ (x - mean) ** 2))


def covariance(groups: Sequence[tuple[Array, Array]]) -> Covariance | None:
    """Restricted maximum likelihood of a covariance within groups, by expectation-maximisation (Laird & Ware 1982).

    Args:
        groups: values (n, d) and their sampling covariances (n, d, d), of each group with its own mean.

    Returns:
        Mean (over all groups) and covariance between members; None where no group has more members than parameters.
    """
    used = [(x, R) for x, R in groups if len(x) > x.shape[1]]
    if not used:
        return None
    everything = np.concatenate([x - x.mean(axis=0) for x, _ in used])
    mean_R = np.concatenate([R for _, R in used]).mean(axis=0)
    # parameters correlate at -0.9999: in units of their sampling covariance they are alike
    L = np.linalg.cholesky(mean_R)
    back = np.linalg.inv(L)
    white = [(x @ back.T, back @ R @ back.T) for x, R in used]
    scatter = np.cov((everything @ back.T).T)
    values, vectors = np.linalg.eigh(scatter - np.eye(len(L)))
    between = vectors @ np.diag(np.maximum(values, 0.05)) @ vectors.T
    means: list[Array] = []
    spread: list[Array] = []
    for _ in range(_STEPS):
        total, count = np.zeros_like(between), 0
        means, spread = [], []
        for x, R in white:
            W = np.linalg.inv(R + between)
            of_mean = np.linalg.inv(W.sum(axis=0))
            mean = of_mean @ np.einsum("kij,kj->i", W, x)
            gain = between @ W
            u = np.einsum("kij,kj->ki", gain, x - mean)
            # posterior variance of each member's effect, the mean's own error included
            P = between - gain @ between + gain @ of_mean @ gain.swapaxes(1, 2)
            total += u.T @ u + P.sum(axis=0)
            count += len(x)
            means.append(mean)
            spread.append(of_mean)
        new = total / count
        change = float(np.abs(new - between).max())
        between = new
        if change <= _ENOUGH * float(np.trace(between)):
            break
    n = len(means)
    middle, error = np.mean(means, axis=0), np.sum(spread, axis=0) / n**2
    return Covariance(L @ middle, L @ error @ L.T, L @ between @ L.T)


def split(names: Sequence[str], drivers: Sequence[tuple[Array, Array]]) -> list[Split]:
    """Split each parameter's standard deviation.

    Two stages: between minutes with a mean per driver; between drivers on those means, whose sampling variance holds the
    minutes.

    Args:
        names: (d,) of the parameters.
        drivers: values (n, d) and sampling covariances (n, d, d), of each driver.
    """
    out = []
    for j, name in enumerate(names):
        groups = [(x[:, j], R[:, j, j]) for x, R in drivers]
        everything = np.concatenate([x for x, _ in groups])
        minutes = component(groups).sd
        means, variances = [], []
        for x, v in groups:
            if len(x) and np.isfinite(minutes.value):
                weight = 1.0 / (v + minutes.value**2)
                means.append(float(weight @ x / weight.sum()))
                variances.append(float(1.0 / weight.sum()))
        between = component([(np.array(means), np.array(variances))]).sd if len(means) > 1 else Interval()
        out.append(
            Split(
                name,
                float(everything.std(ddof=1)) if len(everything) > 1 else NAN,
                float(np.sqrt(np.mean(np.concatenate([v for _, v in groups])))),
                minutes,
                between,
            )
        )
    return out


def equal_means(groups: Sequence[tuple[Array, Array]]) -> float:
    """P value of equal mean parameters of several logs, between-minute variation allowed for (Wald test).

    Args:
        groups: values (n, d) and sampling covariances (n, d, d), of each log.

    Returns:
        NaN where fewer than two logs have more segments than parameters.

    >>> rng = np.random.default_rng(0)
    >>> R = np.tile(np.eye(2), (30, 1, 1))
    >>> first, other = rng.normal(size=(2, 30, 2))
    >>> equal_means([(first, R), (other, R)]) > 0.01, equal_means([(first, R), (other + 2.0, R)]) < 1e-6
    (True, True)
    """
    used = [(x, R) for x, R in groups if len(x) > x.shape[1]]
    estimated = covariance(used)
    if len(used) < 2 or estimated is None:
        return NAN
    information, along, means = [], [], []
    for x, R in used:
        W = np.linalg.inv(R + estimated.between)
        information.append(W.sum(axis=0))
        along.append(np.einsum("kij,kj->i", W, x))
        means.append(np.linalg.solve(information[-1], along[-1]))
    common = np.linalg.solve(np.sum(information, axis=0), np.sum(along, axis=0))
    statistic = sum(float((m - common) @ H @ (m - common)) for m, H in zip(means, information, strict=True))
    return float(chi2.sf(statistic, (len(used) - 1) * len(common)))


def shown(x: Interval) -> str:
    """A standard deviation with its interval in words.

    >>> shown(Interval(1.0, 0.5, 2.0)), shown(Interval())
    ('1.00 [0.50, 2.00]', 'not identifiable')
    """
    return f"{x.value:.2f} [{x.low:.2f}, {x.high:.2f}]" if np.isfinite(x.value) else "not identifiable"
