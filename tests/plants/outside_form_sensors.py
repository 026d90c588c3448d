"""What a bus shows of a drive: a late, coarse radar that loses its target, wheel ticks, an 8-bit pedal, jitter."""

from __future__ import annotations

import numpy as np

from canid import from_arrays
from canid.values.types import OutputFilter, Trace
from tests.plants.outside_form import Driven, H, World


def seen(world: World, driven: Driven) -> Trace:
    """Read the messages through the path of a table; each has its own times."""
    rng = np.random.default_rng([world.seed, 3])
    end = len(driven.gap) * H - 0.2

    def clock(period: float) -> np.ndarray:
        t = np.arange(0.3 + rng.uniform(0.0, period), end, period)
        jittered: np.ndarray = t + rng.uniform(0.0, 0.1 * period, len(t))
        return jittered

    def at(t: np.ndarray, x: np.ndarray) -> np.ndarray:
        found: np.ndarray = x[np.clip(np.round(t / H).astype(int), 0, len(x) - 1)]
        return found

    radar, fast = clock(world.radar), clock(0.02)
    then = radar - world.latency
    gap = 0.1 * np.round((at(then, driven.gap) + rng.normal(0.0, 0.1, len(radar))) / 0.1)
    rate = 0.05 * np.round((at(then, driven.rate) + rng.normal(0.0, 0.06, len(radar))) / 0.05)
    valid = np.ones(len(radar))
    for begin in rng.uniform(10.0, end, rng.poisson(world.minutes * 0.4)):
        valid[(radar > begin) & (radar < begin + rng.uniform(0.3, 2.5))] = 0.0
    tick = 0.03
    pedal = np.round(at(fast, driven.pedal) * 2.55) / 2.55
    own = clock(0.02)
    speed = tick * np.floor(at(own, driven.speed) / tick + rng.uniform(size=len(own)))
    time = np.concatenate([radar, fast, own])
    begins = {"gap": 0, "pedal": len(radar), "speed": len(radar) + len(fast)}
    messages = {
        "gap": {
            "gap": np.where(valid > 0, gap, np.nan),
            "range_rate": np.where(valid > 0, rate, np.nan),
            "lead_valid": valid,
        },
        "pedal": {"pedal": pedal, "brake": at(fast, driven.brake)},
        "speed": {"speed": speed},
    }
    columns = {}
    for first, values in messages.items():
        for name, x in values.items():
            columns[name] = np.full(len(time), np.nan)
            columns[name][begins[first] : begins[first] + len(x)] = x
    order = np.argsort(time, kind="stable")
    of = {name: x[order] for name, x in columns.items()}
    return from_arrays(
        time=time[order],
        output="pedal",
        output_filter=OutputFilter("none"),
        gap=of["gap"],
        range_rate=of["range_rate"],
        lead_valid=of["lead_valid"],
        speed=of["speed"],
        pedal=of["pedal"],
        brake=of["brake"],
    )
