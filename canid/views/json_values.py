"""Estimates as the JSON objects that other programs rely on; docs/json.md lists the names."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np

from canid.types import (
    Array,
    BlockReport,
    Channel,
    Estimate,
    Event,
    Interval,
    MonitorReport,
    ResidualTests,
    SignalFinding,
    SignalReport,
)

# of each kind of JSON that a verb writes: grows when a name goes or changes its meaning, never for a name that is added
SCHEMA_VERSIONS = {
    "check": 1,
    "compare": 1,
    "diagnose": 1,
    "export": 1,
    "fleet": 1,
    "identify": 1,
    "init": 1,
    "look": 1,
    "onto": 1,
    "record": 1,
    "recover": 1,
    "replay": 1,
    "study": 1,
}


def number(x: float) -> float | None:
    """The number, or None if it is not finite.

    Example:
        >>> number(float("nan")) is None, number(2.0)
        (True, 2.0)
    """
    return float(x) if math.isfinite(x) else None


def array(values: Array) -> list[Any]:
    """An array of any shape as lists, null where it is not finite.

    Example:
        >>> import numpy as np
        >>> array(np.array([[1.0, np.nan]]))
        [[1.0, None]]
    """
    return [array(row) if getattr(row, "ndim", 0) else number(float(row)) for row in values]


def interval(iv: Interval) -> dict[str, float | None]:
    """A value with its 95 % interval."""
    return {"value": number(iv.value), "low": number(iv.low), "high": number(iv.high)}


def plain(value: Any) -> Any:
    """Numbers, texts, enums, arrays, NamedTuples, mappings and sequences of such as JSON has them.

    Example:
        >>> plain({"K": Interval(1.0), "n": (1, 2)})
        {'K': {'value': 1.0, 'low': None, 'high': None}, 'n': [1, 2]}
    """
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float):
        return number(value)
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [plain(part) for part in value]
    return value


def channel(ch: Channel) -> dict[str, Any]:
    """Parameters and status of one channel."""
    return {
        "K": interval(ch.K),
        "tau": interval(ch.tau),
        "dead_time": interval(ch.dead_time),
        "tau_plus_dead_time": interval(ch.tau_plus_dead_time),
        "status": ch.status.value,
        "K_anytime": interval(ch.K_anytime),
        "prior_weight": number(ch.prior_weight),
        "progress": plain(ch.progress),
        "prior_weights": plain(ch.prior_weights),
    }


def channels(several: Mapping[str, Channel]) -> dict[str, Any]:
    """Parameters and status of each channel."""
    return {name: channel(ch) for name, ch in several.items()}


def residual_tests(tests: ResidualTests) -> dict[str, Any]:
    """The residual tests."""
    return {
        "white": tests.white,
        "statistic": number(tests.statistic),
        "bound": number(tests.bound),
        "left_over": list(tests.left_over),
        "feedback": list(tests.feedback),
        "stationary": tests.stationary,
        "excitation_order": dict(tests.excitation_order),
        "left_over_share": {name: number(share) for name, share in tests.left_over_share.items()},
    }


def estimate(e: Estimate) -> dict[str, Any]:
    """One line of `live --json` and `replay --json`."""
    return {
        "t": number(round(e.t, 6)),
        "estimator": e.estimator,
        "status": e.status.value,
        "says": e.says,
        "channels": channels(e.channels),
        "fit_percent": number(e.fit_percent),
        "excitation": {name: number(x) for name, x in e.excitation.items()},
        "used": number(e.used),
        "residual_tests": None if e.residual_tests is None else residual_tests(e.residual_tests),
        "headline": e.headline,
        "change": plain(e.change),
    }


def block_report(w: BlockReport) -> dict[str, Any]:
    """The monitor's report of one block."""
    return {
        "state": w.state.value,
        "since": number(w.since),
        "says": w.says,
        "evidence": number(w.evidence),
        "needed": number(w.needed),
    }


def monitor_report(s: MonitorReport) -> dict[str, Any]:
    """A report of the monitor, as a line of its own.

    Example:
        >>> monitor_report(MonitorReport(60.0, True, float("nan"), "", "fits", {}))["screen"]["since"] is None
        True
    """
    values = {"fits": s.fits, "since": number(s.since), "block": s.block, "says": s.says}
    blocks = {name: block_report(w) for name, w in s.blocks.items()}
    return {"t": number(round(s.t, 6)), "screen": values | {"blocks": blocks}}


def signal_finding(one: SignalFinding) -> dict[str, Any]:
    """One finding on the signals."""
    return {
        "finding": one.name,
        "roles": list(one.roles),
        "since": number(round(one.since, 6)),
        "raised": number(round(one.raised, 6)),
        "until": number(round(one.until, 6)),
        "says": one.says,
        "remedy": one.remedy,
        "withholds": one.withholds,
    }


def signal_report(r: SignalReport) -> dict[str, Any]:
    """The findings on the signals, as a line of its own.

    Example:
        >>> signal_report(SignalReport(60.0, ()))
        {'t': 60.0, 'signals': []}
    """
    return {"t": number(round(r.t, 6)), "signals": [signal_finding(one) for one in r.findings]}


def event(e: Event) -> dict[str, Any]:
    """An event, as a line of its own."""
    return {"t": number(round(e.t, 6)), "event": e.what, "says": e.says}


def document(name: str, value: dict[str, Any] | list[dict[str, Any]]) -> str:
    """What a verb writes, on one line: an object or a list of objects, each with the name and version of its schema.

    Args:
        name: of a schema, see `SCHEMA_VERSIONS`.
        value: without its schema.

    Example:
        >>> document("replay", {"t": 1.0})
        '{"schema": "canid/replay/1", "t": 1.0}'
    """
    mark = {"schema": f"canid/{name}/{SCHEMA_VERSIONS[name]}"}
    return line([mark | one for one in value] if isinstance(value, list) else mark | value)


def line(value: dict[str, Any] | list[dict[str, Any]]) -> str:
    """One JSON value on one line; raises ValueError for NaN.

    Example:
        >>> line({"t": 1.0, "θ": None})
        '{"t": 1.0, "θ": null}'
    """
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
