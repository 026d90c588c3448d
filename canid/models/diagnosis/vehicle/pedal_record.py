"""Whether a pedal's upper limit is one of its record: the car accelerates on while the pedal is said to stand there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Detector
from canid.values.types import Array

# a rival that acts on nothing: the sensor's range, or the logger's
END_OF_RECORD = "end_of_record"
CEILINGS = frozenset(effect.id for effect in CATALOGUE if Detector.PEDAL_CEILING in effect.detectors)

# s; during a shorter standstill the engine's lag leaves nothing to be seen
MIN_STAND_S = 1.0
# standstills that a slope must rest on: its standard error is that between them
MIN_STANDS = 5
# standard errors. Of 30 limiters that hold the pedal itself, none had a slope above 0.008 m/s² per s; of 12 records that
# end, 10 had one of 0.014 to 0.066
MIN_ERRORS = 3.0
# m/s² per s of distance from the nearer end of a standstill: 0.2 %/s of pedal in a usual car
MIN_SLOPE = 0.01


def ends(t: Array, left: Array, standstills: Sequence[tuple[float, float]]) -> bool | None:
    """Say whether the acceleration rises and falls again within the standstills, by what no pedal explains (t-test).

    A demand beyond the record's end grows with the distance from both ends of a standstill. A slope over time of any other
    reason (drag, a grade) cancels, and so does a level (a bent pedal map).

    Args:
        t: (n,) s.
        left: (n,) m/s², measured acceleration less that of the fitted car; NaN: not known.
        standstills: s, from and until when the pedal stood at its highest level.

    Returns:
        True: the record ends; False: the pedal itself stops; None: the drive does not show which.

    Example:
        >>> t = np.arange(600) / 10.0
        >>> spans = [(10.0 * k, 10.0 * k + 4.0) for k in range(6)]
        >>> beyond = np.maximum(2.0 - np.abs(t % 10.0 - 2.0), 0.0)
        >>> noise = 0.05 * np.random.default_rng(1).standard_normal(600)
        >>> ends(t, 0.1 * beyond + noise, spans), ends(t, noise, spans), ends(t, 9.0 * noise, spans)
        (True, False, None)
    """
    products = [_products(t[here], left[here]) for here in (_rows(t, *span) for span in standstills)]
    known = np.array([pair for pair in products if pair is not None])
    if len(known) < MIN_STANDS:
        return None
    (xy, xx), n = known.T, len(known)
    slope = float(xy.sum() / xx.sum())
    errors = xy - slope * xx
    wide = MIN_ERRORS * float(np.sqrt(errors @ errors * n / (n - 1)) / xx.sum())
    if slope > max(MIN_SLOPE, wide):
        return True
    return False if slope + wide < MIN_SLOPE else None


def _rows(t: Array, start: float, stop: float) -> slice:
    return slice(*np.searchsorted(t, (start, stop)).tolist())


def _products(t: Array, left: Array) -> tuple[float, float] | None:
    """Of distance from the nearer end with the residual and with itself, both less their means; None: too short."""
    if not t.size or t[-1] - t[0] < MIN_STAND_S or not np.isfinite(left).all():
        return None
    distance = np.minimum(t - t[0], t[-1] - t)
    distance = distance - distance.mean()
    return float(distance @ left), float(distance @ distance)
