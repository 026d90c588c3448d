"""The list of estimators. A new one is a file that defines an `Estimator` (estimator.py), and a line here."""

from canid.mathematics.estimators.armax import ARMAX
from canid.mathematics.estimators.estimator import AnyEstimator
from canid.mathematics.estimators.fopdt import FOPDT

ESTIMATORS: tuple[AnyEstimator, ...] = (
    ARMAX,
    FOPDT,
)
