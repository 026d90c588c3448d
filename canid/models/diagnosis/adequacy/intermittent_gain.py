"""Answers that come and go: in some windows the output follows an input more than its gain says, in others less.

A driver who is distracted, lets go now and then, or reacts to something unmeasured answers by another gain for some
seconds. Over the whole drive that averages out; window by window the residual follows the answer. How much it does so
by chance, whatever the noise model, is estimated from windows paired with the residuals of other windows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from canid.values.findings import Flags
from canid.values.types import Array

# s; from a distraction up to a manoeuvre
GAIN_WINDOWS_S = (2.0, 4.0, 10.0)
# windows; with fewer their standard deviation is not known
MIN_WINDOWS = 40
# pairings of windows with residuals that are not their own
PAIRINGS = 50


class IntermittentGain(NamedTuple):
    """Test of a gain that changes from window to window."""

    p: float  # chance of more, all answers and windows counted
    score: float  # standard deviations above chance, of the most significant
    gain: float  # of it: twice the log likelihood that gains of their own would win
    answer: str  # which


def detect(answers: dict[str, Array], e: Array, rows: Flags, dt: float) -> IntermittentGain:
    """Test windows of every length.

    Args:
        answers: name -> (n,) whitened.
        e: (n,) whitened residuals.
        rows: (n,) samples that count.
        dt: s.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> x, e = rng.normal(size=(2, 6000))
        >>> rows = np.ones(6000, dtype=bool)
        >>> found = detect({"x": x}, e, rows, 0.1)
        >>> away = np.arange(6000) % 300 < 40
        >>> found.p > 0.01, detect({"x": x}, e - x * away, rows, 0.1).p < 1e-4
        (True, True)
    """
    best, tests = IntermittentGain(1.0, 0.0, 0.0, ""), 0
    for name, x in answers.items():
        for length in GAIN_WINDOWS_S:
            k = round(length / dt)
            whole = _cut(rows, k).all(axis=1)
            if k < 2 or np.count_nonzero(whole) < MIN_WINDOWS:
                continue
            tests += 1
            tested = _follows(_cut(x, k)[whole], _cut(e, k)[whole])
            if tested.p < best.p:
                best = tested._replace(answer=f"{name}, {length:g} s")
    return best._replace(p=min(1.0, best.p * max(tests, 1)))


def _cut(x: Array | Flags, k: int) -> Array:
    """Windows of k samples, (m, k)."""
    whole = x.size // k
    out: Array = np.asarray(x[: whole * k].reshape(whole, k), dtype=np.float64)
    return out


def _follows(x: Array, e: Array) -> IntermittentGain:
    """How much windows (m, k) follow an answer, each by a gain of its own.

    Scaled by the products of each window, so that noise that grows with the answer does not count. Windows with a
    small answer say little about its gain and weigh less.
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
    return IntermittentGain(float(student.sf(score, chance.size - 1)), score, gain, "")
