"""A wanted headway that drifts: what is left of the gain, and what steady drives pay."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.bounds import Lag
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT, draw
from benchmarks.identification.table import Settings, Table, each

FINE, GRID = 0.02, 0.1  # s
HEADWAY = 1.6  # s
MINUTES = (3.0, 10.0, 20.0)
NOISES = (NOISE_MODELS[1], NOISE_MODELS[2], REMNANT, NOISE_MODELS[3])
# name, share of the headway by which it grows over the drive, sd of a random walk in s
DRIFTS = (
    ("steady", 0.0, 0.0),
    ("ramp 6 %", 0.06, 0.0),
    ("walk 0.25 s", 0.0, 0.25),
    ("ramp and walk", 0.06, 0.15),
)
FIELDS = (("K1", 0, "K"), ("K2", 1, "K"), ("tau2 + dead time 2", 1, "tau_plus_dead_time"))


def table(settings: Settings) -> list[Table]:
    """Coverage with the offset's drift."""
    rows: list[tuple[object, ...]] = []
    for name, ramp, walk in DRIFTS:
        done = each(settings.few(5), _run, ramp, walk)
        held = np.mean([one[0] for one in done], axis=0)
        rows.append((name, float(np.mean([one[1] > 0 for one in done])), *held))
    return [
        Table(
            f"Wanted headway that drifts, closed loop, {', '.join(f'{m:g}' for m in MINUTES)} min in turn",
            (
                "wanted headway",
                "drift found",
                *(f"{f[0]} held" for f in FIELDS),
            ),
            rows,
            (f"{settings.few(5).runs} drives a row, four noises in turn.",),
        )
    ]


def _run(seed: int, ramp: float, walk: float) -> tuple[list[bool], float]:
    y, u, truth = drive(seed, ramp, walk)
    fit = canid_side.process(y, u, GRID)
    held = []
    for _, i, field in FIELDS:
        of, interval = truth[i], getattr(fit.channels[i], field)
        x = of.tau + of.dead_time if field == "tau_plus_dead_time" else of.K
        held.append(bool(interval.low <= x <= interval.high))
    return held, fit.drift


def drive(seed: int, ramp: float, walk: float) -> tuple[np.ndarray, np.ndarray, tuple[Lag, Lag]]:
    """Simulate a driver on a pedal: output, inputs (n, 2) without a sensor, truth."""
    rng = np.random.default_rng([seed, 99])
    n = round(MINUTES[seed % len(MINUTES)] * 60.0 / FINE)
    gains = rng.uniform(2.5, 6.0), rng.uniform(4.0, 8.0)
    tau, dead_time = rng.uniform(0.3, 0.7, 2), rng.uniform(0.2, 0.5, 2)
    noise = draw(NOISES[seed % len(NOISES)], n, FINE, rng)
    lead = acceleration.lead_speed(rng, n)
    wanted = HEADWAY * (1.0 + ramp * np.arange(n) / n)
    if walk:
        steps = np.cumsum(rng.normal(size=n))
        wanted = wanted + walk * steps / steps.std()
    late, decay = np.round(dead_time / FINE).astype(int), np.exp(-FINE / tau)
    state, v, gap = [0.0, 0.0], float(lead[0]), HEADWAY * float(lead[0])
    error, out = np.zeros((2, n)), np.empty((3, n))
    for i in range(n):
        error[:, i] = gap / v - wanted[i], lead[i] - v
        for k in range(2):
            u = error[k, i - late[k]] if i >= late[k] else 0.0
            state[k] = decay[k] * state[k] + (1.0 - decay[k]) * u
        pressed = gains[0] * state[0] + gains[1] * state[1] + noise[i]
        out[:, i] = pressed, gap / v - HEADWAY, lead[i] - v
        gap = max(gap + FINE * (lead[i] - v), 2.0)
        v = max(v + FINE * 0.05 * pressed, 3.0)
    pick = slice(None, None, round(GRID / FINE))
    first, second = (
        Lag(float(K), float(t), float(d)) for K, t, d in zip(gains, tau, late * FINE, strict=True)
    )
    return out[0, pick], out[1:, pick].T, (first, second)
