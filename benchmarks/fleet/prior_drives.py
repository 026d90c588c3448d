"""Simulated fleets with a hidden population, and what the benchmark of the population's prior needs of each drive.

Populations are drawn anew for each fleet: mean and spread of gains, lags and dead times, and the correlation of the gains;
drivers are drawn from the population, and nobody who estimates sees either. Both planting simulators of the tests, which
share no code with canid; all kinds of noise and leads.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.analysis.drive.drive_parameters import identify
from canid.analysis.fleet.one_log.joint_estimate import joint_estimate
from canid.mathematics.estimators import fopdt
from canid.mathematics.estimators.fopdt_whole_drive import Fitting
from canid.mathematics.estimators.whole_drive import settings_of
from canid.mathematics.identification.fopdt.prior import Prior
from canid.mathematics.population.drive_table import DriveTable, drive_table
from canid.signals.samples.trace_assembly import part
from canid.values.types import Array, Channel, Identifiable, Trace
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace
from tests.plants.planted_drive import NOISES, PROFILES

MINUTES = 4.0
# s of the first minute
FIRST_S = 60.0
NAMES = (
    "headway_error.K",
    "range_rate.K",
    "headway_error.log_tau_plus_dead_time",
    "range_rate.log_tau_plus_dead_time",
)
# statuses from which a fleet takes tau + dead time; gains from all drives: canid.analysis.fleet.answers.estimates,
# `every_gain`
SUM = (Identifiable.OK, Identifiable.SUM_ONLY)


class People(NamedTuple):
    """A hidden population."""

    K: Array  # (2,) mean, % per s and % per m/s
    K_sd: Array  # (2,)
    correlation: float
    tau: Array  # (2,) s, median
    tau_factor: float
    dead_time: Array  # (2,) s
    dead_time_sd: float  # s
    noise_sd: float  # %


class Drive(NamedTuple):
    """A drive, its truth, and what a fleet estimates of it."""

    first: Trace  # its first minute
    whole: Trace
    truth: Mapping[str, float]
    of_fleet: tuple[Array, Array]  # (4,), (4, 4) of `NAMES`; NaN: not known


def people(rng: np.random.Generator) -> People:
    """Draw a population: gains about those of Grover's driver (2021), differing by 12 to 30 %; reactions in traffic."""
    K = np.array([rng.uniform(5.0, 7.0), rng.uniform(5.0, 6.5)])
    return People(
        K,
        K * np.array([rng.uniform(0.15, 0.3), rng.uniform(0.12, 0.25)]),
        rng.uniform(0.0, 0.6),
        rng.uniform(0.35, 0.55, 2),
        math.exp(rng.uniform(0.15, 0.3)),
        rng.uniform(0.25, 0.45, 2),
        rng.uniform(0.05, 0.1),
        rng.uniform(1.5, 2.5),
    )


def driver(of: People, rng: np.random.Generator, off: tuple[float, float] = (0.0, 0.0)) -> dict[str, float]:
    """Draw a driver; `off`: standard deviations by which the gains are moved instead of drawn, where not 0."""
    r = of.correlation
    while True:
        z = rng.multivariate_normal(np.zeros(2), [[1.0, r], [r, 1.0]])
        K = of.K + of.K_sd * np.where(np.array(off) != 0.0, off, z)
        # a driver who hardly answers does not follow
        if (K > 1.0).all():
            break
    tau = of.tau * np.exp(math.log(of.tau_factor) * rng.standard_normal(2))
    dead_time = np.maximum(of.dead_time + of.dead_time_sd * rng.standard_normal(2), 0.05)
    return {
        "K1": float(K[0]),
        "K2": float(K[1]),
        "tau1": float(tau[0]),
        "tau2": float(tau[1]),
        "dead_time1": float(dead_time[0]),
        "dead_time2": float(dead_time[1]),
        "noise_sd": float(of.noise_sd * math.exp(0.2 * rng.standard_normal())),
    }


def drive(number: int, of: Mapping[str, float], seed: int) -> Drive:
    """Simulate a drive; `number` chooses simulator, noise and lead."""
    given: dict[str, Any] = dict(of)
    simulate = (plant_one.plant, plant_two.plant)[number % 2]
    if number % 2:
        # its answers have one lag
        del given["tau1"]
    planted = simulate(
        {},
        seed=seed,
        minutes=MINUTES,
        noise=NOISES[number // 2 % len(NOISES)],
        profile=PROFILES[number % len(PROFILES)],
        **given,
    )
    whole = trace(planted)
    return Drive(head(whole, FIRST_S), whole, planted.truth["driver"], fleet_estimate(whole))


def head(of: Trace, seconds: float) -> Trace:
    """The first seconds of a drive."""
    return part(of, slice(0, int(np.searchsorted(of.t, of.t[0] + seconds + 0.5 * of.dt))))


def fleet_estimate(of: Trace) -> tuple[Array, Array]:
    """What `canid fleet prior` takes of a drive, with the covariance."""
    found = identify(of, select_orders=False, sliding=False)
    joint = joint_estimate(found)
    if joint is None:
        return np.full(4, np.nan), np.full((4, 4), np.nan)
    places = [joint.names.index(name) for name in NAMES]
    estimate, covariance = joint.mean[places], joint.covariance[np.ix_(places, places)]
    for k, name in enumerate(NAMES):
        channel, _, parameter = name.partition(".")
        if parameter != "K" and found.channels[channel].status not in SUM:
            estimate[k], covariance[k], covariance[:, k] = np.nan, np.nan, np.nan
    return estimate, covariance


def table(drives: Sequence[Drive]) -> DriveTable:
    """One drive each of several drivers."""
    estimate, covariance = (np.array(x) for x in zip(*(one.of_fleet for one in drives), strict=True))
    return drive_table(NAMES, estimate, covariance, tuple(f"driver {k}" for k in range(len(drives))))


def channels(of: Trace, prior: Prior | None) -> Mapping[str, Channel]:
    """The fit of a trace as one window, as live: all intervals, whether they may be quoted or not."""
    settings = settings_of(fopdt.FOPDT, of, {})
    how = Fitting(settings.tau_max, settings.dead_time_max, prior, settings.output_filter)
    return dict(zip(of.input_names, how.fit(of, slice(None)).channels, strict=True))
