"""First-order recursion y_k = alpha y_(k-1) + v_k over whole arrays, by parallel prefix sums (Hillis & Steele 1986)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# runs up to which each is summed alone, without the mask that keeps them apart: the same sums in half of the time
MOST_RUNS = 16


def scan(v: Array, alpha: Array, age: npt.NDArray[np.int64] | None = None) -> Array:
    """Solve y_k = alpha y_(k-1) + v_k, y_(-1) = 0, along the last axis: (..., n), alpha (..., 1).

    With age (n,), how many samples before k the recursion goes back to at most, it begins anew wherever that is 0.

    By doubling (Hillis & Steele 1986): after step j each y_k holds 2^j terms of the sum. Ten array operations
    instead of a loop of 600; and numpy alone, because importing scipy.signal costs more than a second.

    >>> scan(np.array([1.0, 0.0, 0.0]), np.array([0.5]))
    array([1.  , 0.5 , 0.25])
    >>> scan(np.array([1.0, 0.0, 1.0]), np.array([0.5]), np.array([0, 1, 0]))
    array([1. , 0.5, 1. ])
    """
    y = v.copy()
    if age is None:
        _double(y, alpha)
        return y
    begins = np.flatnonzero(age == 0)
    if len(begins) > MOST_RUNS or (len(age) and age[0] > 0):
        _double(y, alpha, age)
        return y
    ends = np.flatnonzero((age >= 0) & (np.append(age[1:], 0) <= 0)) + 1
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        _double(y[..., begin:end], alpha)
    return y


def _double(y: Array, alpha: Array, age: npt.NDArray[np.int64] | None = None) -> None:
    """Sum in place, from twice as far back with each step."""
    reach, power, largest = 1, alpha, float(np.abs(alpha).max())
    # below 1e-17 a term no longer changes a float64 sum
    while reach < y.shape[-1] and largest > 1e-17:
        weight = power if age is None else np.where(age[reach:] >= reach, power, 0.0)
        y[..., reach:] += weight * y[..., :-reach]
        reach, power, largest = 2 * reach, power * power, largest * largest
