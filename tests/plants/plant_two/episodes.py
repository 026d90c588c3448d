"""When events happen: stretches of a drive, drawn apart from each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

# effects that are events
EVENTS = ("attention_gap", "cruise_control", "gear_shift", "cut_in", "brake_overlap", "stale_signal")
# s; nothing happens before the driver follows, nor so close to another event that the two are one
QUIET, APART = 15.0, 3.0
# share by which single episodes differ in length, and what attention gaps and shifts last at all, s
LENGTH_VARIATION = 0.3
LENGTHS_S = {"attention_gap": (1.5, 6.0), "gear_shift": (0.4, 1.0)}


def episodes(
    effect: str, values: Mapping[str, float], seconds: float, rng: np.random.Generator
) -> list[list[float]]:
    """Draw [[start, stop], ...] s of an effect; [] for one that is no event.

    >>> [[round(t) for t in e] for e in episodes("cut_in", {"time": 90.0}, 600.0, np.random.default_rng(1))]
    [[90, 93]]
    """
    if effect == "cruise_control":
        return [[values["start"], values["start"] + values["duration"]]]
    if effect == "cut_in":  # for 3 s nothing that is measured means what it did
        return [[values["time"], values["time"] + 3.0]]
    if effect not in EVENTS:
        return []
    shortest, longest = LENGTHS_S.get(effect, (0.0, seconds))
    out: list[list[float]] = []
    t = QUIET
    pause = 60.0 / values["per_minute"]
    while True:
        lasts = values["duration"] * rng.uniform(1.0 - LENGTH_VARIATION, 1.0 + LENGTH_VARIATION)
        lasts = min(max(lasts, shortest), longest)
        # the mean distance of two starts is 60 s / per_minute; a third of an exponential's variance, so that ten minutes
        # hold about as many as they should
        t += APART + rng.gamma(3.0, max(pause - lasts - APART, 1.0) / 3.0)
        if t + lasts > seconds - APART:
            return out
        out.append([round(t, 3), round(t + lasts, 3)])
        t += lasts
