"""Is the driver constant: level and power of the test over a whole drive, coverage of the band, change points."""

from __future__ import annotations

import numpy as np

from benchmarks.identification.gain_drives import NOISE_MODELS, SIX_NOISES, World
from benchmarks.identification.gain_paths import of_drive
from benchmarks.identification.table import Settings, Table, each
from canid.mathematics.identification.confidence import MISS

WORLDS = (
    World("pedal, loop A", "A"),
    World(f"pedal, loop A, {NOISE_MODELS[2].name}", "A", noise=NOISE_MODELS[2]),
    World(f"pedal, loop A, {SIX_NOISES[-1].name}", "A", noise=SIX_NOISES[-1]),
    World("pedal, loop B", "B"),
    World("acceleration", "acceleration"),
)
SHARES = (0.0, 0.1, 0.2, 0.3)
DRIVE_S = 1200.0


def table(settings: Settings) -> list[Table]:
    """Print one row for each world and sd of the gains."""
    few = settings.few(10)
    rows: list[tuple[object, ...]] = []
    for world in WORLDS:
        for share in SHARES:
            done = each(few, of_drive, world, DRIVE_S, share)
            known = [d for d in done if d.p_value == d.p_value]
            rows.append(
                (
                    world.name,
                    f"{100 * share:.0f} %",
                    len(known),
                    float(np.mean([d.p_value < MISS for d in known])) if known else np.nan,
                    float(np.mean([d.inside for d in known])) if known else np.nan,
                    float(np.mean([d.bias for d in known])) if known else np.nan,
                    float(np.median([d.sd for d in known])) if known else np.nan,
                    float(np.mean([d.held for d in known])) if known else np.nan,
                    sum(d.changes for d in done),
                )
            )
    return [
        Table(
            f"Drives of {DRIVE_S / 60:.0f} min whose gains walk at random: is K2 called constant?",
            (
                "world",
                "sd of the gains",
                "drives",
                "called varying (p < 0.05)",
                "band holds K2",
                "bias of the windows",
                "sd of K2 found (median)",
                "its interval holds",
                "change points",
            ),
            rows,
            (f"{few.runs} drives a row.",),
        )
    ]
