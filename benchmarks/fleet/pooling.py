"""Coverage of the population's intervals on simulated fleets, `python -m benchmarks.fleet.pooling [--fleets N]`.

Each row is a kind of fleet: 2 to 30 drivers of 1 to 12 drives, errors that differ by drive and parameter, a tenth of the
estimates hardly known, 15 % missing, all correlated. Coverage of 95 % intervals of the population's mean, the standard
deviations between and within drivers, the shrunken estimates, and a new driver's drive; and drives called outliers. In the
last columns REML-like plug-in intervals of the mean for comparison: Paule & Mandel's spread of the drivers' means, each
parameter by itself, normal quantiles.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, QUANTILES
from canid.mathematics.population import gibbs, normal_mixture, spread
from canid.values.types import Array
from tests.plants.many_fleets import Fleets, Layout, draw, sampler_data

LAYOUTS = (
    Layout("2 drivers", 2, 6, 2, 1.0, 0.4),
    Layout("3 drivers, few drives", 3, 4, 2, 1.0, 0.4),
    Layout("4 drivers, 1 or 2 drives", 4, 2, 3, 1.0, 0.4),
    Layout("4 drivers", 4, 12, 3, 0.5, 0.3),
    Layout("8 drivers, B = W", 8, 4, 2, 0.5, 0.5),
    Layout("8 drivers, B small", 8, 6, 4, 0.2, 0.5),
    Layout("8 drivers, B = 0", 8, 4, 2, 0.0, 0.4),
    Layout("8 drivers, W = 0", 8, 4, 2, 1.0, 0.0),
    Layout("12 drivers, one drive each", 12, 1, 2, 1.0, 0.5),
    Layout("30 drivers", 30, 12, 2, 1.0, 0.4),
    Layout("30 drivers, 4 parameters", 30, 3, 4, 1.0, 0.4),
    Layout("12 drivers, 10 % outliers", 12, 6, 2, 1.0, 0.4, outliers=0.1),
    Layout("30 drivers, 10 % outliers", 30, 6, 3, 1.0, 0.4, outliers=0.1),
)
BURN, KEEP = 300, 900


class Row(NamedTuple):
    """Coverages, 0 to 1, of one layout."""

    layout: Layout
    drives: int
    mean: float
    between: float
    within: float
    driver: float
    new_driver: float
    flagged: float  # share of ordinary drives that are called outliers
    found: float  # share of outliers that are; NaN: there are none
    plug_in: float
    seconds: float


def coverage(ends: tuple[Array, Array] | Array, truth: Array | float) -> float:
    """Share of intervals, low ends and high ends, that hold the truth."""
    low, high = ends
    return float(np.mean((low <= truth) & (truth <= high)))


def measure(
    layout: Layout, fleets: int, seed: int, burn: int = BURN, keep: int = KEEP, *, compare: bool = True
) -> Row:
    """Draw, sample, and count."""
    rng = np.random.default_rng(seed)
    of = draw(rng, layout, fleets)
    data, centre, unit = sampler_data(of)
    begin = time.perf_counter()
    draws = gibbs.sample(data, np.random.default_rng(0), burn, keep)
    seconds = time.perf_counter() - begin
    mean = draws.mean[:, :, 0] * unit.T + centre.T  # (D, R, p)
    between, within = (np.sqrt(np.einsum("drkk->drk", x)) * unit.T for x in (draws.between, draws.within))
    own = draws.deviation * unit[..., None] + np.moveaxis(mean, -1, 1)[..., None]
    ends = [spread.interval(x.reshape(len(x), -1)) for x in (between, within)]
    total = np.hypot(between, within)
    new = np.hypot(layout.between, layout.within) * rng.standard_normal(mean.shape[1:])
    outlier = draws.drive_outlier > 0.5
    return Row(
        layout,
        len(of.who),
        coverage(np.quantile(mean, QUANTILES, axis=0), 0.0),
        coverage(ends[0], layout.between),
        coverage(ends[1], layout.within),
        coverage(np.quantile(own, QUANTILES, axis=0), of.driver),
        coverage(np.array([normal_mixture.quantile(mean[::3], total[::3], q) for q in QUANTILES]), new),
        float(outlier[~of.bad].mean()),
        float(outlier[of.bad].mean()) if of.bad.any() else np.nan,
        coverage(plug_in(of), 0.0) if compare else np.nan,
        seconds,
    )


def plug_in(of: Fleets) -> tuple[Array, Array]:
    """Intervals of the mean as most programs state them, ((p, R) each): univariate, both spreads taken for known."""
    p, fleets, _ = of.y.shape
    out = np.full((2, p, fleets), np.nan)
    for k in range(p):
        for r in range(fleets):
            has = of.known[k, r]
            y, v, who = of.y[k, r, has], of.s[k, k, r, has], of.who[has]
            w2 = paule_mandel(y, v, who)
            means, variances = [], []
            for driver in np.unique(who):
                weight = 1.0 / (v[who == driver] + w2)
                means.append(float(weight @ y[who == driver] / weight.sum()))
                variances.append(1.0 / float(weight.sum()))
            m, v = np.array(means), np.array(variances)
            weight = 1.0 / (v + paule_mandel(m, v, np.zeros(len(m), dtype=np.intp)))
            centre, half = float(weight @ m / weight.sum()), NORMAL_QUANTILE * float(weight.sum()) ** -0.5
            out[:, k, r] = centre - half, centre + half
    return out[0], out[1]


def paule_mandel(y: Array, v: Array, who: Array) -> float:
    """Variance beyond errors v about the means of the groups `who` (Paule & Mandel 1982)."""
    freedom = len(y) - len(np.unique(who))

    def squares(of: float) -> float:
        weight = 1.0 / (v + of)
        mean = np.bincount(who, weight * y) / np.maximum(np.bincount(who, weight), 1e-300)
        return float(weight @ (y - mean[who]) ** 2)

    if freedom < 1 or squares(0.0) <= freedom:
        return 0.0
    low, high = 0.0, 1.0
    while squares(high) > freedom:
        high *= 2.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if squares(middle) > freedom else (low, middle)
    return high


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=100, help="of each layout")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    print(
        "| fleet | drives | mean | between | within | driver | new driver | flagged | found | plug-in mean | s |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    rows = []
    for k, layout in enumerate(LAYOUTS):
        row = measure(layout, args.fleets, args.seed + k)
        rows.append(row)
        numbers = " | ".join(f"{x:.3f}" for x in row[2:10])
        print(f"| {layout.name} | {row.drives} | {numbers} | {row.seconds:.0f} |", flush=True)
    numbers = " | ".join(f"{np.nanmean([row[k] for row in rows]):.3f}" for k in range(2, 10))
    print(f"| all, {args.fleets * len(rows)} fleets | | {numbers} | |")


if __name__ == "__main__":
    main()
