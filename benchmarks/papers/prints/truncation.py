"""Balanced truncation with its error bound (Moore 1981; Glover 1984), by two Lyapunov equations of scipy.

python-control needs slycot for it (`canid_study.systems.control_systems.balanced_truncation`); this route does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_continuous_lyapunov, svd
from scipy.signal import ss2tf, tf2ss

from canid.values.types import Array
from canid_study.printed_numbers import TransferFunction


class Truncation(NamedTuple):
    """A balanced model of first order, K / (1 + tau s) with a direct term."""

    hankel: Array  # (n,) Hankel singular values of the whole, falling
    K: float  # DC gain of the truncated model
    tau: float  # s
    direct: float  # gain at high frequency
    error_bound: float  # max |G - G_1| is at most this: 2 sum of the values left out


def first_order(printed: TransferFunction) -> Truncation:
    """Balanced truncation of a stable transfer function to one state.

    Args:
        printed: stable.

    Example: nothing is left out of a system of first order.
        >>> t = first_order(TransferFunction("", (3.0,), (0.5, 1.0), 0.0))
        >>> round(t.K, 6), round(t.tau, 6), t.error_bound
        (3.0, 0.5, 0.0)
    """
    A, B, C, D = tf2ss(printed.num, printed.den)
    controllability = cholesky(solve_continuous_lyapunov(A, -B @ B.T), lower=True)
    observability = cholesky(solve_continuous_lyapunov(A.T, -C.T @ C), lower=True)
    # square-root method (Laub, Heath, Paige & Ward 1987)
    U, hankel, Vt = svd(observability.T @ controllability)
    left = observability @ U[:, :1] / np.sqrt(hankel[0])
    right = controllability @ Vt[:1].T / np.sqrt(hankel[0])
    num, den = ss2tf(left.T @ A @ right, left.T @ B, C @ right, D)
    pole, direct = float(-den[1]), float(num[0][0])
    return Truncation(
        np.asarray(hankel), float(num[0][1] / den[1]), -1.0 / pole, direct, float(2.0 * hankel[1:].sum())
    )
