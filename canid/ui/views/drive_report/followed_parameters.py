"""The parameters that a whole drive was long enough to follow, and the changes of its gains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.confidence import MISS, NORMAL_QUANTILE
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import gain_unit, number
from canid.values.types import Array, Interval


class FollowedParameter(NamedTuple):
    """One parameter over the drive: windows, and the smoothed level of the local level model."""

    name: str  # "range rate K"
    unit: str
    t: Array  # (n,) s
    level: Array  # (n,)
    low: Array  # (n,) 95 % band
    high: Array  # (n,)
    windows: Array  # (n,) estimates of windows
    half: Array  # (n,) of their 95 % intervals
    window: float  # s of usable data
    p_value: float  # of a constant level
    variation: Interval  # sd of the level over the drive

    @property
    def said(self) -> str:
        """Whether it is constant.

        Example: "range rate K: no change shown (p = 0.412 of a constant one)".
        """
        v, unit = self.variation, " s" if self.unit == "s" else ""
        verdict = (
            f"varies, sd {number(v.value)} [{number(v.low)}, {number(v.high)}]{unit}"
            if self.p_value < MISS
            else "no change shown"
        )
        return f"{self.name}: {verdict} (p = {self.p_value:.3f} of a constant one)"


def followed(result: WholeDrive | None, output: str) -> list[FollowedParameter]:
    """The parameters that have a level; `output`: role of the driver's output, for the unit of K."""
    rows = () if result is None else result.details.get("constancy", ())
    return [
        FollowedParameter(
            name=f"{readable(row['input'])} {SYMBOLS[row['parameter']]}",
            unit=gain_unit(output, row["input"]) if row["parameter"] == "K" else "s",
            t=np.asarray(row["t"], float),
            level=np.asarray(row["level"], float),
            low=np.asarray(row["low"], float),
            high=np.asarray(row["high"], float),
            windows=np.asarray(row["value"], float),
            half=NORMAL_QUANTILE * np.asarray(row["sd"], float),
            window=row["window"],
            p_value=row["p_value"],
            variation=row["variation"],
        )
        for row in rows
    ]


def change_times(result: WholeDrive | None) -> list[float]:
    """Times of the steps of the gains, s."""
    return [] if result is None else [change.t.value for change in result.details.get("changes", ())]
