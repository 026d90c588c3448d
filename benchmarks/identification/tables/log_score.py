"""Measured drives of people: what the law of the innovations is worth, by held-out one-step predictive density."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.identification import canid_side
from benchmarks.identification.table import Settings, Table

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
DRIVES = (
    "asta/asta_p10_f2_Audi_A6",
    "asta/asta_p10_f4_Mercedes_AClass",
    "asta/asta_p3_f2_Tesla_Model3",
    "asta/asta_p3_f4_Audi_A6",
    "openacc/human_h22_v3",
    "openacc/human_h22_v5",
    "openacc/human_h22_v6",
)


def table(settings: Settings) -> list[Table]:
    """Each half fits, the other judges; one mean law, two laws of the innovations."""
    rows: list[tuple[object, ...]] = []
    for path in (DATA / f"{name}.blf" for name in DRIVES):
        if not path.exists():
            continue
        vehicle = "openacc_asta" if path.parent.name == "asta" else "openacc"
        scores = [canid_side.held_out(path, vehicle, half) for half in (0, 1)]
        rows.append(
            (
                path.stem,
                float(np.mean([s.gaussian for s in scores])),
                float(np.mean([s.law - s.gaussian for s in scores])),
                " / ".join(f"{s.freedom:g}" for s in scores),
                float(np.mean([canid_side.recursive(path, vehicle, half) for half in (0, 1)])),
            )
        )
    columns = (
        "drive",
        "Gaussian AR, nats/min",
        "gain of canid's law",
        "degrees of freedom",
        "gain on ARMAX's innovations",
    )
    if not rows:
        rows = [("measured drives", f"{DATA} is not there")]
    return [Table("Held-out one-step log score, two halves", columns, rows)]
