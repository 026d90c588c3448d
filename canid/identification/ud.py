"""A covariance as U D U' (Bierman 1977), updated in place of P so that rounding never makes it indefinite.

Forgetting is directional (Kulhavý & Kárný 1984; Bittanti, Bolzern & Campi 1990): old information fades only
in the direction in which new data arrive, so twenty minutes without excitation neither erase what was known
nor let the covariance grow. Plain floats: with ten parameters numpy would cost more than the arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.types import Array


class UD(NamedTuple):
    """P = U diag(d) U', U unit upper triangular."""

    u: tuple[tuple[float, ...], ...]  # column j holds U[0:j, j]
    d: tuple[float, ...]


def factor(P: Array) -> UD:
    """Factor a symmetric positive definite matrix.

    Raises:
        ValueError: P is not positive definite.

    >>> matrix(factor(np.array([[2.0, 0.5], [0.5, 1.0]])))
    array([[2. , 0.5],
           [0.5, 1. ]])
    """
    n = len(P)
    try:
        # the Cholesky factor of the flipped matrix, flipped back, is upper triangular
        R = np.linalg.cholesky(P[::-1, ::-1])[::-1, ::-1]
    except np.linalg.LinAlgError:
        raise ValueError("P is not positive definite: add a little to its diagonal") from None
    s = np.diag(R)
    U = R / s
    return UD(tuple(tuple(map(float, U[:j, j])) for j in range(n)), tuple(map(float, s * s)))


def matrix(ud: UD) -> Array:
    """Return P.

    >>> matrix(UD(((), (0.5,)), (1.0, 1.0)))
    array([[1.25, 0.5 ],
           [0.5 , 1.  ]])
    """
    n = len(ud.d)
    U = np.eye(n)
    for j, column in enumerate(ud.u):
        U[:j, j] = column
    P: Array = (U * np.asarray(ud.d)) @ U.T
    return P


def update(ud: UD, psi: Sequence[float], forgetting: float, most: float = np.inf) -> tuple[UD, list[float]]:
    """Take in one sample with regressor `psi`, noise variance one.

    With r = psi' P psi, P loses information in the direction P psi alone:
        P+ = P - P psi psi' P / (R + r),   1/R = forgetting - (1 - forgetting) / r.
    The information that psi brings comes in and a share 1 - forgetting of what was known along it goes, so
    psi' P+ psi = r / (forgetting (1 + r)) as in exponential forgetting. For r below 1/forgetting - 1 more
    goes than comes, R is negative, and P grows along P psi. Bierman's recursion holds for either sign of R.

    Args:
        ud: factors.
        psi: (n,) regressor, in units of the noise's standard deviation.
        forgetting: in (0, 1]; 1 forgets nothing.
        most: largest d: where it is passed, nothing is forgotten in this step.

    Returns:
        New factors, and the gain (n,) P psi / (1 + r) of the parameter step.

    >>> state, gain = update(UD(((), (0.0,)), (1.0, 1.0)), [1.0, 0.0], 1.0)
    >>> gain, state.d
    ([0.5, 0.0], (0.5, 1.0))
    """
    columns, d = ud
    f = []
    for column, last in zip(columns, psi, strict=True):
        for x, p in zip(column, psi, strict=False):
            last += x * p
        f.append(last)
    g = [x * y for x, y in zip(d, f, strict=True)]
    r = 0.0
    for x, y in zip(f, g, strict=True):
        r += x * y
    # below 1e-12 there is no direction in which to learn or forget
    weight = forgetting - (1.0 - forgetting) / r if r > 1e-12 else 0.0
    # at the balance R is infinite: comes as much as goes
    still = -1e-12 < weight < 1e-12 or (weight < 0.0 and max(d) > most)
    alpha = 1.0 if still else 1.0 / weight
    new_u, new_d = [], []
    k: list[float] = []  # grows into P psi
    for column, dj, fj, gj in zip(columns, d, f, g, strict=True):
        beta = alpha
        alpha += fj * gj
        new_d.append(dj * beta / alpha)
        mu = -fj / beta
        new_u.append(tuple([x + mu * y for x, y in zip(column, k)]))  # noqa: B905  (the hot loop)
        k = [y + gj * x for x, y in zip(column, k)]  # noqa: B905
        k.append(gj)
    gain = [x / (1.0 + r) for x in k]
    return (ud if still else UD(tuple(new_u), tuple(new_d))), gain
