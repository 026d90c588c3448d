"""What a predictor is: a line of a table. Which column it foretells, from which ones, and which misfits it looks for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.types import Array


class Misfit(NamedTuple):
    """A direction in which a model may fail: its innovations become ρ z, z = columns · along(theta)."""

    says: str  # {more}: more for ρ > 0, less for ρ < 0; no number: where it is told, chance has made it too large
    along: Callable[[Array], Array]  # theta (m,) -> (m,)
    margin: float  # the |ρ| that still fits
    learnt: tuple[
        tuple[int, ...], ...
    ] = ()  # columns whose coefficients' sum is a gain that must be known for this
    centred: bool = True  # z is what the columns do about their mean; else their level speaks as well


class Predictor(NamedTuple):
    """A regression and the ways in which it may cease to hold."""

    name: str  # as a sentence begins: "the pedal"
    block: str  # "driver", "vehicle" or "sensing"
    needs: str  # what must be measured, in words
    outcome: int  # column of the row
    lagged: tuple[tuple[int, int], ...]  # (column, lag in rows); a constant follows
    fitted: tuple[int, ...]  # indices into these; the others only point in a direction
    misfits: tuple[Misfit, ...]
    grows: bool = False  # its noise may grow in proportion to what is foretold


def scaled(which: Sequence[int]) -> Callable[[Array], Array]:
    """Make the direction in which some coefficients grow in proportion.

    Example:
        >>> scaled([1])(np.array([5.0, 2.0, 1.0]))
        array([0., 2., 0.])
    """
    places = list(which)

    def along(theta: Array) -> Array:
        out = np.zeros_like(theta)
        out[places] = theta[places]
        return out

    return along


def whitened(own: Sequence[int], of: Sequence[int]) -> Callable[[Array], Array]:
    """Make the direction of a signal that adds to the outcome: it goes through the outcome's own autoregression.

    Args:
        own: where the outcome's lags 1, 2, ... are.
        of: where the signal's lags 0, 1, 2, ... are.

    Example:
        >>> whitened([0], [1, 2])(np.array([0.8, 0.0, 0.0]))
        array([ 0. ,  1. , -0.8])
    """

    def along(theta: Array) -> Array:
        out = np.zeros_like(theta)
        out[of[0]] = 1.0
        out[of[1:]] = -theta[own]
        return out

    return along
