"""A drive's parameters as text and as JSON."""

from __future__ import annotations

from typing import Any

from canid.drive import Identified
from canid.views import as_json, words
from canid.views.table import short


def to_json(told: Identified, log: str, vehicle: str) -> dict[str, Any]:
    """The object that docs/json.md describes."""
    armax = None
    if told.armax is not None:
        fit, tests = told.armax.fit, told.armax.residual_tests
        armax = {
            "orders": fit.orders._asdict(),
            "A": [float(x) for x in fit.A],
            "B": {
                name: [float(x) for x in row] for name, row in zip(told.armax.channels, fit.B, strict=True)
            },
            "C": [float(x) for x in fit.C],
            "offset": fit.offset,
            "sigma": float(fit.sigma),
            "K": {name: as_json.interval(ch.K) for name, ch in told.armax.channels.items()},
            "channels": as_json.channels(told.armax.channels),
            "poles": [[float(p.real), float(p.imag)] for p in fit.poles],
            "whiteness": {
                "white": tests.white,
                "statistic": as_json.number(tests.statistic),
                "bound": as_json.number(tests.bound),
                "lags": fit.whiteness.lags,
            },
            "cross": {
                name: {"causal": name not in tests.left_over, "feedback": name in tests.feedback}
                for name in told.armax.channels
            },
            "residual_tests": as_json.residual_tests(tests),
        }
    return {
        "log": log,
        "vehicle": vehicle,
        "duration": told.duration,
        "driver_time": told.driver_time,
        "windows": [as_json.estimate(e) for e in told.windows],
        "whole": {
            "channels": as_json.channels(told.channels),
            "fit_percent": as_json.number(told.fit_percent),
        },
        "armax": armax,
        "orders": [
            {
                **c.orders._asdict(),
                **{key: as_json.number(getattr(c, key)) for key in ("aic", "bic", "fpe")},
                "white": bool(c.white),
            }
            for c in told.orders
        ],
    }


def text(told: Identified, log: str, vehicle: str) -> list[str]:
    """The table of `canid identify`."""
    lines = [
        f"{log}: {vehicle}, {told.duration:.0f} s, of which {told.driver_time:.0f} s of driving behind a lead",
        "",
    ]
    lines += [words.estimate(e) for e in told.windows]
    lines += [""] if told.windows else []
    lines.append(f"whole drive, FOPDT, fit {short(told.fit_percent)} %")
    lines += [f"  {words.channel(name, ch)}" for name, ch in told.channels.items()]
    if told.armax is None:
        lines.append("whole drive, ARMAX: no model (too few data, or none that is stable)")
        return lines
    fit, o = told.armax.fit, told.armax.fit.orders
    lines.append(
        f"whole drive, ARMAX({o.na},{o.nb},{o.nc}) with {o.nk} sample{'s' * (o.nk > 1)} of dead time"
    )
    lines += [f"  {words.channel(name, ch)}" for name, ch in told.armax.channels.items()]
    lines.append(
        "  poles "
        + ", ".join(f"{p.real:.3f}{p.imag:+.3f}j" if p.imag else f"{p.real:.3f}" for p in fit.poles)
    )
    lines += [f"  {says}" for says in words.residual_tests(told.armax.residual_tests)]
    if told.orders:
        best = ", ".join(
            f"({c.orders.na},{c.orders.nb},{c.orders.nc}) nk {c.orders.nk}{' white' if c.white else ''}"
            for c in told.orders[:3]
        )
        lines.append(f"  orders by BIC: {best}")
    return lines
