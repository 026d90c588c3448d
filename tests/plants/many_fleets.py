"""Simulated fleets of one layout, many at once: each is a chain of the sampler with data of its own.

Truth by plain draws of normal distributions, which share no code with the model's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.population import gibbs, scaling
from canid.mathematics.population.drive_table import DriveTable, Flags, Index
from canid.values.types import Array


class Layout(NamedTuple):
    """Of one kind of fleet."""

    name: str
    drivers: int
    most_drives: int  # of a driver; each has 1 to so many
    parameters: int
    between: float  # sd
    within: float
    outliers: float = 0.0  # share of drives with a gross error of 10 to 100
    hidden: float = 0.15  # share of estimates that are missing
    unknown: float = 0.1  # share of estimates with a hundred times the error


class Fleets(NamedTuple):
    """R fleets of n drives of I drivers."""

    who: Index  # (n,)
    y: Array  # (p, R, n)
    s: Array  # (p, p, R, n)
    known: Flags  # (p, R, n)
    driver: Array  # (p, R, I) true mean of each driver; the population's is 0
    drive: Array  # (p, R, n) truth of each drive
    bad: Flags  # (R, n)


def correlation(rng: np.random.Generator, p: int) -> Array:
    """A correlation matrix, neither near the identity nor near a singular one."""
    a = rng.standard_normal((p, p + 1))
    c = a @ a.T
    d = np.sqrt(np.diag(c))
    return np.asarray(c / np.outer(d, d))


def draw(rng: np.random.Generator, of: Layout, fleets: int) -> Fleets:
    """Draw fleets whose errors differ by drive and parameter, log-normal about 0.3."""
    p = of.parameters
    who = np.repeat(np.arange(of.drivers), rng.integers(1, of.most_drives + 1, of.drivers)).astype(np.intp)
    n = len(who)
    roots = [np.linalg.cholesky(correlation(rng, p)) for _ in range(3)]
    b = np.einsum("kl,lri->kri", roots[0], rng.standard_normal((p, fleets, of.drivers))) * of.between
    u = np.einsum("kl,lrn->krn", roots[1], rng.standard_normal((p, fleets, n))) * of.within
    sd = 0.3 * np.exp(0.7 * rng.standard_normal((p, fleets, n)))
    sd = np.where(rng.random(sd.shape) < of.unknown, 100.0 * sd, sd)
    error = np.einsum("kl,lrn->krn", roots[2], rng.standard_normal((p, fleets, n))) * sd
    bad = rng.random((fleets, n)) < of.outliers
    gross = bad * rng.choice([-1.0, 1.0], sd.shape) * rng.uniform(10.0, 100.0, sd.shape)
    known = rng.random(sd.shape) >= of.hidden
    # at least one estimate of each parameter
    known[..., 0] |= ~known.any(axis=-1)
    drive = b[:, :, who] + u
    s = (roots[2] @ roots[2].T)[:, :, None, None] * sd[:, None] * sd[None]
    return Fleets(who, drive + error + gross, s, known, b, drive, bad)


def tables(of: Fleets) -> list[DriveTable]:
    """As tables, one per fleet."""
    p, fleets, n = of.y.shape
    out = []
    for r in range(fleets):
        both = of.known[:, None, r] & of.known[None, :, r]
        out.append(
            DriveTable(
                tuple(f"p{k}" for k in range(p)),
                np.where(of.known[:, r], of.y[:, r], np.nan).T,
                np.moveaxis(np.where(both, of.s[:, :, r], np.nan), -1, 0),
                of.who,
                tuple(f"driver {k}" for k in range(int(of.who[-1]) + 1)),
                tuple(f"drive {k}" for k in range(n)),
                np.full(n, np.nan),
                ("",) * n,
                ("",) * n,
            )
        )
    return out


def sampler_data(of: Fleets) -> tuple[gibbs.Data, Array, Array]:
    """For one run of the sampler over all fleets; and centres and units of each, (p, R)."""
    found = [scaling.units(table, of.known[:, r].T) for r, table in enumerate(tables(of))]
    centre, unit = (np.array([one[k] for one in found]).T for k in range(2))
    both = of.known[:, None] & of.known[None, :]
    data = gibbs.Data(
        np.where(of.known, (of.y - centre[..., None]) / unit[..., None], 0.0),
        np.where(both, of.s / (unit[:, None] * unit[None])[..., None], 0.0),
        of.known,
        of.who,
        np.zeros(len(of.who), dtype=np.intp),
    )
    return data, centre, unit
