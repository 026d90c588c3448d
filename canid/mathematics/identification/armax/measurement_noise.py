"""Bias of an ARMAX fit by white measurement noise of known variance, and the fit without it.

Bias compensation (Söderström 2018, Errors-in-Variables Methods in System Identification, ch. 5), for prediction errors:
noise v on the output adds A/C v to the innovations and -1/C v to their gradient by a, so that the expected gradient at
the truth is not zero; a Gauss-Newton step takes the fit back. A wheel angle in steps of 0.1° moves a1 of Chen & Ulsoy's
driver by a standard error of an hour, which more data do not mend.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.values.types import Array

# samples of impulse responses; those of 1/C with a zero at 0.99 have fallen below a hundredth
LENGTH = 512


def without_bias(fit: ArmaxFit, output_variance: float, input_variances: Sequence[float]) -> ArmaxFit:
    """Return the fit with the bias by measurement noise taken off its parameters.

    Args:
        fit: from `fit_armax`.
        output_variance: of the noise of each sample of the output, in its unit squared.
        input_variances: (m,) of each input.

    >>> from canid.mathematics.identification.armax.armax_batch import Orders, fit_armax
    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=20000), 0.1 * rng.normal(size=20000), np.zeros(20000)
    >>> for t in range(1, 20000): y[t] = 0.8 * y[t-1] + 0.5 * u[t-1] + e[t]
    >>> seen = u + 0.2 * rng.normal(size=20000)
    >>> fit = fit_armax(y, seen[:, None], np.full(20000, True), Orders(1, 1, 1, 1))
    >>> fit.B.round(2), without_bias(fit, 0.0, [0.04]).B.round(2)
    (array([[0.48]]), array([[0.5]]))
    """
    o, c = fit.orders, fit.C[1:]
    impulse = np.zeros(LENGTH)
    impulse[0] = 1.0
    inverse = polynomial.divide(impulse, c)

    def filtered(b: Array) -> Array:
        return np.convolve(inverse, b)[:LENGTH]

    def along(ahead: int, first: Array, second: Array) -> float:
        return float(first[: LENGTH - ahead] @ second[ahead:])

    in_error = filtered(fit.A)
    gradient = [-output_variance * along(i, inverse, in_error) for i in range(1, o.na + 1)]
    by_c = [output_variance * along(i, polynomial.divide(in_error, c), in_error) for i in range(1, o.nc + 1)]
    for b, variance in zip(fit.B, input_variances, strict=True):
        in_error = filtered(np.concatenate([np.zeros(o.nk), b]))
        gradient += [-variance * along(o.nk + j, inverse, in_error) for j in range(o.nb)]
        more = [variance * along(i, polynomial.divide(in_error, c), in_error) for i in range(1, o.nc + 1)]
        by_c = [x + y for x, y in zip(by_c, more, strict=True)]
    bias = fit.inverse_information @ np.array([*gradient, 0.0, *by_c]) * fit.used
    theta = fit.theta - bias
    if not (np.isfinite(theta).all() and polynomial.is_stable(theta[len(theta) - o.nc :].tolist())):
        return fit
    return fit._replace(theta=theta)
