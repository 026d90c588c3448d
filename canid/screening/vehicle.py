"""The vehicle's predictor: its acceleration from its own past, the pedal and the drag."""

from __future__ import annotations

from canid.screening import rows
from canid.screening.predictor import Misfit, Predictor, scaled

# rows; 0.8 s of its own past takes up the road's slope and the sensor's noise
_OWN = range(1, 5)
# rows; an engine answers within 1.2 s
_PEDAL = range(1, 7)

# An engine's pull per pedal differs by some 10 % between gears and loads; a trailer takes a third of it
MARGIN = 0.1

_LAGGED = (
    *((rows.ACCEL, k) for k in _OWN),
    *((rows.PULL, k) for k in _PEDAL),
    (rows.DRAG, 1),
)
_PULLED = tuple(i for i, (column, _) in enumerate(_LAGGED) if column == rows.PULL)

PREDICTOR = Predictor(
    "the acceleration",
    "vehicle",
    "a pedal above 2 % without brake, clutch or cruise control, and a speed",
    rows.ACCEL,
    _LAGGED,
    tuple(range(len(_LAGGED) + 1)),
    (
        Misfit(
            "it answers the pedal {more} strongly than learnt",
            scaled(_PULLED),
            MARGIN,
            (_PULLED,),
            centred=False,
        ),
    ),
)
