"""Limits of a gap without the values that stand for no vehicle ahead, as a log shows them."""

from __future__ import annotations

import numpy as np

from canid.signals.samples import no_target
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import Array


def gap_limits(
    t: Array, gap: Array, speed: Array, ends: tuple[float, float], resolution: float
) -> tuple[float, float] | None:
    """Find limits that leave out what stands for no vehicle ahead; None: nothing does, or no limit leaves it out.

    Args:
        t: (n,) s.
        gap: (n,) m; NaN: not measured.
        speed: (n,) m/s, own.
        ends: m, the smallest and largest gap that its bits can hold.
        resolution: m, of the gap.

    Example:
        >>> t, speed = 0.1 * np.arange(200.0), np.full(200, 20.0)
        >>> gap = np.where(t < 5.0, 0.0, 30.0 + t)
        >>> gap_limits(t, gap, speed, (0.0, 204.7), 0.1)
        (0.05, 204.7)
    """
    rows = np.arange(len(t))
    readings = RoleReadings("speed", rows, speed), RoleReadings("gap", rows, gap)
    _, decoded, _ = no_target.step(no_target.init(), Decoded(readings, (), ()), t, ends[1])
    none = gap[np.isfinite(gap) & np.isnan(decoded.roles[1].value)]
    # a number is none before it is known to be, too
    some = gap[np.isfinite(gap) & ~np.isin(gap, none)]
    if not none.size or not some.size:
        return None
    # half a step keeps the rounding of a conversion out
    below, above = none[none < some.min()], none[none > some.max()]
    if not below.size and not above.size:
        return None
    low = float(below.max()) + 0.5 * resolution if below.size else ends[0]
    high = float(above.min()) - 0.5 * resolution if above.size else ends[1]
    return low, high
