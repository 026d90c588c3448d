"""Figures of what is recomputed from Chen & Ulsoy 2001."""

from __future__ import annotations

import numpy as np

from benchmarks.papers.prints import crossover
from benchmarks.papers.prints.chen_ulsoy_results import Results
from benchmarks.papers.prints.steering_tables import driver_response, roots
from benchmarks.papers.prints.uncertainty_bound import printed_bound
from canid.values.types import Array
from canid_study.artifact import Curve, Figure, Panel
from canid_study.printed_numbers import (
    DC_GAIN_RANGE,
    RELIABLE_HZ,
    STEERING_INTERVAL_S,
    ZERO_RANGE,
)

# points that a scatter plot can hold
SHOWN = 600
# Hz: a decade to each side of the crossovers
BAND_HZ = (0.01, 2.0)
# 1/s: fast poles beyond are drawn at the edge
FASTEST = -30.0


def figures(r: Results) -> tuple[Figure, ...]:
    """Fig. 10, 12 and 14 as far as the prints say.

    Args:
        r: recomputed.
    """
    return (_fig_10(r), _fig_12(r), _fig_14(r))


def _fig_10(r: Results) -> Figure:
    f = crossover.OMEGA / (2.0 * np.pi)
    chosen = [c for c in r.crossovers if c.unit == "deg" and c.table.table == 1]
    roles = ("reproduced", "corrected", "measured")
    wc = chosen[1].margins.crossover
    ideal = wc / crossover.OMEGA
    return Figure(
        "chen_ulsoy_fig_10",
        "Open loop of the mean driver of Table 1 with a one-track car",
        (
            Panel(
                "frequency (Hz)",
                "|L|",
                (
                    *(
                        Curve(f, np.abs(c.response), f"{c.speed:g} m/s", role=role)
                        for c, role in zip(chosen, roles, strict=True)
                    ),
                    Curve(f, ideal, "omega_c / s", role="published", dashed=True),
                    Curve(f[[0, -1]], np.ones(2), role="limit", dashed=True),
                ),
                log_x=True,
                log_y=True,
                x_range=BAND_HZ,
                y_range=(1e-3, 1e2),
            ),
            Panel(
                "frequency (Hz)",
                "phase (°)",
                (
                    *(
                        Curve(f, np.degrees(np.unwrap(np.angle(c.response))), f"{c.speed:g} m/s", role=role)
                        for c, role in zip(chosen, roles, strict=True)
                    ),
                    Curve(f[[0, -1]], np.full(2, -180.0), role="limit", dashed=True),
                ),
                log_x=True,
                x_range=BAND_HZ,
                y_range=(-340.0, -90.0),
            ),
        ),
        "About the crossover the slope is near -20 dB per decade, with b in degrees per meter.",
    )


def _fig_12(r: Results) -> Figure:
    rng = np.random.default_rng(3)
    drawn, fitted = r.draws[0], r.models[0]
    # Sobol points in their order fill the space evenly
    a1, a2, b1, b2 = fitted[:, :SHOWN]
    inside = np.log(roots(a1, a2).real) / STEERING_INTERVAL_S
    zero = np.log(-b2 / b1) / STEERING_INTERVAL_S
    with np.errstate(divide="ignore"):
        outside = np.log(drawn.poles[:SHOWN].ravel()) / STEERING_INTERVAL_S
    kept = np.isfinite(outside) & (outside.real > FASTEST)
    jitter = 0.8 * rng.uniform(-1.0, 1.0, (3, SHOWN))
    dc = np.sort((fitted[2] + fitted[3]) / (1.0 + fitted[0] + fitted[1]))
    independent = np.sort(drawn.dc_gain)
    return Figure(
        "chen_ulsoy_fig_12",
        "Table 1 drawn with and without correlations",
        (
            Panel(
                "real (1/s)",
                "imaginary (1/s)",
                (
                    Curve(
                        outside.real[kept],
                        outside.imag[kept],
                        "poles, independent",
                        points=True,
                        role="limit",
                    ),
                    Curve(
                        np.maximum(inside[:, 1], FASTEST),
                        jitter[0],
                        "fast pole, with correlations",
                        points=True,
                        role="corrected",
                    ),
                    Curve(
                        inside[:, 0],
                        jitter[1],
                        "slow pole, with correlations",
                        points=True,
                        role="reproduced",
                    ),
                    Curve(zero, jitter[2], "zero, with correlations", points=True, role="measured"),
                    Curve(np.zeros(2), np.array([-12.0, 12.0]), role="limit", dashed=True),
                ),
                "Poles and zero; the correlated ones are real, spread a little upwards and downwards to be seen",
                x_range=(FASTEST, 20.0),
            ),
            Panel(
                "DC gain",
                "share below",
                (
                    Curve(*_distribution(independent), "independent", role="limit"),
                    Curve(*_distribution(dc), "with correlations", role="corrected"),
                    *(
                        Curve(
                            np.full(2, end),
                            np.array([0.0, 1.0]),
                            "printed range" if end == DC_GAIN_RANGE[0] else "",
                            role="published",
                            dashed=True,
                        )
                        for end in DC_GAIN_RANGE
                    ),
                ),
                x_range=(-5.0, 8.0),
            ),
        ),
        f"Red, independent: unstable right of the dashed line. The printed zero is between {ZERO_RANGE[0]:g} and "
        f"{ZERO_RANGE[1]:g} 1/s.",
    )


def _fig_14(r: Results) -> Figure:
    f = np.geomspace(0.01, 4.0, 300)
    w = 2.0 * np.pi * f
    bound = printed_bound(w)
    roles = ("reproduced", "corrected")
    drivers = [np.abs(driver_response(t, w)) for t in r.estimation]
    edge = np.full(2, RELIABLE_HZ)
    return Figure(
        "chen_ulsoy_fig_14",
        "Bound of |Delta|, eq. 5, against the mean drivers",
        (
            Panel(
                "frequency (Hz)",
                "magnitude",
                (
                    Curve(f, bound, "|Delta|, eq. 5", role="published"),
                    *(
                        Curve(f, g, f"|G_d|, Table {t.table}", role=role)
                        for g, t, role in zip(drivers, r.estimation, roles, strict=True)
                    ),
                    Curve(
                        edge, np.array([0.1, 10.0]), "reliable to here (sec. 2.1)", role="limit", dashed=True
                    ),
                ),
                log_x=True,
                log_y=True,
            ),
            Panel(
                "frequency (Hz)",
                "|Delta| / |G_d|",
                tuple(
                    Curve(f, bound / g, f"Table {t.table}", role=role)
                    for g, t, role in zip(drivers, r.estimation, roles, strict=True)
                ),
                log_x=True,
            ),
        ),
        "A fifth of the driver's gain at 0 Hz, three quarters of it at 1 Hz.",
    )


def _distribution(x: Array) -> tuple[Array, Array]:
    """Empirical distribution function at 401 points between the 0.5 and 99.5 % points of what is shown."""
    at = np.linspace(-5.0, 8.0, 401)
    return at, np.searchsorted(x, at) / len(x)
