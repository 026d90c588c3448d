"""Normal-mixture confidence sequence: intervals that hold at all times simultaneously.

Robbins 1970, "Statistical methods related to the law of the iterated logarithm"; Howard, Ramdas, McAuliffe &
Sekhon 2021, "Time-uniform, nonparametric, nonasymptotic confidence sequences", sec. 3.2.

A 95 % interval evaluated every second for ten minutes misses the truth at least once in a quarter of the
drives and more. This one misses it once or more in 5 % of them, at whatever time one stops. That holds
while the driver does not change, and for a model that can describe the driver.
"""

from __future__ import annotations

import math

from canid.mathematics.identification.confidence import MISS

# The interval is narrowest, against the plain one, at this many times the reference information. The
# boundary is lowest where the information is -W(-MISS^2 / e) - 1 = 8.2 times that of the mixture's prior, W the
# lower branch of Lambert's function (Howard et al. 2021, sec. 3.5).
NARROWEST = 8.2


def widening(information: float) -> float:
    """How many standard deviations the interval is wide to each side.

    Args:
        information: known now, as a multiple of what is known where the interval is to be narrowest.

    Returns:
        Multiplies the standard deviation; infinite where nothing is known.

    >>> round(widening(1.0), 2), round(widening(5.0), 2)
    (3.04, 3.16)
    """
    if not information > 0.0:
        return math.inf
    v = NARROWEST * information
    return math.sqrt((1.0 + 1.0 / v) * math.log((1.0 + v) / MISS**2))
