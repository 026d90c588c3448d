"""What the sensors of a planted drive say, and when: periods, jitter, noise, and all that is measured wrongly.

Planted columns are what was; here they become messages, each with a clock of its own. The DBC's resolution comes after.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.mapping import MessageMap
from tests.plants.planted_drive import FREEZES, Array, Planted

NAN = float("nan")
DEFAULT_PERIOD_S = 0.02  # s, of messages whose DBC gives none
# share of a period by which a message is late: it waits for others on the bus and for its sender's scheduler
JITTER_SHARE = 0.03
STEPWISE = {
    "brake",
    "cruise_active",
    "clutch",
    "lead_valid",
    "gear",
}  # jump, and are never between two values
LEAD = {"gap", "range_rate"}
ALTITUDE_ERROR_S = 60.0  # s; correlation time of the error of a satellite's height


class Noise(NamedTuple):
    """Standard deviations of this car's sensors."""

    gap: float  # m
    range_rate: float  # m/s
    speed: float  # m/s
    accel: float  # m/s²
    gnss_speed: float  # m/s
    grade: float  # %
    altitude: float  # m; and as much again as a slow error
    engine_speed: float  # rpm


class Message(NamedTuple):
    """All that one message says along a drive."""

    of: MessageMap
    t: Array  # (m,) s, whole ns as logs keep them
    values: dict[str, Array]  # role -> (m,) in its unit; NaN: nothing


def noise(seed: int) -> Noise:
    """Draw the sensors: radars from good to poor (ISO 15622 classes), the rest as production cars have it.

    >>> 0.1 <= noise(1).gap <= 0.3
    True
    """
    rng = np.random.default_rng([seed, 61])
    return Noise(
        gap=rng.uniform(0.10, 0.30),
        range_rate=rng.uniform(0.05, 0.12),
        speed=rng.uniform(0.005, 0.03),
        accel=rng.uniform(0.03, 0.08),
        gnss_speed=rng.uniform(0.03, 0.08),
        grade=rng.uniform(0.05, 0.2),
        altitude=rng.uniform(0.2, 0.6),
        engine_speed=rng.uniform(3.0, 10.0),
    )


def sense(planted: Planted, vehicle: Vehicle, seed: int) -> list[Message]:
    """Measure a drive with a vehicle's sensors.

    The effects on sensing: range_offset(distance m) and range_rate_scale, speed_scale(share) add to what is measured,
    range_rate_sign turns it round, radar_latency(delay s) makes the radar's reports that much older, clock_skew(rate s)
    makes them older by `rate` towards the end of the drive (below 0: by -rate at its begin). stale_signal repeats the
    last value, to the bit.

    Returns:
        one `Message` per message that the vehicle maps, in its order. The first one begins at t = 0.
    """
    effects: dict[str, dict[str, float]] = planted.truth["effects"]
    duration = float(planted.columns["t"][-1])
    sd = noise(seed)
    out = []
    for index, of in enumerate(vehicle.messages):
        rng = np.random.default_rng([seed, 62, index])
        t = _times(DEFAULT_PERIOD_S if math.isnan(of.period) else of.period, duration, index == 0, rng)
        roles = [r.role for r in vehicle.roles.values() if (r.message, r.bus) == (of.name, of.bus)]
        if any((track.message, track.bus) == (of.name, of.bus) for track in vehicle.lead.tracks or ()):
            roles += ["gap", "range_rate", "lead_valid"]
        values = {}
        for role in roles:
            if role not in planted.columns:
                continue
            seen = _at(planted, role, t - _late(effects, t, duration) if role in LEAD else t)
            seen = _wrong(role, seen, effects)
            spread = getattr(sd, role, 0.0)
            if spread:
                seen = seen + spread * rng.standard_normal(len(t))
            if role == "altitude":
                seen = seen + spread * _wander(t, rng)
            values[role] = seen
        out.append(Message(of, t, _frozen(values, t, planted.truth)))
    return out


def _times(period: float, duration: float, first: bool, rng: np.random.Generator) -> Array:
    n = int((duration - period) / period)
    late = rng.uniform(0.0, JITTER_SHARE, n)
    phase = rng.uniform(0.0, 1.0 - JITTER_SHARE)
    if first:
        late[0] = phase = 0.0
    t: Array = np.round((np.arange(n) + phase + late) * period * 1e9) * 1e-9
    return t


def _at(planted: Planted, role: str, t: Array) -> Array:
    """Take a column at the instants (m,) s; a radar without target has nothing to say."""
    columns = planted.columns
    last = len(columns["t"]) - 1
    latest = np.clip((t / planted.dt + 1e-6).astype(int), 0, last)
    if role in STEPWISE:
        held: Array = columns[role][latest]
        return held
    value: Array = np.interp(t, columns["t"], columns[role])
    if role not in LEAD:
        return value
    # where another vehicle cuts in, the radar reports the one or the other and nothing in between
    after = np.minimum(latest + 1, last)
    jump = np.abs(columns["gap"][after] - columns["gap"][latest]) > 1.0
    value = np.where(jump, columns[role][latest], value)
    return np.where(columns["lead_valid"][latest] == 1.0, value, NAN)


def _late(effects: dict[str, dict[str, float]], t: Array, duration: float) -> Array:
    """Age of the radar's reports, (m,) s."""
    late = np.full(len(t), effects.get("radar_latency", {}).get("delay", 0.0))
    rate = effects.get("clock_skew", {}).get("rate", 0.0)
    return late + (rate * t / duration if rate >= 0.0 else -rate * (1.0 - t / duration))


def _wrong(role: str, x: Array, effects: dict[str, dict[str, float]]) -> Array:
    if role == "gap" and "range_offset" in effects:
        return x + effects["range_offset"]["distance"]
    if role == "speed" and "speed_scale" in effects:
        return x * (1.0 + effects["speed_scale"]["share"])
    if role == "range_rate":
        if "range_rate_scale" in effects:
            x = x * (1.0 + effects["range_rate_scale"]["share"])
        if "range_rate_sign" in effects:
            x = -x
    return x


def _frozen(values: dict[str, Array], t: Array, truth: dict[str, Any]) -> dict[str, Array]:
    """Repeat the last value through each episode of a stale signal."""
    when = truth.get("episodes", {}).get("stale_signal", [])
    if not when:
        return values
    roles = FREEZES[int(truth["effects"]["stale_signal"].get("signal", 0.0))]
    source = np.arange(len(t))
    for start, stop in when:
        inside = (t >= start) & (t < stop)
        source[inside] = max(int(np.searchsorted(t, start)) - 1, 0)
    return {role: x[source] if role in roles else x for role, x in values.items()}


def _wander(t: Array, rng: np.random.Generator) -> Array:
    """Draw an Ornstein-Uhlenbeck process of variance one at the instants (m,) s."""
    keep = np.exp(-np.diff(t, prepend=t[:1]) / ALTITUDE_ERROR_S)
    fresh = (np.sqrt(1.0 - keep * keep) * rng.standard_normal(len(t))).tolist()
    x, out = float(rng.standard_normal()), np.empty(len(t))
    for k, (a, e) in enumerate(zip(keep.tolist(), fresh, strict=True)):
        x = a * x + e
        out[k] = x
    return out
