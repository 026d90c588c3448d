"""Change of the vehicle ahead: the inputs jump, and the driver first reacts to the change itself."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, MaskInput, Params
from canid.values.findings import Flags
from canid.values.types import Array

# m; another vehicle is at least the length of a short car nearer or further than the previous one would be; radars
# jump by up to 2 m between parts of one vehicle
MIN_JUMP_M = 3.0
# s without any lead after which the next one is a new start, not a change
MAX_HOLE_S = 1.0
# s; first reaction to the change: braking or releasing the pedal comes first, following afterwards (the headway itself
# takes some 10 s to relax, which is a response that can be fitted again)
REACTION_S = 3.0


def recognise(drive: MaskInput) -> Flags:
    """Where the gap has just jumped against its own range rate, (n,).

    Example:
        >>> gap = np.r_[np.full(5, 40.0), np.full(40, 22.0)]
        >>> signals = {"gap": gap, "range_rate": np.zeros(45)}
        >>> flags = recognise(MaskInput(np.arange(45) * 0.1, 0.1, signals, np.zeros(45), True))
        >>> int(np.argmax(flags)), int(flags.sum())
        (5, 30)
    """
    n, dt = drive.t.size, drive.dt
    out = np.zeros(n, dtype=bool)
    gap, rate = drive.signals.get("gap"), drive.signals.get("range_rate")
    if gap is None or rate is None:
        return out
    known = np.flatnonzero(np.isfinite(gap) & np.isfinite(rate))
    if known.size < 2:
        return out
    before, after = known[:-1], known[1:]
    passed = drive.t[after] - drive.t[before]
    moved = gap[after] - gap[before] - 0.5 * (rate[before] + rate[after]) * passed
    # a change may extend over two grid points: the gap was interpolated between the last report of the previous vehicle
    # and the first one of the next
    pair = np.abs(np.convolve(moved, [1.0, 1.0])[: moved.size])
    jumped = (np.maximum(np.abs(moved), pair) > MIN_JUMP_M) & (passed <= MAX_HOLE_S)
    length = round(REACTION_S / dt)
    for k in after[jumped]:
        if not out[k]:
            out[k : k + length] = True
    return out


def imitate(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Report another vehicle, `p[0]` m nearer."""
    columns["gap"][at] = columns["gap"][at] - p[0]


EFFECT = Effect(
    id="cut_in",
    says="Another vehicle is ahead: one cut in, or the previous lead left.",
    where="driver",
    kind=Kind.MASK,
    parameters=(),
    needs=("gap", "range_rate"),
    source="relaxation after lane changes: Laval & Leclercq 2008",
    mask=recognise,
    breaks_redundancy=True,
    imitate=imitate,
    found_at=((20.0, 8.0),),
    silent_at=((20.0, 1.0),),
)
