"""Scan for misprinted exponents: which powers of ten, multiplied to coefficients of eq. 2.5, would make it stable."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from benchmarks.papers.prints.transfer_functions import unstable_poles
from canid_study.printed_numbers import TransferFunction

# a misprint of an exponent is one digit, seldom more
SINGLE_DECADES, PAIR_DECADES, TRIPLE_DECADES, FOUR_DECADES = 3, 2, 2, 1


class Repair(NamedTuple):
    """Misprints that would explain an unstable denominator."""

    powers: tuple[int, ...]  # of s, whose coefficients are multiplied
    decades: tuple[int, ...]  # by 10 to this


class Scan(NamedTuple):
    """What a scan tried, and what is stable."""

    coefficients: int  # misprinted at a time
    tried: int
    repairs: tuple[Repair, ...]


def scan(printed: TransferFunction, coefficients: int, decades: int) -> Scan:
    """Multiply every choice of coefficients by powers of ten and keep the stable results.

    Args:
        printed: its leading coefficient is taken as right.
        coefficients: how many are misprinted at a time.
        decades: the largest error of an exponent.

    Example:
        >>> wrong = TransferFunction("", (1.0,), (1.0, 0.2, 2.0, 1.0), 0.0)  # 2.0 for 20 or 0.2 for 2 repairs it
        >>> [r.powers for r in scan(wrong, 1, 1).repairs]
        [(2,), (1,), (0,)]
    """
    den = np.array(printed.den)
    n = len(den) - 1
    shifts = [d for d in range(-decades, decades + 1) if d]
    tried, repairs = 0, []
    for where in itertools.combinations(range(1, n + 1), coefficients):
        choices = np.array(list(itertools.product(shifts, repeat=coefficients)))
        many = np.tile(den, (len(choices), 1))
        many[:, where] *= 10.0**choices
        stable = unstable_poles(many) == 0
        tried += len(choices)
        repairs += [
            Repair(tuple(n - i for i in where), tuple(int(d) for d in choices[j]))
            for j in np.flatnonzero(stable)
        ]
    return Scan(coefficients, tried, tuple(repairs))


def scans(printed: TransferFunction, deep: bool) -> tuple[Scan, ...]:
    """Single coefficients and pairs; deep: also three and four at a time.

    Args:
        printed: an unstable transfer function.
        deep: also three and four at a time.
    """
    out = (scan(printed, 1, SINGLE_DECADES), scan(printed, 2, PAIR_DECADES))
    return (*out, scan(printed, 3, TRIPLE_DECADES), scan(printed, 4, FOUR_DECADES)) if deep else out
