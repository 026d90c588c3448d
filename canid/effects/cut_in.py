"""Another vehicle ahead from one moment to the next: what the driver answers is not what he answered before."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Drive, Effect
from canid.findings import Flags

# m; another vehicle is at least a short car's length nearer or further than the one before it would be; radars jump
# by up to 2 m between parts of one vehicle
JUMP = 3.0
# s without any lead after which the next one is a new beginning, not a change
HOLE = 1.0
# s; how long he looks at what is new: braking or letting go comes first, following afterwards (the headway itself
# takes some 10 s to relax, which is an answer that can be fitted again)
LOOKS = 3.0


def recognise(drive: Drive) -> Flags:
    """Where the gap has just jumped against its own range rate, (n,).

    Example:
        >>> gap = np.r_[np.full(5, 40.0), np.full(40, 22.0)]
        >>> signals = {"gap": gap, "range_rate": np.zeros(45)}
        >>> flags = recognise(Drive(np.arange(45) * 0.1, 0.1, signals, np.zeros(45), True))
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
    # a change of vehicles may be spread over two grid points: between the reports of the old one and of the new one
    # the gap was interpolated
    pair = np.abs(np.convolve(moved, [1.0, 1.0])[: moved.size])
    jumped = (np.maximum(np.abs(moved), pair) > JUMP) & (passed <= HOLE)
    length = round(LOOKS / dt)
    for k in after[jumped]:
        if not out[k]:
            out[k : k + length] = True
    return out


EFFECT = Effect(
    id="cut_in",
    says="Another vehicle is ahead: one cut in, or the one ahead left.",
    where="driver",
    kind="mask",
    parameters=(),
    needs=("gap", "range_rate"),
    source="relaxation after lane changes: Laval & Leclercq 2008",
    mask=recognise,
)
