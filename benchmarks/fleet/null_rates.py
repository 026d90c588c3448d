"""How often comparisons of drivers and groups find what is not there, `python -m benchmarks null_rates [--fleets N]`.

Simulated fleets in which the null hypothesis holds: correlated parameters, errors that differ by drive. Printed are the
rates of p < 5 % and p < 1 % with the exact 95 % interval of the first (Clopper & Pearson 1934), and last the rate at which a
true difference of two standard deviations between drivers in one parameter is found at 5 %, on a quarter of the fleets.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from canid.mathematics.population.change_over_time import WEEK_S, change_over_time
from canid.mathematics.population.drive_table import DriveTable, drive_table
from canid.mathematics.population.groups import contrasts
from canid.mathematics.population.hierarchical import pool
from canid.mathematics.population.same_driver import drives_fit, pairs
from canid.values.types import Array
from tests.plants.many_fleets import correlation

DRIVES = 5
BETWEEN, WITHIN = 1.0, 0.4
EFFECT = 2.0 * BETWEEN


class Fleet(NamedTuple):
    """Of one layout."""

    drivers: int
    parameters: int


FLEETS = (Fleet(4, 5), Fleet(12, 1), Fleet(12, 5))


def fleet(rng: np.random.Generator, of: Fleet, mean: Array, shift: Array | float = 0.0) -> DriveTable:
    """Drives about the drivers' means (I, p), each with a shift (n, p)."""
    n, p = of.drivers * DRIVES, of.parameters
    roots = [np.linalg.cholesky(correlation(rng, p)) for _ in range(2)]
    who = np.repeat(np.arange(of.drivers), DRIVES)
    sd = 0.3 * np.exp(0.4 * rng.standard_normal((n, p)))
    y = mean[who] + shift + WITHIN * rng.standard_normal((n, p)) @ roots[0].T
    y += sd * (rng.standard_normal((n, p)) @ roots[1].T)
    covariance = (roots[1] @ roots[1].T)[None] * sd[:, :, None] * sd[:, None]
    weeks = np.tile(np.linspace(0.0, 20.0, DRIVES), of.drivers)
    return drive_table(
        tuple(f"p{k}" for k in range(p)), y, covariance, tuple(f"{k}" for k in who), start=weeks * WEEK_S
    )


def means(rng: np.random.Generator, of: Fleet) -> Array:
    """True means of the drivers, (I, p)."""
    root = np.linalg.cholesky(correlation(rng, of.parameters))
    return np.asarray(BETWEEN * rng.standard_normal((of.drivers, of.parameters)) @ root.T)


def groups_of_drivers(effect: float, of: Fleet, seed: int) -> Array:
    """Every second driver drives the other car."""
    rng = np.random.default_rng([1, seed])
    mean = means(rng, of)
    mean[1::2, 0] += effect
    table = fleet(rng, of, mean)
    return contrasts(table, tuple("ab"[k % 2] for k in table.driver)).p_value


def groups_within_drivers(effect: float, of: Fleet, seed: int) -> Array:
    """Each driver has both settings, in some of the drives."""
    rng = np.random.default_rng([2, seed])
    setting = np.tile(np.arange(DRIVES) % 2, of.drivers)
    shift = np.zeros((of.drivers * DRIVES, of.parameters))
    shift[:, 0] = effect * setting
    table = fleet(rng, of, means(rng, of), shift)
    return contrasts(table, tuple("ab"[k] for k in setting)).p_value


def same_person(effect: float, of: Fleet, seed: int) -> Array:
    """The last driver is the first under another name."""
    rng = np.random.default_rng([3, seed])
    mean = means(rng, of)
    mean[-1] = mean[0]
    mean[-1, 0] += effect
    table = fleet(rng, of, mean)
    found = pairs(table, pool(table))
    return found.p_value[(found.a == 0) & (found.b == of.drivers - 1)]


def drive_of_its_driver(effect: float, of: Fleet, seed: int) -> Array:
    """Every drive is of the driver that it is labelled with; with an effect, the last one is not."""
    rng = np.random.default_rng([4, seed])
    shift = np.zeros((of.drivers * DRIVES, of.parameters))
    shift[-1, 0] = effect
    table = fleet(rng, of, means(rng, of), shift)
    return drives_fit(table, pool(table)).p_value[-1 if effect else 0 :]


def no_change(effect: float, of: Fleet, seed: int) -> Array:
    """Nobody changes over 20 weeks; with an effect, the last driver does, from the first week to the last."""
    rng = np.random.default_rng([5, seed])
    shift = np.zeros((of.drivers * DRIVES, of.parameters))
    shift[-DRIVES:, 0] = effect * np.linspace(-0.5, 0.5, DRIVES)
    table = fleet(rng, of, means(rng, of), shift)
    return change_over_time(table, pool(table)).p_value[-1 if effect else 0 :]


QUESTIONS: dict[str, Callable[[float, Fleet, int], Array]] = {
    "groups of different drivers": groups_of_drivers,
    "groups within drivers": groups_within_drivers,
    "two names of one person": same_person,
    "a drive of its driver": drive_of_its_driver,
    "no change over weeks": no_change,
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=100, help="of each row")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=sorted(QUESTIONS), action="append", help="questions; default: all")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    print("| question | drivers | parameters | tests | p < 5 % | 95 % interval | p < 1 % | effect found |")
    print("|---|---|---|---|---|---|---|---|")
    seeds = range(args.seed, args.seed + args.fleets)
    with ProcessPoolExecutor(args.workers) as workers:
        for name, question in QUESTIONS.items():
            if args.only and name not in args.only:
                continue
            for of in FLEETS:
                p = np.concatenate(list(workers.map(partial(question, 0.0, of), seeds)))
                effect = np.concatenate(
                    list(workers.map(partial(question, EFFECT, of), seeds[: -(-len(seeds) // 4)]))
                )
                p = p[np.isfinite(p)]
                exact = binomtest(int(np.sum(p < 0.05)), len(p)).proportion_ci()
                print(
                    f"| {name} | {of.drivers} | {of.parameters} | {len(p)} | {np.mean(p < 0.05):.3f} | "
                    f"{exact.low:.3f} to {exact.high:.3f} | {np.mean(p < 0.01):.3f} | {np.mean(effect < 0.05):.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
