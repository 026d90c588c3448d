"""Answers that come and go: in some windows the output follows an input more than its gain says, in others less.

Who looks away, who lets go now and then, who is roused by something unseen answers by another gain for some seconds.
Summed over the drive nothing is left of that; window by window the residual follows the answer. How much it does so by
chance, in noise of any colour and size, is told by the same windows against each other's residuals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from canid.findings import Flags
from canid.types import Array

# s; as long as people look away or are distracted, up to a manoeuvre
WINDOWS = (2.0, 4.0, 10.0)
# fewer windows tell no spread
FEWEST = 40
# pairings of windows with residuals that are not their own
PAIRINGS = 50


class Unsteady(NamedTuple):
    """How unsteadily an answer is followed."""

    p: float  # chance of more, all answers and windows counted
    score: float  # standard deviations above chance, of the most significant
    gain: float  # of it: twice the log likelihood that gains of their own would win
    answer: str  # which


def look(answers: dict[str, Array], e: Array, rows: Flags, dt: float) -> Unsteady:
    """Look through windows of every length.

    Args:
        answers: name -> (n,) whitened.
        e: (n,) whitened residuals.
        rows: (n,) samples that count.
        dt: s.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> x, e = rng.normal(size=(2, 6000))
        >>> rows = np.ones(6000, dtype=bool)
        >>> told = look({"x": x}, e, rows, 0.1)
        >>> away = np.arange(6000) % 300 < 40
        >>> told.p > 0.01, look({"x": x}, e - x * away, rows, 0.1).p < 1e-4
        (True, True)
    """
    best, tests = Unsteady(1.0, 0.0, 0.0, ""), 0
    for name, x in answers.items():
        for length in WINDOWS:
            k = round(length / dt)
            whole = _cut(rows, k).all(axis=1)
            if k < 2 or np.count_nonzero(whole) < FEWEST:
                continue
            tests += 1
            found = _follows(_cut(x, k)[whole], _cut(e, k)[whole])
            if found.p < best.p:
                best = found._replace(answer=f"{name}, {length:g} s")
    return best._replace(p=min(1.0, best.p * max(tests, 1)))


def _cut(x: Array | Flags, k: int) -> Array:
    """Windows of k samples, (m, k)."""
    whole = x.size // k
    out: Array = np.asarray(x[: whole * k].reshape(whole, k), dtype=np.float64)
    return out


def _follows(x: Array, e: Array) -> Unsteady:
    """How much windows (m, k) follow an answer, each by a gain of its own.

    By its own products, not by its mean: a noise that grows with the answer is not one that follows it. Where the answer
    is small nothing is learnt of its gain.
    """
    size = np.sum(x * x, axis=1)
    weight = size / (size + np.median(size) + 1e-300)

    def along(shift: int) -> float:
        product = x * np.roll(e, shift, axis=0)
        square = np.sum(product, axis=1) ** 2 / np.maximum(np.sum(product**2, axis=1), 1e-300)
        return float(weight @ square / weight.sum())

    shifts = np.unique(np.linspace(2, len(x) - 2, PAIRINGS).astype(int))
    # a mean of chi-squared is nearly normal as its cube root (Wilson & Hilferty 1931)
    chance = np.cbrt([along(int(shift)) for shift in shifts])
    now = along(0)
    score = float((np.cbrt(now) - chance.mean()) / max(float(chance.std(ddof=1)), 1e-9))
    gain = (now - float(np.mean(chance**3))) * float(weight.sum())
    return Unsteady(float(student.sf(score, chance.size - 1)), score, gain, "")
