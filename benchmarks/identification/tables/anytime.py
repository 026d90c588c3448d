"""Watched every second for ten minutes: how often does an interval ever miss the truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.identification import canid_side, loop_a, open_loop
from benchmarks.identification.bus import exactly
from benchmarks.identification.table import Settings, Table, each

MINUTES = 10.0
GAIN = float(open_loop.B.sum() / open_loop.A.sum())


def table(settings: Settings) -> list[Table]:
    """Print ever-miss shares of both intervals, and their widths."""
    slow = settings.few(2)
    rows: list[tuple[object, ...]] = []
    without: set[str] = set()
    worlds = (
        ("Chen & Ulsoy, 20 dB", _table1, ("lateral_offset",)),
        ("car following, loop A", _following, ("headway_error", "range_rate")),
    )
    for world, make, names in worlds:
        for estimator in ("armax", "fopdt"):
            # one run first: an estimator that makes no such promise is not watched for hours
            first = make(slow.first_seed, estimator, names, 240.0)
            if all(np.isnan(row[2]) for row in first):
                without.add(f"{estimator} promises no anytime interval.")
                continue
            done = each(slow, make, estimator, names, 60.0 * MINUTES)
            for i, name in enumerate(names):
                cells = np.array([run[i] for run in done], float)  # naive miss, updates, anytime miss, ratio
                reported = cells[:, 1] > 0
                rows.append(
                    (
                        world,
                        estimator,
                        f"K {name}",
                        _of(np.mean, cells[reported, 0]),
                        _of(np.mean, cells[reported, 2]),
                        _of(np.median, cells[:, 3]),
                        _of(np.median, cells[:, 4]),
                        int(reported.sum()),
                    )
                )
    return [
        Table(
            f"Read every second for {MINUTES:.0f} min: share of runs whose interval ever misses the truth",
            (
                "world",
                "estimator",
                "parameter",
                "95 % interval",
                "anytime interval",
                "width ratio",
                "in the last 5 min",
                "runs",
            ),
            rows,
            ("Width ratio: median over time of anytime over plain, then over runs.", *sorted(without)),
        )
    ]


def _of(statistic: Callable[[np.ndarray], float], values: np.ndarray) -> float:
    """Take a statistic of what is known; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(statistic(known)) if len(known) else float("nan")


def _table1(seed: int, estimator: str, names: tuple[str, ...], seconds: float) -> list[tuple[float, ...]]:
    run = open_loop.table1(seed, round(seconds / open_loop.TABLE1_DT), 20.0)
    return _watch(estimator, names, run.y, run.u[:, None], (GAIN,))


def _following(seed: int, estimator: str, names: tuple[str, ...], seconds: float) -> list[tuple[float, ...]]:
    drive = loop_a.drive(seed, seconds)
    seen = exactly(drive)
    return _watch(estimator, names, seen.output, seen.inputs, tuple(c.K for c in drive.channels))


def _watch(
    estimator: str, names: tuple[str, ...], y: np.ndarray, u: np.ndarray, truth: tuple[float, ...]
) -> list[tuple[float, ...]]:
    """Per input: did the plain interval ever miss, how many updates, did the anytime one, median width ratio (all, late)."""
    missed = [[False, False] for _ in names]
    ratios: list[list[tuple[float, float]]] = [[] for _ in names]
    for estimate in canid_side.live(estimator, names, y, u, 0.1, 1.0):
        for i, (name, K) in enumerate(zip(names, truth, strict=True)):
            channel = estimate.channels[name]
            plain, anytime = channel.K, channel.K_anytime
            if np.isfinite(plain.value):
                missed[i][0] |= not plain.low <= K <= plain.high
            if np.isfinite(anytime.low):
                missed[i][1] |= not anytime.low <= K <= anytime.high
                if plain.high > plain.low:
                    ratios[i].append((estimate.t, (anytime.high - anytime.low) / (plain.high - plain.low)))
    half = 0.5 * len(y) * 0.1
    out = []
    for (plain_miss, anytime_miss), pairs in zip(missed, ratios, strict=True):
        late = [ratio for t, ratio in pairs if t > half]
        every = [ratio for _, ratio in pairs]
        out.append(
            (
                float(plain_miss),
                float(len(every)),
                float(anytime_miss) if every else np.nan,
                float(np.median(every)) if every else np.nan,
                float(np.median(late)) if late else np.nan,
            )
        )
    return out
