"""A drive's parameters as the JSON object that docs/json.md describes."""

from __future__ import annotations

from typing import Any

from canid.drive_parameters import Identified
from canid.estimators.estimator import WholeDrive
from canid.views import json_values

# The estimator whose result stands as `whole` alone; every other one's stands under its own name.
UNNAMED = "fopdt"


def to_json(drive: Identified, log: str, vehicle: str) -> dict[str, Any]:
    """The JSON object of `canid identify`; null where nothing is known."""
    return {
        "log": log,
        "vehicle": vehicle,
        "duration": drive.duration,
        "driver_time": drive.driver_time,
        "time": json_values.plain(drive.time),
        "signals": [json_values.signal_finding(one) for one in drive.findings],
        "windows": [json_values.estimate(e) for e in drive.windows],
        **_results(drive),
        "loop": json_values.plain(drive.loop),
        "orders": [
            {
                **c.orders._asdict(),
                **{key: json_values.number(getattr(c, key)) for key in ("aic", "bic", "fpe")},
                "white": bool(c.white),
            }
            for c in drive.orders
        ],
    }


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
    if found.residual_tests is not None:
        out["residual_tests"] = json_values.residual_tests(found.residual_tests)
    return out | {key: json_values.plain(value) for key, value in found.details.items()}
