"""Drivers whose gains step: how soon it is followed and reported, and how often it is reported of a constant driver."""

from __future__ import annotations

import numpy as np

from benchmarks.identification.gain_drives import (
    AFTER_S,
    HELD_S,
    SIX_NOISES,
    World,
    false_alarms,
    follow,
    step_time,
)
from benchmarks.identification.ideal_step import chance
from benchmarks.identification.loops import LEADS
from benchmarks.identification.table import Settings, Table, each

FACTORS = (1.5, 0.67)
CLEAN_WORLDS = (
    *(World(f"pedal, loop A, {noise.name}", "A", noise=noise) for noise in SIX_NOISES),
    World("pedal, loop B", "B"),
    World("pedal, loop A, lively lead", "A", LEADS[2]),
    World("pedal, loop A, calm lead", "A", LEADS[0]),
    World("acceleration", "acceleration"),
)
# of the six noises the two that are most like people's
STEP_WORLDS = (*CLEAN_WORLDS[3:4], *CLEAN_WORLDS[5:])
# s of each clean drive
CLEAN_S = 900.0
# s within which a change is to be reported
REPORT_WITHIN_S = 30.0


def table(settings: Settings) -> list[Table]:
    """Print delays, and false alarms."""
    few = settings.few(10)
    rows: list[tuple[object, ...]] = []
    for world in STEP_WORLDS:
        for factor in FACTORS:
            done = each(few, follow, world, factor)
            ideal = each(few, _chance, world, factor)
            held = np.sort([d.held for d in done])
            first = np.array([d.detected for d in done])
            found = [d for d in done if np.isfinite(d.detected)]
            rows.append(
                (
                    f"{world.name}, x{factor}",
                    float(np.median(held)),
                    float(np.quantile(held, 0.9, method="higher")),
                    float(np.mean(first <= REPORT_WITHIN_S)),
                    float(np.mean(ideal)),
                    float(np.median(first)),
                    float(np.median([abs(d.error) for d in found])) if found else np.nan,
                    float(np.mean([d.inside for d in found])) if found else np.nan,
                    float(np.mean([d.after for d in found])) if found else np.nan,
                    sum(d.early for d in done),
                )
            )
    clean: list[tuple[object, ...]] = []
    fewer = settings.few(20)
    hours = fewer.runs * CLEAN_S / 3600.0
    for world in CLEAN_WORLDS:
        alarms = sum(each(fewer, false_alarms, world, CLEAN_S))
        clean.append((world.name, hours, alarms))
    total = sum(float(str(row[1])) for row in clean), sum(int(str(row[2])) for row in clean)
    clean.append(("all", *total))
    return [
        Table(
            "Both gains step by a factor: s until the headline holds the new K2, and what is reported",
            (
                "world",
                "held: median s",
                "90 % of runs",
                f"reported within {REPORT_WITHIN_S:.0f} s",
                "ideal detector",
                "median s",
                "error of its time, s",
                "time inside",
                "K2 after inside",
                "too early",
            ),
            rows,
            (
                f"{few.runs} runs a row, {AFTER_S:.0f} s after the step. Held: the 95 % interval holds the new K2 for "
                f"{HELD_S:.0f} s. inf: not within {AFTER_S:.0f} s. Inside: share of the reported changes. "
                "Ideal detector: knows inputs, gains, lags, dead times and noise model, all but the instant.",
            ),
        ),
        Table("Constant drivers: reported changes", ("world", "hours", "reported"), clean),
    ]


def _chance(seed: int, world: World, factor: float) -> float:
    return chance(seed, world, factor, step_time(seed), REPORT_WITHIN_S)
