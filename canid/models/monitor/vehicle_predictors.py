"""ARX predictor of the vehicle: the acceleration from its own past, the pedal and the drag."""

from __future__ import annotations

from canid.models.monitor import features
from canid.models.monitor.predictor import Misfit, Predictor, scaled_coefficients

# rows; 0.8 s of its own past takes up the road's slope and the sensor's noise
ACCEL_LAGS = range(1, 5)
# rows; an engine responds within 1.2 s
PEDAL_LAGS = range(1, 7)

# of the gain; an engine's acceleration per pedal differs by some 10 % between gears and loads; a trailer takes a third
GAIN_MARGIN = 0.1

_LAGGED = (
    *((features.ACCEL, k) for k in ACCEL_LAGS),
    *((features.PEDAL, k) for k in PEDAL_LAGS),
    (features.SPEED_SQUARED, 1),
)
_PEDAL_PLACES = tuple(i for i, (column, _) in enumerate(_LAGGED) if column == features.PEDAL)

PREDICTOR = Predictor(
    "the acceleration",
    "vehicle",
    "a pedal above 2 % without brake, clutch or cruise control, and a speed",
    features.ACCEL,
    _LAGGED,
    tuple(range(len(_LAGGED) + 1)),
    (
        Misfit(
            "the vehicle responds {more} strongly to the pedal than learnt",
            scaled_coefficients(_PEDAL_PLACES),
            GAIN_MARGIN,
            (_PEDAL_PLACES,),
            centred=False,
        ),
    ),
)
