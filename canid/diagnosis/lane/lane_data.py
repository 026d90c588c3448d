"""Columns of lane keeping: lateral offset, road and steering angle without holes, and which samples are usable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver.driver_data import filled
from canid.diagnosis.fitting.likelihood import Output
from canid.diagnosis.masks import extended
from canid.findings import Flags
from canid.types import Array, LearnGate, Trace

# s; the longest memory of the driver that is modelled: dead time and lags
DRIVER_MEMORY_S = 2.5


class LaneData(NamedTuple):
    """Columns (n,) of one drive on its grid."""

    t: Array  # s since its first sample
    offset: Array  # m, from the middle of the lane, positive to the left; holes filled
    speed: Array  # m/s; zeros where it is not measured
    curvature: Array | None  # 1/m, of the road, positive to the left; None: not measured
    output: Output  # steering wheel angle, °

    @property
    def duration(self) -> float:
        """Of the whole drive, s."""
        return float(self.t[-1]) if self.t.size else 0.0


def prepare(trace: Trace, usable: Flags) -> LaneData:
    """Lay out the columns.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
    """
    n = trace.t.size
    offset = trace.inputs[:, 0] if n else np.zeros(0)
    known = np.isfinite(offset) & np.isfinite(trace.output)
    open_ = np.array([gate is LearnGate.OPEN for gate in trace.gate], dtype=bool)
    # where the samples' own history ends, the driver's memory is not known either
    begins = np.r_[True, np.diff(trace.segment) != 0] if n else np.zeros(0, dtype=bool)
    settled = ~extended(~(open_ & known & usable) | begins, round(DRIVER_MEMORY_S / trace.dt))
    nowhere = np.zeros(n, dtype=bool)
    output = Output(filled(trace.output), settled, nowhere, -np.inf, nowhere, np.inf, trace.dt)
    road = trace.signals.get("curvature")
    measured = road is not None and bool(np.isfinite(road[settled]).mean() > 0.5) if settled.any() else False
    return LaneData(
        trace.t - trace.t[0] if n else trace.t,
        filled(offset),
        filled(trace.signals.get("speed", np.zeros(n))),
        filled(road) if measured and road is not None else None,
        output,
    )
