"""Accelerations that were smoothed before they were published: with the filter stated, and without."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT, Measured
from benchmarks.identification.noise_models import REMNANT
from benchmarks.identification.peers import gls
from benchmarks.identification.table import Settings, Table, each
from canid.values.types import Identifiable, OutputFilter

MINUTES = (3.0, 10.0)  # in turn
CASES = (
    Measured("not smoothed", "none", 0.0, 0.02),
    Measured("Savitzky-Golay 1.1 s, speed ±0.003 m/s", "savitzky_golay", 1.1, 0.003),
    Measured("Savitzky-Golay 1.1 s, speed ±0.02 m/s", "savitzky_golay", 1.1, 0.02),
    Measured("moving average 0.7 s, speed ±0.01 m/s", "moving_average", 0.7, 0.01),
    Measured("first order 0.5 s, speed ±0.01 m/s", "first_order", 0.5, 0.01),
)
UNIT = 1.96
# what is printed; of `unknown` no delay is quoted
SHOWN = ("stated", "nothing")


def table(settings: Settings) -> list[Table]:
    """How often the intervals hold the truth."""
    rows: list[tuple[object, ...]] = []
    ways = (*SHOWN, *(("plain GLS",) if settings.peers else ()))
    for how in CASES:
        done = each(settings, _one, how, settings.peers)
        share = np.array([[one[way] for way in ways] for one in done], float).mean(
            axis=0
        )  # (ways, parameters)
        rows.append((how.name, *share[:, :3].T.ravel(), *share[: len(SHOWN), 3]))
    return [
        Table(
            f"Accelerations in closed loop, {' and '.join(f'{m:g}' for m in MINUTES)} min: share of 95 % intervals that "
            "hold the truth",
            (
                "output",
                *(f"{x}: {way}" for x in ("K1", "K2", "τ2+θ2") for way in ways),
                *(f"quotable: {way}" for way in SHOWN),
            ),
            rows,
        )
    ]


def distinct(how: Measured) -> tuple[str, ...]:
    """Return what is printed by tables that have no room for the same figures twice."""
    return SHOWN[:1] if how.kind == "none" else SHOWN


def given(how: Measured) -> dict[str, OutputFilter | None]:
    """What a user may state of a filter."""
    return {"stated": OutputFilter(how.kind, how.width), "unknown": OutputFilter("unknown"), "nothing": None}  # type: ignore[arg-type]


def _one(seed: int, how: Measured, peers: bool) -> dict[str, tuple[float, ...]]:
    drive = acceleration.drive(seed, MINUTES[seed % len(MINUTES)], REMNANT)
    y = acceleration.published(drive, how, seed)
    first, second = drive.channels
    truth = (first.K, second.K, second.tau + second.dead_time)
    out = {}
    for name, of in given(how).items():
        one, two = canid_side.process(y, drive.inputs, DT, output_filter=of).channels
        quotable = two.status in (Identifiable.OK, Identifiable.SUM_ONLY)
        intervals = (one.K, two.K, two.tau_plus_dead_time)
        held = [float(iv.low <= x <= iv.high) for iv, x in zip(intervals, truth, strict=True)]
        out[name] = (*held, float(quotable))
    if peers:
        found = gls.fit(y, drive.inputs, DT)
        held = [float(abs(v - x) <= UNIT * s) for v, s, x in zip(*found, truth, strict=True)]
        out["plain GLS"] = (*held, np.nan)
    return out
