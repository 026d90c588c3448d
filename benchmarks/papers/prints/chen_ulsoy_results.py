"""All that is recomputed from the printed numbers of Chen & Ulsoy 2001."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.papers.prints import (
    constant_driver,
    crossover,
    noise_rolloff,
    odd_even,
    prediction_error_orders,
    reverse_arrangements,
    steering_tables,
    uncertainty_bound,
)
from canid.values.types import Array
from canid_study.chen_ulsoy import steering_distribution
from canid_study.chen_ulsoy.one_track_car import OneTrackCar, matrices
from canid_study.printed_numbers import (
    FPE_PARAMETERS,
    SEGMENT_SAMPLES,
    SEGMENTS,
    STEERING_TABLES,
    SteeringTable,
)

SEED = 1
# independent drives of two hours behind each number of a constant driver, whose error is their scatter
DRAWS = 8
# of the fitted distribution: its 5 and 95 % points are within 0.5 % of those of two million draws
DISTRIBUTION_POINTS = 2**14


class Results(NamedTuple):
    """Of eq. 1 to 5, Tables 1 and 2, Fig. 10 and 12."""

    means: tuple[steering_tables.MeanModel, ...]  # of each of STEERING_TABLES
    draws: tuple[steering_tables.IndependentDraws, ...]
    needed: tuple[steering_tables.Correlation, ...]
    estimation: tuple[SteeringTable, ...]  # Tables 1 and 2, odd segments
    parameters: tuple[steering_distribution.Parameters, ...]  # fitted to each of `estimation`
    fitted: tuple[steering_distribution.Statistics, ...]
    models: tuple[Array, ...]  # (4, 2**14) of each
    crossovers: tuple[crossover.Crossover, ...]
    ratios: tuple[uncertainty_bound.BoundRatio, ...]  # of each of `estimation`
    fpe: float
    falls_db: tuple[float, float]  # least and most
    odd_even: tuple[odd_even.OddEven, ...]
    eleven: tuple[tuple[float, float], ...]  # mean and sd of the others, each parameter
    constant: tuple[constant_driver.ConstantDriver, ...]  # of Table 1, by c1 and draw
    changing_z: float  # of 2 h in which each minute has another driver
    car_modes_hz: tuple[float, float]  # natural frequencies of the one-track car over the speeds


def results() -> Results:
    """Recompute everything."""
    estimation = tuple(t for t in STEERING_TABLES if t.part == "estimation")
    parameters = tuple(steering_distribution.fit(t) for t in estimation)
    normals = steering_distribution.sobol_normals(DISTRIBUTION_POINTS)
    falls = [noise_rolloff.fall_db(t, c1) for t in STEERING_TABLES for c1 in noise_rolloff.C1_RANGE]
    return Results(
        tuple(steering_tables.mean_model(t) for t in STEERING_TABLES),
        tuple(steering_tables.independent_draws(t, SEED) for t in STEERING_TABLES),
        tuple(steering_tables.correlation_needed(t) for t in STEERING_TABLES),
        estimation,
        parameters,
        tuple(steering_distribution.statistics(p, normals) for p in parameters),
        tuple(steering_distribution.from_normals(p, normals) for p in parameters),
        crossover.crossovers(),
        tuple(uncertainty_bound.bound_ratio(t) for t in estimation),
        float(prediction_error_orders.fpe_factor(FPE_PARAMETERS, SEGMENT_SAMPLES)),
        (min(falls), max(falls)),
        odd_even.odd_even(),
        tuple(odd_even.other_eleven(k) for k in range(len(odd_even.PARAMETERS))),
        tuple(
            constant_driver.constant_driver(estimation[0], c1, SEED + DRAWS * i + k)
            for i, c1 in enumerate(constant_driver.C1_VALUES)
            for k in range(DRAWS)
        ),
        _changing(estimation[0], parameters[0]),
        _car_modes(),
    )


def _changing(table: SteeringTable, parameters: steering_distribution.Parameters) -> float:
    """Z of the reverse arrangements of 2 h of steering of a driver who is another one each minute."""
    rng = np.random.default_rng(SEED)
    models: list[tuple[float, float, float, float]] = []
    while len(models) < SEGMENTS:
        a1, a2, b1, b2 = (float(x) for x in steering_distribution.draw(parameters, rng, 1)[:, 0])
        one = table._replace(mean=(a1, a2, b1, b2))
        if constant_driver.closed_loop_stable(one):
            models.append(one.mean)
    minutes = np.array(
        [
            np.mean(np.square(constant_driver.drive(table._replace(mean=m), 0.0, SEGMENT_SAMPLES, k)[0]))
            for k, m in enumerate(models)
        ]
    )
    return float(reverse_arrangements.z_scores(minutes[None])[0])


def _car_modes() -> tuple[float, float]:
    modes = []
    for speed in crossover.SPEEDS:
        A, _ = matrices(OneTrackCar(), speed)
        eigenvalues = np.linalg.eigvals(A[:2, :2])
        modes.append(float(np.sqrt(np.prod(eigenvalues).real) / (2.0 * np.pi)))
    return min(modes), max(modes)
