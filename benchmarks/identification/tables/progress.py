"""How many more seconds of driving would do: the forecast against what it took."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT
from benchmarks.identification.table import Settings, Table, each
from canid.types import Channel, Identifiable, OutputFilter

MINUTES = 20.0
STEP = 1.12  # the drive grows by this factor from one fit to the next
FIRST = 60.0  # s of the first
ORDER = (Identifiable.NOT, Identifiable.GAIN_ONLY, Identifiable.SUM_ONLY, Identifiable.OK)
NOISES = (*NOISE_MODELS, REMNANT)


def table(settings: Settings) -> list[Table]:
    """The last forecasts of at least half a minute before a channel came to its next status."""
    found = [ratio for one in each(settings, _one) for ratio in one]
    rows: list[tuple[object, ...]] = []
    for i, name in enumerate(("headway error", "range rate")):
        for kind in ("K", "tau_plus_dead_time", "tau", "dead_time"):
            ratios = np.array([r for channel, parameter, r in found if channel == i and parameter == kind])
            if len(ratios):
                rows.append((f"{name}: {kind}", len(ratios), *_summary(ratios)))
    every = np.array([r for *_, r in found])
    rows.append(("all", len(every), *(_summary(every) if len(every) else (np.nan, np.nan))))
    return [
        Table(
            f"Forecast over what it took, drives of up to {MINUTES:.0f} min, six noises",
            ("missing", "forecasts", "median", "within a factor of 2"),
            rows,
        )
    ]


def _summary(ratios: np.ndarray) -> tuple[float, float]:
    return float(np.median(ratios)), float(np.mean((ratios >= 0.5) & (ratios <= 2.0)))


def _one(seed: int) -> list[tuple[int, str, float]]:
    drive = acceleration.drive(seed, MINUTES, NOISES[seed % len(NOISES)])
    y = drive.acceleration + np.random.default_rng((seed, 2)).normal(0.0, 0.02, len(drive.acceleration))
    times = FIRST * STEP ** np.arange(int(np.log(MINUTES * 60.0 / FIRST) / np.log(STEP)) + 1)
    fits = [_channels(y, drive.inputs, round(t / DT)) for t in times]
    out = []
    for i in range(2):
        rank = [ORDER.index(fit[i].status) for fit in fits]
        for level in range(1, len(ORDER)):
            reached = next((k for k in range(len(rank)) if min(rank[k : k + 3]) >= level), None)
            if not reached:
                continue
            # half of the way before: a forecast of the same length
            at = int(np.searchsorted(times, 0.5 * times[reached]))
            missing = fits[at][i].progress
            if at < reached and rank[at] == level - 1 and missing is not None and missing.seconds > 0.0:
                out.append((i, missing.parameter, missing.seconds / (times[reached] - times[at])))
    return out


def _channels(y: np.ndarray, u: np.ndarray, n: int) -> tuple[Channel, ...]:
    return canid_side.process(y[:n], u[:n], DT, output_filter=OutputFilter("none")).channels
