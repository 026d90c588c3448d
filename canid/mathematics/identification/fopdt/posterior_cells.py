"""Grid of (tau, dead time) of one channel: midpoint cells over the parallelogram around an ellipse, and their prior mass."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.state_constraints import NOT_NEGATIVE, POSITIVE
from canid.values.types import Array

# Cells per axis: with a half-width of 4 sd a cell is 0.9 sd wide, where the midpoint rule is still exact to
# 1e-4.
CELLS_PER_AXIS = 9
HALF_WIDTH_SD = 4.0


class Region(NamedTuple):
    """Where the grid of one channel lies: an ellipse's bounding parallelogram."""

    tau: float  # centre, s
    dead_time: float  # centre, s
    tau_sd: Annotated[float, POSITIVE]  # s
    rest_sd: Annotated[float, POSITIVE]  # sd of dead time at given tau, s
    slope: float  # of dead time by tau


class Cells(NamedTuple):
    """The grid of one channel."""

    tau: Annotated[Array, POSITIVE]  # (c,) s
    dead_time: Annotated[Array, NOT_NEGATIVE]  # (c,) s
    weight: Annotated[Array, NOT_NEGATIVE]  # (c,) prior mass
    spacing: Annotated[tuple[float, float], POSITIVE]  # of tau and of dead time, at most, s
    tau_width: Annotated[Array, NOT_NEGATIVE]  # (c,) s, of each cell
    dead_time_width: Annotated[Array, NOT_NEGATIVE]  # (c,) s


def lean(cells: Cells) -> Array:
    """(c,) how much later in dead time a cell lies per s of tau: each is a parallelogram that leans as the grid does.

    >>> made = make_cells(Region(1.0, 0.6, 0.1, 0.05, -0.5), Box(0.02, 3.0, 1.5))
    >>> bool(np.allclose(lean(made), -0.5)), float(lean(make_cells(whole_box(Box(0.02, 3.0, 1.5)), Box(0.02, 3.0, 1.5)))[0])
    (True, 0.0)
    """
    side = round(len(cells.tau) ** 0.5)
    middle = cells.dead_time[side // 2 :: side]
    tau = cells.tau[::side]
    if not tau[-1] > tau[0]:
        return np.zeros(len(cells.tau))
    return np.repeat(np.gradient(middle, tau), side)


def whole_box(box: Box) -> Region:
    """Return the region that covers the box.

    >>> whole_box(Box(0.02, 3.0, 1.5)).slope
    0.0
    """
    tau, half = 0.5 * (box.tau_min + box.tau_max), 0.5 * (box.tau_max - box.tau_min)
    return Region(
        tau, 0.5 * box.dead_time_max, half / HALF_WIDTH_SD, 0.5 * box.dead_time_max / HALF_WIDTH_SD, 0.0
    )


def make_cells(region: Region, box: Box, cells: int = CELLS_PER_AXIS) -> Cells:
    """Midpoint cells over a region, cut off at the box.

    The prior mass of a cell is its area times 1/tau (a lag is a scale: 0.1 to 0.2 s weighs as 1 to 2 s) times
    1 - dead_time / dead_time_max (the end of the box is where belief ends, so it ends at zero). A uniform
    box would put a headway lag that is not identifiable at 2.2 s in the mean; as headway integrates range rate,
    K2 then comes out 3 % too large and its interval covers 0.72 (measured in closed loop; so 0.93).
    """
    low = max(box.tau_min, region.tau - HALF_WIDTH_SD * region.tau_sd)
    high = min(box.tau_max, region.tau + HALF_WIDTH_SD * region.tau_sd)
    middle = (np.arange(cells) + 0.5) / cells
    tau = low + (high - low) * middle
    centre = region.dead_time + region.slope * (tau - region.tau)
    # not np.clip, which takes three times as long
    bottom = np.minimum(np.maximum(centre - HALF_WIDTH_SD * region.rest_sd, 0.0), box.dead_time_max)
    top = np.minimum(np.maximum(centre + HALF_WIDTH_SD * region.rest_sd, 0.0), box.dead_time_max)
    width = top - bottom
    dead_time = bottom[:, None] + width[:, None] * middle
    lag = np.repeat(tau, cells)
    weight = np.repeat(width, cells) / lag * (1.0 - dead_time.ravel() / box.dead_time_max)
    spacing = ((high - low) / cells, float(np.max(width)) / cells)
    widths = np.full(len(lag), spacing[0]), np.repeat(width / cells, cells)
    return Cells(lag, dead_time.ravel(), weight, spacing, *widths)
