"""Is a drive long enough: what each verb needs, next to what the drive holds."""

from __future__ import annotations

from typing import NamedTuple

from canid.estimators.status import MIN_DATA_S
from canid.systems.car_response import MIN_USABLE_S
from canid.types import DriveTime


class Need(NamedTuple):
    """What an answer needs at least."""

    answer: str
    verb: str
    needed: float  # s
    there: float  # s

    @property
    def is_enough(self) -> bool:
        """Whether the drive has it."""
        return self.there >= self.needed


def needs(time: DriveTime, output: str) -> list[Need]:
    """What the drive can be used for. The least that is needed: intervals say how far it goes.

    Args:
        time: of the drive.
        output: role that the driver acts by.

    Example:
        >>> [(one.verb, one.is_enough) for one in needs(DriveTime(80.0, 70.0, 65.0, 62.0), "pedal")]
        [('live, identify', True), ('identify', True), ('diagnose', False)]
    """
    from canid.diagnosis.diagnose import MIN_DRIVING_S

    out = [Need("K, τ and θ of the driver", "live, identify", MIN_DATA_S, time.usable)]
    if output == "pedal":
        out.append(Need("margins of driver and car", "identify", MIN_USABLE_S, time.usable))
    return [*out, Need("causes, and a better model", "diagnose", MIN_DRIVING_S, time.usable)]
