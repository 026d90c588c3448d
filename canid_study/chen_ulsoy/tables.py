"""Tables 1 and 2 of Chen & Ulsoy 2001 with standard errors and correlations, and canid's tables next to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import NAN, Array
from canid_study.artifact import Cell, Table
from canid_study.chen_ulsoy import between
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.segment_fits import NAMES

_UNITS = {"a1": "a1", "a2": "a2", "b1": "b1 (deg/m)", "b2": "b2 (deg/m)"}


class Summary(NamedTuple):
    """Statistics of one parameter over segments."""

    n: int
    mean: float
    mean_se: float
    std: float
    std_se: float
    least: float
    largest: float


def summary(x: Array) -> Summary:
    """Mean and standard deviation with standard errors, least and largest value.

    That of the standard deviation from the fourth central moment (Kendall & Stuart 1977, sec. 10.14), since the
    parameters are no Gaussians.

    >>> s = summary(np.random.default_rng(0).normal(size=400))
    >>> bool(abs(s.std_se / (s.std / np.sqrt(800)) - 1.0) < 0.15)
    True
    """
    n = len(x)
    if n < 2:
        return Summary(
            n, float(x.mean()) if n else NAN, NAN, NAN, NAN, *([float(x[0])] * 2 if n else [NAN, NAN])
        )
    std = float(x.std(ddof=1))
    fourth = float(np.mean((x - x.mean()) ** 4)) / max(std**4, 1e-300)
    return Summary(
        n,
        float(x.mean()),
        std / n**0.5,
        std,
        0.5 * std * (max(fourth - 1.0, 0.0) / n) ** 0.5,
        float(x.min()),
        float(x.max()),
    )


def halves(driver: Driver) -> dict[str, Array]:
    """Odd segments estimate, even ones validate: (n, 4) each. The first that is used is the first odd one."""
    odd = driver.number % 2 == 0
    return {"estimation": driver.model[odd], "validation": driver.model[~odd]}


def statistics(name: str, title: str, groups: Sequence[tuple[str, str, Array]]) -> Table:
    """Table 1 or 2: mean, std, min, max, n.

    Args:
        name: of the file.
        title: of the table.
        groups: driver, set, (n, 4) parameters.
    """
    columns = ["driver", "set", "n"]
    for p in NAMES:
        columns += [f"{_UNITS[p]} {s}" for s in ("mean", "mean_se", "std", "std_se", "min", "max")]
    rows: list[list[Cell]] = []
    for driver, part, x in groups:
        row: list[Cell] = [driver, part, len(x)]
        for j in range(4):
            row += list(summary(x[:, j]))[1:] if len(x) else [None] * 6
        rows.append(row)
    return Table(
        name,
        title,
        tuple(columns),
        rows,
        "b is in the paper's sign: a positive error steers positively. se: standard error.",
    )


def correlations(drivers: Sequence[Driver]) -> Table:
    """4 x 4 correlations: of the fits as printed tables would have them, of sampling alone, and between segments."""
    everything = np.concatenate([d.model for d in drivers])
    sampling = np.mean([d.sampling for d in drivers], axis=0)
    estimated = between.covariance([d.group for d in drivers])
    rows: list[list[Cell]] = []
    for what, C in (
        ("of the fits", np.cov(everything.T)),
        ("sampling", sampling),
        ("between segments", np.full((4, 4), NAN) if estimated is None else estimated.between),
    ):
        sd = np.sqrt(np.maximum(np.diag(C), 1e-300))
        rows += [
            [what, p, *(float(x) for x in row)] for p, row in zip(NAMES, C / np.outer(sd, sd), strict=True)
        ]
    return Table(
        "correlations",
        "Correlations of the parameters over segments (not printed in the paper)",
        ("of", "parameter", *NAMES),
        rows,
        "b1 and b2 cancel to a zero near the unit circle: independent standard deviations make 30 % of drivers unstable.",
    )


def structured(drivers: Sequence[Driver], pooled: Sequence[between.Split]) -> Table:
    """What each standard deviation consists of, per driver and over all."""
    rows: list[list[Cell]] = []
    for d in drivers:
        rows += [_split_row(d.name, s) for s in between.split(NAMES, [d.group])]
    if len(drivers) > 1:
        rows += [_split_row("all", s) for s in pooled]
    return Table(
        "structured",
        "Standard deviation of the parameters: sampling, between segments, between drivers",
        (
            "driver",
            "parameter",
            "std of the fits",
            "sampling",
            "between segments",
            "between segments_low",
            "between segments_high",
            "between drivers",
            "between drivers_low",
            "between drivers_high",
        ),
        rows,
        "Restricted maximum likelihood; intervals 95 %, by profile likelihood. A low end of 0: none may be there.",
    )


def _split_row(name: str, s: between.Split) -> list[Cell]:
    return [name, s.name, s.naive, s.sampling, *s.minutes, *s.drivers]


def bias(drivers: Sequence[Driver]) -> Table:
    """Average of the fits of segments against one fit over all segments."""
    rows: list[list[Cell]] = []
    for d in drivers:
        if d.joint is None:
            continue
        for j, p in enumerate(NAMES):
            value, sd = float(d.joint.theta[j]), float(d.joint.covariance[j, j]) ** 0.5
            made = d.repeated
            rows.append(
                [
                    d.name,
                    p,
                    float(d.model[:, j].mean()),
                    float(d.model[:, j].std(ddof=1)) / len(d.model) ** 0.5,
                    value,
                    value - NORMAL_QUANTILE * sd,
                    value + NORMAL_QUANTILE * sd,
                    *((None, None) if made is None else (float(made.bias[j]), float(made.bias_sd[j]))),
                    "" if made is None else "yes" if made.changing else "no",
                ]
            )
    return Table(
        "bias",
        "Averages of fits of segments are biased; one fit over all segments is not",
        (
            "driver",
            "parameter",
            "mean of fits of segments",
            "mean_se",
            "joint fit",
            "joint fit_low",
            "joint fit_high",
            "bias of one segment's fit, simulated",
            "bias_se",
            "changes between segments",
        ),
        rows,
        "Bias: mean of the fits of repetitions of the driver's own loop minus the models that were simulated. The joint fit "
        "is that of a driver who does not change; of one who does, it weighs the segments by what they say.",
    )


def validation(drivers: Sequence[Driver]) -> Table:
    """Odd against even segments of each driver, and each driver against the others."""
    rows: list[list[Cell]] = []
    for d in drivers:
        parts = halves(d)
        rows += _compared(d.name, "odd - even segments", parts["estimation"], parts["validation"])
    if len(drivers) > 2:
        means = np.array([d.model.mean(axis=0) for d in drivers])
        for k, d in enumerate(drivers):
            others = np.delete(means, k, axis=0)
            for j, p in enumerate(NAMES):
                away = float(means[k, j] - others[:, j].mean())
                # what a new driver of the same population differs by: the others' scatter, not the segments'
                se = float(others[:, j].std(ddof=1) * np.sqrt(1.0 + 1.0 / len(others)))
                rows.append(
                    [
                        d.name,
                        "left out - mean of the other drivers",
                        p,
                        away,
                        se,
                        away / se if se > 0 else None,
                    ]
                )
    return Table(
        "validation",
        "Validation: odd and even segments, and a driver left out",
        ("driver", "comparison", "parameter", "difference", "standard error", "difference / error"),
        rows,
        "Interleaved segments of the same drives cannot disagree; drivers can.",
    )


def _compared(name: str, what: str, x: Array, y: Array) -> list[list[Cell]]:
    if len(x) < 2 or len(y) < 2:
        return []
    away = x.mean(axis=0) - y.mean(axis=0)
    se = np.sqrt(x.var(axis=0, ddof=1) / len(x) + y.var(axis=0, ddof=1) / len(y))
    return [
        [name, what, p, float(away[j]), float(se[j]), float(away[j] / se[j])] for j, p in enumerate(NAMES)
    ]


def stationary(drivers: Sequence[Driver]) -> Table:
    """Shares of segments that pass the reverse arrangements test, next to those of a constant driver."""
    rows: list[list[Cell]] = []
    for d in drivers:
        s, c = d.stationary, d.constant
        if s is None:
            continue
        rows.append(
            [
                d.name,
                s.error,
                s.angle,
                s.residual,
                *(
                    (None,) * 3
                    if c is None
                    else (c.stationary_error, c.stationary_angle, c.stationary_residual)
                ),
                s.whole_error,
                s.whole_angle,
                *((None, None) if d.drift is None else (d.drift.statistic, d.drift.p_value)),
            ]
        )
    return Table(
        "stationarity",
        "Stationarity: reverse arrangements at 95 %, and the likelihood ratio against a constant driver",
        (
            "driver",
            "error passes",
            "angle passes",
            "residual passes",
            "constant driver: error passes",
            "constant driver: angle passes",
            "constant driver: residual passes",
            "whole: z of error",
            "whole: z of angle",
            "likelihood ratio",
            "p of a constant driver",
        ),
        rows,
        "Constant driver: repetitions of the driver's own loop with one model for all segments.",
    )


def structures(drivers: Sequence[Driver]) -> Table:
    """Residuals of ARX, ARMAX, OE, BJ."""
    rows: list[list[Cell]] = []
    for d in drivers:
        if d.structures is not None:
            for s, share in d.structures.inside.items():
                rows.append([d.name, s, share, d.structures.loss[s], d.structures.segments])
    return Table(
        "structures",
        "Model structures at equal order: share of the residual's autocorrelation inside 99 %, and loss",
        ("driver", "structure", "lags inside 99 %", "loss / ARMAX's", "segments"),
        rows,
    )


def orders(driver: Driver) -> Table:
    """Orders and delays by AIC, BIC and FPE on one segment."""
    rows: list[list[Cell]] = []
    for c in driver.orders:
        o = c.orders
        rows.append([o.na, o.nb, o.nc, o.nk, o.count(1), c.aic, c.bic, c.fpe, "yes" if c.white else "no"])
    return Table(
        "orders",
        f"Orders and delay, first segment of {driver.name}, best BIC first",
        ("na", "nb", "nc", "nk", "parameters", "AIC", "BIC", "FPE (deg²)", "residual white"),
        rows,
    )


def segments(drivers: Sequence[Driver]) -> Table:
    """How many segments there were, and what became of them."""
    rows: list[list[Cell]] = [
        [d.name, d.counted, d.counted - len(d.number) - d.rejected, d.rejected, len(d.number), d.why]
        for d in drivers
    ]
    return Table(
        "segments",
        "Segments",
        ("driver", "segments", "with a gap or still", "unreasonable poles", "used", "why nothing"),
        rows,
        "The first segment of each log is left out, as in the paper.",
    )
