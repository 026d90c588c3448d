"""Prediction errors of a Box-Jenkins model at one point, and their gradient."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax import polynomial
from canid.values.types import Array


class BoxJenkinsOrders(NamedTuple):
    """Orders of the polynomials."""

    nb: int = 2
    nf: int = 1
    nc: int = 0
    nd: int = 4
    nk: int = 2  # dead time in samples with which the search begins


class Rows(NamedTuple):
    """Data made ready."""

    y: Array  # (N,) by phase, zero where not used
    u: Array  # (m, N) zero where not known
    driven: npt.NDArray[np.int64]  # (N,) samples since the inputs' history began; -1: not known
    age: npt.NDArray[np.int64]  # (N,) by phase: steps since the first of its run that is used; -1: not used
    orders: BoxJenkinsOrders
    delays: tuple[int, ...]
    stride: int  # samples per step of the noise model
    phased: npt.NDArray[np.int64]  # (N,) samples in the order of the phases of the stride
    root: Array | None = None  # (N,) of the weight of each squared innovation, by phase; None: one


class Point(NamedTuple):
    """Parameters, and what they predict."""

    theta: Array
    e: Array  # (N,) innovations, by phase
    begun: Array  # (N,) with those at the start of a run, which lack what was before
    filtered: Array  # (m, N) inputs behind 1 / F
    answers: Array  # (m, N)
    v: Array  # (N,) the output without the answers, by phase
    cost: float


def split(theta: Array, o: BoxJenkinsOrders, m: int) -> tuple[Array, Array, float, Array, Array]:
    """B (m, nb), F (m, nf), offset, C, D; without leading ones."""
    of_inputs = theta[: m * (o.nb + o.nf)].reshape(m, -1)
    rest = theta[m * (o.nb + o.nf) :]
    return of_inputs[:, : o.nb], of_inputs[:, o.nb :], float(rest[0]), rest[1 : 1 + o.nc], rest[1 + o.nc :]


def shifted(x: Array, lag: int, driven: npt.NDArray[np.int64]) -> Array:
    """Return (N,) values `lag` samples ago; zero where fewer than that are `driven` (N,)."""
    out = np.zeros_like(x)
    out[lag:] = x[: len(x) - lag] if lag else x
    return np.where(driven >= lag, out, 0.0)


def whitened(x: Array, c: Array, d: Array, age: npt.NDArray[np.int64]) -> Array:
    """D / C x along the last axis, from rest at the start of each run; age (N,) as x.

    The first values of a run, as many as D has coefficients, lack what was before: nobody reads them. Without C they are
    not kept from what stands before them.
    """
    if not len(c):
        taps = np.concatenate([[1.0], d])
        rows = [np.convolve(row, taps)[: len(age)] for row in x.reshape(-1, len(age))]
        return np.array(rows).reshape(x.shape)
    x = np.where(age >= 0, x, 0.0)
    out = x.copy()
    for i, value in enumerate(d, 1):
        late = np.zeros_like(x)
        late[..., i:] = x[..., :-i]
        out += value * np.where(age >= i, late, 0.0)
    return polynomial.divide(out, c, age)


def at_point(theta: Array, data: Rows) -> Point:
    """Predict with parameters (n,)."""
    o, m = data.orders, len(data.u)
    B, F, offset, c, d = split(theta, o, m)
    filtered = np.array([polynomial.divide(u, f, data.driven) for u, f in zip(data.u, F, strict=True)])
    answers = np.array(
        [
            sum(b[j] * shifted(x, late + j, data.driven) for j in range(o.nb))
            for b, x, late in zip(B, filtered, data.delays, strict=True)
        ]
    )
    v = np.where(data.age >= 0, data.y - offset - answers.sum(axis=0)[data.phased], 0.0)
    begun = whitened(v, c, d, data.age)
    # the first innovations of a run lack what was before
    e = np.where(data.age < o.nd, 0.0, begun)
    weighted = e if data.root is None else data.root * e
    return Point(theta, e, begun, filtered, answers, v, float(weighted @ weighted))


def gradient(at: Point, data: Rows) -> Array:
    """Negative gradient (n, N) of the innovations."""
    o, m = data.orders, len(data.u)
    _, F, _, c, d = split(at.theta, o, m)
    rows = []
    for x, w, f, late in zip(at.filtered, at.answers, F, data.delays, strict=True):
        rows += [shifted(x, late + j, data.driven) for j in range(o.nb)]
        again = polynomial.divide(w, f, data.driven)
        rows += [-shifted(again, j, data.driven) for j in range(1, o.nf + 1)]
    rows.append(np.ones(len(at.e)))
    psi = np.empty((len(at.theta), len(at.e)))
    psi[: len(rows)] = whitened(np.array(rows)[:, data.phased], c, d, data.age)
    k = len(rows)
    if o.nc:
        by_e = polynomial.divide(at.begun, c, data.age)
        psi[k : k + o.nc] = [shifted(by_e, i, np.maximum(data.age, 0)) for i in range(1, o.nc + 1)]
        k += o.nc
    by_v = polynomial.divide(at.v, c, data.age)
    psi[k:] = np.array([-shifted(by_v, i, np.maximum(data.age, 0)) for i in range(1, o.nd + 1)]).reshape(
        o.nd, -1
    )
    psi[:, data.age < o.nd] = 0.0
    return psi
