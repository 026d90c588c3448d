"""What a reader of a comparison has to know before he believes it, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from canid.analysis.comparison.drive import DriveEstimates, Side
from canid.mathematics.identification.confidence import MISS


def remarks(a: Side, b: Side, *, joint: bool) -> tuple[str, ...]:
    """Sentences on how the sides were compared.

    Args:
        a: one side.
        b: the other.
        joint: the correlation of the parameters' errors was used.
    """
    return tuple(_remarks(a, b, joint))


def _remarks(a: Side, b: Side, joint: bool) -> Iterator[str]:
    every = [*a.drives, *b.drives]
    if len(every) == 2:
        yield (
            "one drive a side: this compares the two drives; how much one driver varies from drive to drive is not in the "
            "intervals (name several logs a side)"
        )
    else:
        yield (
            f"{len(a.drives)} and {len(b.drives)} drives: the spread between drives of one driver is in the intervals, "
            f"with Student's t of {len(every) - 2} degree{'s' * (len(every) > 3)} of freedom"
        )
    if not joint and len(every) == 2 and any(drive.quantities for drive in every):
        yield (
            "how the errors of the parameters go together is not known on both sides: the test is conservative "
            "(Šidák); compare logs, or JSON that this version wrote, for the joint posterior"
        )
    if len({drive.method for drive in every}) > 1:
        yield "one side is from identify, the other from diagnose, whose models differ: compare like with like"
    outputs = {drive.output for drive in every if drive.output}
    if len(outputs) > 1:
        yield f"the outputs differ ({', '.join(sorted(outputs))}): gains are compared only in one unit, times always"
    vehicles = {drive.vehicle for drive in every}
    if len(vehicles) > 1 and outputs == {"pedal"}:
        yield "the vehicles differ: a percent of pedal is not the same demand in two cars, so gains may differ by the car"
    for label, side in (("A", a), ("B", b)):
        for drive in side.drives:
            yield from _within(label, side, drive)


def _within(label: str, side: Side, drive: DriveEstimates) -> Iterator[str]:
    name = label if len(side.drives) == 1 else f"{label} ({drive.name})"
    if drive.changes:
        times = ", ".join(f"{t:.0f}" for t in drive.changes)
        ends = [0.0, *drive.changes, *([drive.duration] if math.isfinite(drive.duration) else [])]
        parts = " or ".join(f"LOG@{p:.0f}:{q:.0f}" for p, q in pairwise(ends))
        yield f"{name}: the gains changed at {times} s; compare its parts, {parts}"
    for level in drive.levels:
        if level.p_value < MISS:
            readable = level.name.replace("_", " ").replace("tau plus dead time", "τ+θ")
            yield f"{name}: {readable} varies within the drive (sd {level.variation:.2g}): smaller differences are ordinary"
