"""One ARMAX model of a whole drive: fit, gains and delays, residual tests, and their presentation."""

from __future__ import annotations

from typing import Any

import numpy as np

from canid.estimators import pooling
from canid.estimators.estimator import WholeDrive
from canid.identification import residual_tests
from canid.identification.armax import gain_and_delay, measurement_noise
from canid.identification.armax.armax_batch import ArmaxFit, Orders, fit_armax
from canid.types import Array, Channel, ResidualTests, Trace


def identify(trace: Trace, orders: Orders) -> WholeDrive | None:
    """Fit all usable samples of a drive; None: too few data, or no stable model."""
    trace = pooling.pooled(trace)
    usable = trace.learn & np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    fit = fit_armax(trace.output, trace.inputs, usable, orders, segment=trace.segment, dt=trace.dt)
    if fit is None:
        return None
    if trace.variance is not None:
        of = [float(x) for x in np.nan_to_num(_means(trace.variance[usable]))]
        fit = measurement_noise.without_bias(fit, of[0], of[1:])
    tests = residual_tests.run_tests(fit.residual, trace.inputs, trace.input_names, orders.na + orders.nc)
    fit = fit._replace(covariance=residual_tests.variance_inflation(tests) * fit.covariance)
    channels = gain_and_delay.channels(trace.input_names, fit.A, fit.B, orders.nk, fit.covariance, trace.dt)
    return WholeDrive(
        channels,
        fit,
        residual_tests=tests,
        specification=_specification(orders),
        details=_details(fit, trace.dt, channels, tests),
        lines=(*_polynomials(fit, trace.input_names), f"poles {', '.join(map(_pole, fit.poles))}"),
    )


def _means(variance: Array) -> Array:
    """Mean of each column; NaN where it has none."""
    known = np.isfinite(variance)
    total = np.where(known, variance, 0.0).sum(axis=0)
    out: Array = np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)
    return out


def _specification(o: Orders) -> str:
    return f"({o.na},{o.nb},{o.nc}), dead time {o.nk} sample{'s' * (o.nk > 1)}"


def _polynomials(fit: ArmaxFit, names: tuple[str, ...]) -> list[str]:
    """One line per polynomial: each coefficient with its standard error."""
    sd = fit.standard_errors
    rows = [("A", fit.A[1:], sd.A[1:])]
    rows += [(f"B {name.replace('_', ' ')}", b, s) for name, b, s in zip(names, fit.B, sd.B, strict=True)]
    rows += [("C", fit.C[1:], sd.C[1:])]
    return [
        f"{name}: {', '.join(f'{x:.4g} ± {s:.2g}' for x, s in zip(values, errors, strict=True))}"
        for name, values, errors in rows
        if len(values)
    ]


def _pole(p: complex) -> str:
    return f"{p.real:.3f}{p.imag:+.3f}j" if p.imag else f"{p.real:.3f}"


def _details(fit: ArmaxFit, dt: float, channels: dict[str, Channel], tests: ResidualTests) -> dict[str, Any]:
    """Keys of `armax` in JSON, see docs/json.md."""
    sd = fit.standard_errors
    return {
        "orders": fit.orders,
        "dt": dt,
        "A": fit.A,
        "B": dict(zip(channels, fit.B, strict=True)),
        "C": fit.C,
        "standard_errors": {
            "A": sd.A,
            "B": dict(zip(channels, sd.B, strict=True)),
            "C": sd.C,
            "offset": sd.offset,
        },
        "offset": fit.offset,
        "sigma": float(fit.sigma),
        "K": {name: channel.K for name, channel in channels.items()},
        "poles": [[float(p.real), float(p.imag)] for p in fit.poles],
        "whiteness": {
            "white": tests.white,
            "statistic": tests.statistic,
            "bound": tests.bound,
            "lags": fit.whiteness.lags,
        },
        "cross": {
            name: {"causal": name not in tests.left_over, "feedback": name in tests.feedback}
            for name in channels
        },
    }
