"""Estimates as the JSON objects that other programs rely on; docs/json.md lists the names."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from canid.types import Channel, Estimate, Event, Interval, ResidualTests, Screened, Watched


def number(x: float) -> float | None:
    """Return x, or None where JSON has no word for it.

    Example:
        >>> number(float("nan")) is None, number(2.0)
        (True, 2.0)
    """
    return float(x) if math.isfinite(x) else None


def interval(iv: Interval) -> dict[str, float | None]:
    """A number with its 95 % interval."""
    return {"value": number(iv.value), "low": number(iv.low), "high": number(iv.high)}


def channel(ch: Channel) -> dict[str, Any]:
    """One input's answer."""
    return {
        "K": interval(ch.K),
        "tau": interval(ch.tau),
        "dead_time": interval(ch.dead_time),
        "tau_plus_dead_time": interval(ch.tau_plus_dead_time),
        "status": ch.status.value,
        "K_anytime": interval(ch.K_anytime),
        "prior_weight": number(ch.prior_weight),
    }


def channels(several: Mapping[str, Channel]) -> dict[str, Any]:
    """All inputs' answers."""
    return {name: channel(ch) for name, ch in several.items()}


def residual_tests(tests: ResidualTests) -> dict[str, Any]:
    """What the residuals say of the model."""
    return {
        "white": tests.white,
        "statistic": number(tests.statistic),
        "bound": number(tests.bound),
        "left_over": list(tests.left_over),
        "feedback": list(tests.feedback),
        "stationary": tests.stationary,
        "excitation_order": dict(tests.excitation_order),
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
    }


def watched(w: Watched) -> dict[str, Any]:
    """What the screen says of one block."""
    return {
        "state": w.state.value,
        "since": number(w.since),
        "says": w.says,
        "evidence": number(w.evidence),
        "needed": number(w.needed),
    }


def screened(s: Screened) -> dict[str, Any]:
    """What the screen says, as a line of its own.

    Example:
        >>> screened(Screened(60.0, True, float("nan"), "", "fits", {}))["screen"]["since"] is None
        True
    """
    told = {"fits": s.fits, "since": number(s.since), "block": s.block, "says": s.says}
    blocks = {name: watched(w) for name, w in s.blocks.items()}
    return {"t": number(round(s.t, 6)), "screen": told | {"blocks": blocks}}


def event(e: Event) -> dict[str, Any]:
    """An event, as a line of its own."""
    return {"t": number(round(e.t, 6)), "event": e.what, "says": e.says}


def line(value: dict[str, Any] | list[dict[str, Any]]) -> str:
    """One JSON value on one line; NaN cannot slip in.

    Example:
        >>> line({"t": 1.0, "θ": None})
        '{"t": 1.0, "θ": null}'
    """
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
