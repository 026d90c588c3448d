"""ARX predictors of the sensors: signals that must agree with each other, whoever drives.

That the gap grows with the range rate needs no learning: the true coefficients are known here, and a contradiction
that was present from the start is found as well.
"""

from __future__ import annotations

from canid.models.monitor import features
from canid.models.monitor.predictor import Misfit, Predictor, whitened_signal

# rows (0.6 s) of its own past for a radar's error, which is as autocorrelated as its filter makes it
GAP_LAGS = 3
# of the range rate; a radar's holds 1 %, a wrong unit or sign is off by far more
RANGE_RATE_MARGIN = 0.1
# of the speed; tyres wear and grow by 1 to 2 %
SPEED_MARGIN = 0.03

GAP = Predictor(
    "the gap",
    "sensing",
    "gap and range rate",
    features.GAP_RESIDUAL,
    (
        *((features.GAP_RESIDUAL, k) for k in range(1, GAP_LAGS + 1)),
        *((features.RANGE_RATE_SUM, k) for k in range(GAP_LAGS + 1)),
    ),
    (*range(GAP_LAGS), 2 * GAP_LAGS + 1),
    (
        Misfit(
            "the gap does not change as the range rate says",
            whitened_signal(range(GAP_LAGS), range(GAP_LAGS, 2 * GAP_LAGS + 1)),
            RANGE_RATE_MARGIN,
        ),
    ),
)

SPEED = Predictor(
    "the speed over ground",
    "sensing",
    "gnss_speed and speed",
    features.SPEED_DIFFERENCE,
    (
        (features.SPEED_DIFFERENCE, 1),
        (features.SPEED_DIFFERENCE, 2),
        (features.SPEED, 0),
        (features.SPEED, 1),
        (features.SPEED, 2),
    ),
    (0, 1, 2, 5),  # the ratio of the two speeds is learnt: tyres differ
    (
        Misfit(
            "the speed no longer agrees with the speed over ground as learnt",
            whitened_signal(range(2), range(2, 5)),
            SPEED_MARGIN,
        ),
    ),
)

PREDICTORS = (GAP, SPEED)
