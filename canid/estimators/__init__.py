"""The list of estimators. A new one is a file that defines an `Estimator` (estimator.py), and a line here."""

from canid.estimators.armax import ARMAX
from canid.estimators.estimator import AnyEstimator
from canid.estimators.fopdt import FOPDT

ESTIMATORS: tuple[AnyEstimator, ...] = (
    ARMAX,
    FOPDT,
)
