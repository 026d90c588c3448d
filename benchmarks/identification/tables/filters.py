"""Accelerations that were smoothed before they were published: with the filter stated, and without."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT, Measured
from benchmarks.identification.noise_models import REMNANT
from benchmarks.identification.peers import gls
from benchmarks.identification.table import Settings, Table, each
from canid.types import Identifiable, OutputFilter

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
    for how in CASES:
        done = each(settings, _one, how, settings.peers)
        for declared in (*SHOWN, *(("plain GLS",) if settings.peers else ())):
            found = np.array([one[declared] for one in done], float)
            rows.append(
                (how.name, declared, *np.nanmean(found[:, :4], axis=0), *np.nanmedian(found[:, 4:], axis=0))
            )
    return [
        Table(
            f"Accelerations in closed loop, {' and '.join(f'{m:g}' for m in MINUTES)} min: share of 95 % intervals that "
            "hold the truth",
            (
                "output",
                "filter",
                "K1",
                "K2",
                "tau2 + dead time 2",
                "of these quotable",
                "width K2",
                "width tau2 + dead time 2",
            ),
            rows,
            ("Widths: of the interval, K2's over K2; medians.",),
        )
    ]


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
        width = (two.K.high - two.K.low) / second.K, two.tau_plus_dead_time.high - two.tau_plus_dead_time.low
        out[name] = (*held, float(quotable), *width)
    if peers:
        found = gls.fit(y, drive.inputs, DT)
        held = [float(abs(v - x) <= UNIT * s) for v, s, x in zip(*found, truth, strict=True)]
        out["plain GLS"] = (*held, np.nan, 2 * UNIT * found.sd[1] / second.K, 2 * UNIT * found.sd[2])
    return out
