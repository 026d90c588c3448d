"""Where the posterior of one channel lies on a grid: the region of the next, finer grid, and whether a grid holds it."""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification.fopdt.fopdt_posterior import Grid, marginal
from canid.mathematics.identification.fopdt.posterior_cells import HALF_WIDTH_SD, Region
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.types import Array


def _onto(weight: Array, channel: int) -> Array:
    other = tuple(i for i in range(weight.ndim) if i != channel)
    out: Array = weight.sum(axis=other) if other else weight
    return out


# sd in cells from which on a grid shows where a posterior lies and how it leans; below, one cell hides it.
MIN_SD_CELLS = 0.8


def gather(grid: Grid, channel: int, box: Box) -> Region:
    """Where the posterior of one channel lies: the region of the next, finer grid.

    A posterior narrower than a cell is replaced by a power of it, log/4, log/16, ..., which is wide
    enough to be seen; for a Gaussian that leaves the centre and the slope and doubles the widths each time.
    """
    c = grid.cells[channel]
    power = 1.0
    while True:
        w = marginal(grid, channel) if power == 1.0 else _onto(np.exp(power * grid.log), channel)
        w = w / w.sum()
        tau, dead_time = float(w @ c.tau), float(w @ c.dead_time)
        vt = float(w @ (c.tau - tau) ** 2)
        slope = float(w @ ((c.tau - tau) * (c.dead_time - dead_time))) / max(vt, 1e-12)
        rest = float(w @ (c.dead_time - dead_time - slope * (c.tau - tau)) ** 2)
        seen = vt >= (MIN_SD_CELLS * c.spacing[0]) ** 2 and rest >= (MIN_SD_CELLS * c.spacing[1]) ** 2
        # 1e-6: a thousandth of a cell; nothing in a drive is known to more
        if seen or power < 1e-6:
            break
        power *= 0.25
    # a twelfth of a cell squared is the variance of a uniform cell: not to shrink more than fourfold at once
    vt = max(vt * power, c.spacing[0] ** 2 / 12)
    rest = max(rest * power, c.spacing[1] ** 2 / 12)
    spills_tau, spills_rest = _spills(grid, channel, box)
    w = marginal(grid, channel)
    # where the posterior lies partly outside, half as wide again as this grid, and centred on the rim
    side = round(len(w) ** 0.5)
    grow = 1.5 * side / (2.0 * HALF_WIDTH_SD)
    return Region(
        tau,
        dead_time,
        max(vt**0.5, grow * c.spacing[0]) if spills_tau else vt**0.5,
        max(rest**0.5, grow * c.spacing[1]) if spills_rest else rest**0.5,
        slope,
    )


# Mass on the rim of a grid that does not end at the box: the posterior lies partly outside. On a Gaussian
# within its four sd the rim holds 0.1 %; a tenth of what a flat posterior would hold there is twelve times
# that.
SPILLED_SHARE = 0.012

# The same, beyond which a grid must not be believed: some posteriors have tails that no grid of 4 sd holds.
MISSED_SHARE = 0.05


def missed(grid: Grid, channel: int, box: Box) -> bool:
    """Whether the posterior of one channel lies to a good part outside its grid."""
    return any(_spills(grid, channel, box, MISSED_SHARE))


def _spills(grid: Grid, channel: int, box: Box, most: float = SPILLED_SHARE) -> tuple[bool, bool]:
    """Whether along tau, and along dead time."""
    w, c = marginal(grid, channel), grid.cells[channel]
    side = round(len(w) ** 0.5)
    table, dead_time = w.reshape(side, side), c.dead_time.reshape(side, side)
    half_tau, half = 0.51 * c.spacing[0], 0.51 * c.spacing[1]
    low, high = table[:, 0], table[:, -1]
    tau = (c.tau[0] - half_tau > box.tau_min and float(table[0].sum()) > most) or (
        c.tau[-1] + half_tau < box.tau_max and float(table[-1].sum()) > most
    )
    rest = (
        float(low[dead_time[:, 0] - half > 0.0].sum()) > most
        or float(high[dead_time[:, -1] + half < box.dead_time_max].sum()) > most
    )
    return tau, rest
