"""Gains and desired headways that depend on the operating point: what an effect that depends on the time has to beat.

A driver whose law never changes (IDM, OVRV, Gipps) answers more or less strongly at another speed or gap. Behind a lead
that changes its speed once or twice this looks like a change in time. None of these is ever named.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from canid.models.effects.effect import DriveFeatures, Effect, Kind, Parameter, Params, Seen, Value

# m/s and m; below these an operating point is a standstill
MIN_SPEED, MIN_GAP_M = 2.0, 2.0
# m/s and m; the operating point at which the gains are the baseline's
REFERENCE_SPEED, REFERENCE_GAP_M = 20.0, 30.0
# of log speed and log gap; a step as sharp as a fit can still follow
STEP_WIDTH = 0.02


def log_speed(seen: Seen) -> Value:
    """Return log(v / 20 m/s)."""
    return np.log(np.maximum(seen.speed, MIN_SPEED) / REFERENCE_SPEED)


def log_gap(seen: Seen) -> Value:
    """Return log(gap / 30 m)."""
    return np.log(np.maximum(seen.gap, MIN_GAP_M) / REFERENCE_GAP_M)


def _slope(x: Callable[[Seen], Value]) -> Callable[[Params, Seen], Value]:
    return lambda p, seen: 1.0 + p[0] * x(seen)


def _step(x: Callable[[Seen], Value]) -> Callable[[Params, Seen], Value]:
    return lambda p, seen: 1.0 - p[0] * np.clip((x(seen) - p[1]) / STEP_WIDTH + 0.5, 0.0, 1.0)


def _speeds(drive: DriveFeatures) -> tuple[float, ...]:
    return _quantiles(np.maximum(drive.speed, MIN_SPEED) / REFERENCE_SPEED)


def _gaps(drive: DriveFeatures) -> tuple[float, ...]:
    return _quantiles(np.maximum(drive.gap, MIN_GAP_M) / REFERENCE_GAP_M)


def _quantiles(x: Value) -> tuple[float, ...]:
    return tuple(float(q) for q in np.log(np.quantile(x, (0.2, 0.4, 0.6, 0.8)))) if len(x) else (0.0,)


def wanted(p: Params, e: Value, seen: Seen) -> Value:
    """Return the headway error against a desired headway that depends on the speed: more of it at low and high speed, s."""
    v = np.maximum(seen.speed, MIN_SPEED) / REFERENCE_SPEED
    return e - p[0] / v - p[1] * v * v


def _gain(
    name: str,
    act: Callable[[Params, Seen], Value] | None,
    *parameters: Parameter,
    headway: Callable[[Params, Value, Seen], Value] | None = None,
) -> Effect:
    return Effect(
        id=name,
        says="",
        where="driver",
        kind=Kind.PARAMETRIC,
        parameters=parameters,
        needs=("speed", "gap"),
        source="Treiber, Hennecke & Helbing 2000; Gipps 1981",
        shows_desired_headway=True,
        gain=act,
        headway=headway,
    )


_SLOPE = Parameter("slope", "1", -3.0, 3.0, (0.3, -0.3), 0.3)
_SHARE = Parameter("share", "1", -3.0, 0.95, (0.25, -0.25), 0.25)
_NEAR = Parameter("standstill", "s", -1.0, 2.0, (0.2,), 0.2)
_FAR = Parameter("fast", "s", -2.0, 4.0, (0.2,), 0.2)

GAINS: tuple[Effect, ...] = (
    _gain("gain by speed", _slope(log_speed), _SLOPE),
    _gain("desired headway by speed", None, _NEAR, _FAR, headway=wanted),
    _gain(
        "desired headway and gain by speed",
        lambda p, seen: _slope(log_speed)(p[2:], seen),
        _NEAR,
        _FAR,
        _SLOPE,
        headway=wanted,
    ),
    _gain("gain by gap", _slope(log_gap), _SLOPE),
    _gain(
        "step of the gain by speed", _step(log_speed), _SHARE, Parameter("at", "1", -3.0, 2.0, _speeds, 0.0)
    ),
    _gain("step of the gain by gap", _step(log_gap), _SHARE, Parameter("at", "1", -3.0, 3.0, _gaps, 0.0)),
)

# of a driver who keeps the lane: only the speed is an operating point there
LANE_GAINS: tuple[Effect, ...] = tuple(
    effect for effect in GAINS if effect.id in ("gain by speed", "step of the gain by speed")
)
