"""Polynomials in the delay operator, 1 + c1 q^-1 + ...: stability, projection, and their inverse filter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.first_order import scan
from canid.values.types import Array


def is_stable(c: Sequence[float], radius: float = 1.0) -> bool:
    """Whether all zeros of z^n + c1 z^(n-1) + ... + cn lie inside |z| < radius.

    Schur-Cohn step-down (Ljung & Söderström 1983, sec. 6.6): plain arithmetic, so that a recursion can
    afford it.

    Args:
        c: coefficients without the leading one.
        radius: of the circle.

    >>> is_stable([-0.9]), is_stable([-1.1]), is_stable([-1.8, 0.81]), is_stable([0.5, 1.2])
    (True, False, True, False)
    """
    a, scale = [], 1.0
    for value in c:
        scale /= radius
        a.append(value * scale)
    while a:
        k = a[-1]
        if not -1.0 < k < 1.0:
            return False
        rest = 1.0 - k * k
        n = len(a) - 1
        a = [(a[i] - k * a[n - 1 - i]) / rest for i in range(n)]
    return True


def project(c: Array, radius: float) -> Array:
    """Pull zeros outside the circle of `radius` back onto it, along their ray; the others stay.

    >>> project(np.array([-2.0]), 0.98)
    array([-0.98])
    """
    if is_stable(c.tolist(), radius):
        return c
    zeros = np.roots(np.concatenate([[1.0], c]))
    size = np.abs(zeros)
    if not (size > radius).any():
        return c
    moved = np.where(size > radius, radius * zeros / np.maximum(size, 1e-300), zeros)
    out = np.zeros(len(c))
    coefficients = np.real(np.poly(moved))[1:]
    out[: len(coefficients)] = coefficients
    return out


@lru_cache(maxsize=8)
def _zeros(c: tuple[float, ...]) -> tuple[complex, ...]:
    """Zeros of 1 + c1 z^-1 + ...; a drive is divided by the same C once per run of samples."""
    return tuple(np.roots(np.concatenate([[1.0], c])))


def divide(x: Array, c: Array, age: npt.NDArray[np.int64] | None = None) -> Array:
    """Solve y_t = x_t - sum c_i y_(t-i), at rest before, along the last axis: x filtered by 1/C.

    One first-order recursion per zero of C (complex where they are), each a scan: no loop over time. With `age` it
    begins anew, see `first_order.scan`.

    >>> divide(np.array([1.0, 0.0, 0.0]), np.array([-0.5]))
    array([1.  , 0.5 , 0.25])
    """
    if len(c) == 0:
        return x
    if len(c) == 1:
        return scan(x, np.array([-c[0]]), age)
    zeros = np.array(_zeros(tuple(c)))
    if not zeros.imag.any():
        for zero in zeros.real:
            x = scan(x, np.array([zero]), age)
        return x
    y: Any = x.astype(np.complex128)  # `scan` is arithmetic alone, and as right for complex numbers
    for zero in zeros:
        y = scan(y, np.array([zero]), age)
    out: Array = np.ascontiguousarray(y.real)
    return out
