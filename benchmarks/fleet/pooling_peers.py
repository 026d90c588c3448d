"""The pool of canid, an exact posterior on a grid, and statsmodels' MixedLM on the same simulated fleets of one parameter.

    python -m benchmarks pooling_peers [--fleets 40] [--seed S]

How often 95 % intervals hold the truth, and how wide they are next to the exact posterior's. MixedLM (restricted likelihood)
takes no errors of the estimates, which are therefore in its spread within a driver, and states no interval of a spread.
40 fleets take 2 to 3 minutes of CPU.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import warnings
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from scipy.stats import norm

from canid.mathematics.population import gibbs, scaling
from canid.mathematics.population.drive_table import drive_table, known
from canid.mathematics.population.hierarchical import pool
from canid.values.types import Array
from tests.population.exact_posterior import exact

# drivers, and drives of each
LAYOUTS = ((3, 3), (6, 4), (12, 5))
MEAN, BETWEEN, WITHIN = 5.0, 1.0, 0.4
# errors of the estimates, as standard deviations
ERRORS = (0.1, 0.5)
LEVEL = (0.025, 0.975)
QUANTITIES = ("mean", "between", "within", "drivers")
ROUTES = ("canid", "exact", "MixedLM")


class Of(NamedTuple):
    """Intervals of one quantity by one route: lows and highs, (m,) each."""

    low: Array
    high: Array


def main(argv: Sequence[str] | None = None) -> int:
    """Simulate, pool by all routes, print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks pooling_peers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--fleets", type=int, default=40, metavar="N", help="of each layout")
    parser.add_argument("--seed", type=int, help="of the first fleet; default: drawn")
    args = parser.parse_args(argv)
    first = secrets.randbelow(10**6) if args.seed is None else args.seed
    print(f"Seeds from {first}.\n")
    heads = [
        "drivers; drives of each",
        "route",
        *QUANTITIES,
        *(f"width: {quantity}" for quantity in QUANTITIES),
    ]
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for n, (drivers, drives) in enumerate(LAYOUTS):
        hits: dict[tuple[str, str], list[bool]] = defaultdict(list)
        widths: dict[tuple[str, str], list[float]] = defaultdict(list)
        for k in range(args.fleets):
            for route, of, truth in one(drivers, drives, first + n * args.fleets + k):
                for quantity, (low, high) in of.items():
                    hits[route, quantity] += ((low <= truth[quantity]) & (truth[quantity] <= high)).tolist()
                    widths[route, quantity].append(float(np.mean(high - low)))
        for route in ROUTES:
            shares = [hits[route, quantity] for quantity in QUANTITIES]
            ratios = [
                float(np.median(np.divide(widths[route, quantity], widths["exact", quantity])))
                if widths[route, quantity]
                else np.nan
                for quantity in QUANTITIES
            ]
            cells = [f"{sum(share)}/{len(share)}" if share else "–" for share in shares]
            cells += [f"{ratio:.2f}" if np.isfinite(ratio) else "–" for ratio in ratios]
            print(f"| {drivers}; {drives} | {route} | {' | '.join(cells)} |", flush=True)
    return 0


def one(drivers: int, drives: int, seed: int) -> list[tuple[str, dict[str, Of], dict[str, Array]]]:
    """One fleet by each route, with its truth."""
    rng = np.random.default_rng(seed)
    who = np.repeat(np.arange(drivers), drives)
    persons = rng.normal(MEAN, BETWEEN, drivers)
    sd = rng.uniform(*ERRORS, who.size)
    y = persons[who] + rng.normal(0.0, WITHIN, who.size) + sd * rng.standard_normal(who.size)
    truth = {
        "mean": np.array([MEAN]),
        "between": np.array([BETWEEN]),
        "within": np.array([WITHIN]),
        "drivers": persons,
    }
    table = drive_table(("K",), y[:, None], sd[:, None] ** 2, tuple(f"{k:03d}" for k in who))
    pooled = pool(table)
    ours = {
        "mean": Of(pooled.mean.low, pooled.mean.high),
        "between": Of(pooled.between.low, pooled.between.high),
        "within": Of(pooled.within.low, pooled.within.high),
        "drivers": Of(pooled.driver.low[:, 0], pooled.driver.high[:, 0]),
    }
    unit = float(scaling.units(table, known(table)).size[0])
    drawn = exact(y, sd**2, who, (gibbs.SCALE[0] * unit, gibbs.SCALE[1] * unit), seed)
    theirs = {
        name: Of(*np.quantile(draws.reshape(len(draws), -1), LEVEL, axis=0))
        for name, draws in zip(QUANTITIES, drawn, strict=True)
    }
    return [("canid", ours, truth), ("exact", theirs, truth), ("MixedLM", mixed(y, who), truth)]


def mixed(y: Array, who: Array) -> dict[str, Of]:
    """Intervals of statsmodels: of the mean, and of each driver by the mode and covariance of the random effect."""
    from statsmodels.regression.mixed_linear_model import MixedLM

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a spread of 0 is at its bound
        fitted = MixedLM(y, np.ones((y.size, 1)), groups=who).fit(reml=True)
        try:
            effects, covariances = fitted.random_effects, fitted.random_effects_cov
        except ValueError:  # of a spread of 0 there is none
            effects = covariances = {}
    z = norm.ppf(LEVEL)
    mean, se = float(fitted.fe_params[0]), float(fitted.bse_fe[0])
    ends = np.array([mean + z * se])
    out = {"mean": Of(ends[:, 0], ends[:, 1])}
    if effects:
        each = np.array([float(np.asarray(effects[k])[0]) for k in sorted(effects)])
        sd = np.array([float(np.asarray(covariances[k]).ravel()[0]) ** 0.5 for k in sorted(effects)])
        out["drivers"] = Of(mean + each + z[0] * sd, mean + each + z[1] * sd)
    return out


if __name__ == "__main__":
    sys.exit(main())
