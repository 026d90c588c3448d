"""Units of speeds on the terminal: m/s as everywhere in canid, or km/h."""

from __future__ import annotations

from enum import Enum


class SpeedUnit(Enum):
    """The unit in which speeds are shown. Parameters stay in SI, as they are quoted."""

    M_S = "m/s"
    KM_H = "km/h"

    @property
    def other(self) -> SpeedUnit:
        """The one that the key `u` changes to."""
        return SpeedUnit.KM_H if self is SpeedUnit.M_S else SpeedUnit.M_S

    @property
    def factor(self) -> float:
        """Of this unit, per m/s."""
        return 3.6 if self is SpeedUnit.KM_H else 1.0
