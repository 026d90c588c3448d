"""The sensors' predictors: signals that must agree with each other, whoever drives.

That the gap grows with the range rate needs no learning: here the truth is known, and a contradiction that was there
from the start is found as well.
"""

from __future__ import annotations

from canid.screening import rows
from canid.screening.predictor import Misfit, Predictor, whitened

# rows of its own past for a radar's error, whose colour is that of its filter; 0.6 s
_OWN = 3
# A radar's range rate holds 1 %; a wrong unit or sign is off by far more than this
RATE_MARGIN = 0.1
# Tyres wear and grow by 1 to 2 %
SPEED_MARGIN = 0.03

GAP = Predictor(
    "the gap",
    "sensing",
    "gap and range rate",
    rows.CREPT,
    (
        *((rows.CREPT, k) for k in range(1, _OWN + 1)),
        *((rows.RAN, k) for k in range(_OWN + 1)),
    ),
    (*range(_OWN), 2 * _OWN + 1),
    (
        Misfit(
            "the gap does not change as the range rate says",
            whitened(range(_OWN), range(_OWN, 2 * _OWN + 1)),
            RATE_MARGIN,
        ),
    ),
)

SPEED = Predictor(
    "the speed over ground",
    "sensing",
    "gnss_speed and speed",
    rows.BESIDE,
    ((rows.BESIDE, 1), (rows.BESIDE, 2), (rows.SPEED, 0), (rows.SPEED, 1), (rows.SPEED, 2)),
    (0, 1, 2, 5),  # how far apart the two speeds are in proportion is learnt: tyres differ
    (
        Misfit(
            "the speed no longer agrees with the speed over ground as learnt",
            whitened(range(2), range(2, 5)),
            SPEED_MARGIN,
        ),
    ),
)

PREDICTORS = (GAP, SPEED)
