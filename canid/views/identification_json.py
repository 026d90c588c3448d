"""A drive's parameters as the JSON object that docs/json.md describes."""

from __future__ import annotations

from typing import Any

from canid.drive_parameters import Identified
from canid.estimators.estimator import WholeDrive
from canid.types import Array
from canid.views import identification_verdict, json_values
from canid.views.numbers import role_unit

# The estimator whose result stands as `whole` alone; every other one's stands under its own name.
UNNAMED = "fopdt"
# significant digits of draws from the posterior: of two hundred a quantile is known to two
DRAW_DIGITS = 5


def to_json(drive: Identified, log: str, vehicle: str) -> dict[str, Any]:
    """The JSON object of `canid identify`; null where nothing is known."""
    return {
        "log": log,
        "vehicle": vehicle,
        "verdict": identification_verdict.verdict(drive, drive.drive_summary.output)._asdict(),
        "duration": drive.duration,
        "driver_time": drive.driver_time,
        "time": json_values.plain(drive.time),
        "signals": [json_values.signal_finding(one) for one in drive.findings],
        "windows": [json_values.estimate(e) for e in drive.windows],
        **_results(drive),
        "loop": json_values.plain(drive.loop),
        **_summary(drive),
        "orders": [
            {
                **c.orders._asdict(),
                **{key: json_values.number(getattr(c, key)) for key in ("aic", "bic", "fpe")},
                "white": bool(c.white),
            }
            for c in drive.orders
        ],
    }


def _summary(drive: Identified) -> dict[str, Any]:
    """Output and its unit, and what a comparison of drives needs (`canid compare`)."""
    of = drive.drive_summary
    output = {"output": of.output, "unit": role_unit(of.output) if of.output else ""}
    summary = {key: value for key, value in of._asdict().items() if key not in ("output", "draws")}
    draws = None if of.draws is None else {key: _short(x) for key, x in of.draws._asdict().items()}
    return {**output, "summary": {**json_values.plain(summary), "draws": draws}}


def _short(draws: Array) -> list[list[float]]:
    """Draws with as many digits as their number supports."""
    return [[float(f"{x:.{DRAW_DIGITS}g}") for x in row] for row in draws.tolist()]


def _results(drive: Identified) -> dict[str, Any]:
    """The headline's result as `whole`, and each estimator's under its name."""
    first = drive.ranked[0] if drive.whole else ""
    named = {name: _whole(found) for name, found in drive.whole.items() if name != UNNAMED or name != first}
    whole = {"estimator": first, **(found if (found := _whole(drive.headline)) is not None else {})}
    return {"whole": whole if drive.headline is not None else None, **named}


def _whole(found: WholeDrive | None) -> dict[str, Any] | None:
    """One estimator's result; a key that the method has nothing for is left out."""
    if found is None:
        return None
    out: dict[str, Any] = {"channels": json_values.channels(found.channels)}
    if found.fit_percent is not None:
        out["fit_percent"] = json_values.number(found.fit_percent)
        out["fit_kind"] = found.fit_kind
    if found.residual_tests is not None:
        out["residual_tests"] = json_values.residual_tests(found.residual_tests)
    return out | {key: json_values.plain(value) for key, value in found.details.items()}
