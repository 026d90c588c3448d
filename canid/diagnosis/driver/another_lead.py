"""What a gain on held-out data of one drive says of another drive of the same driver, behind another lead.

The relative reduction g of the error's variance is the effect's share of the error. Its odds g / (1 − g) are the power of
the effect over that of the driver's noise, and how much of the effect a drive shows depends on its lead: on how often the
relative speed is small, how hard the lead accelerates, how the gap varies. Stretches of one drive differ much less. So the
interval is one of prediction (Higgins, Thompson & Spiegelhalter 2009): the error of the estimate, and the spread of the log
odds between drives, which was measured.
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit, logit

from canid.identification.confidence import SIGMAS
from canid.types import Interval

# of the log odds between drives of one driver behind other leads, standard deviation
# (python -m benchmarks.hidden_effects.another_lead)
SPREAD = 1.3
# a gain nearer to 0 or 1 than this has the odds of this
LEAST = 0.01


def predicted(gain: Interval) -> Interval:
    """Widen the interval of a gain to where the gain on another drive lies, 95 %; never narrow it.

    Args:
        gain: on held-out data of one drive, with the interval of a bootstrap; NaN stays.

    Example:
        >>> of = predicted(Interval(0.5, 0.4, 0.6))
        >>> round(of.low, 2), of.value, round(of.high, 2)
        (0.07, 0.5, 0.93)
    """
    if not np.isfinite(gain).all() or gain.value <= 0.0:
        return gain
    value, low, high = logit(np.clip(gain, LEAST, 1.0 - LEAST))
    sd = float(np.hypot((high - low) / (2 * SIGMAS), SPREAD))
    ends = expit(value - SIGMAS * sd), expit(value + SIGMAS * sd)
    return Interval(gain.value, min(gain.low, float(ends[0])), max(gain.high, float(ends[1])))
