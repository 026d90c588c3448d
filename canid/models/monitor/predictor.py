"""One-step predictors as table rows: which column is predicted, from which ones, and which misfits are tested."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import Array


class Misfit(NamedTuple):
    """A direction in which a model may fail: its innovations become ρ z, z = columns · direction(theta)."""

    # {more}: "more" for ρ > 0, "less" for ρ < 0; no number: at the time of detection, chance has made it too large
    says: str
    direction: Callable[[Array], Array]  # theta (m,) -> (m,)
    margin: float  # the |ρ| that still fits
    # columns whose coefficients add up to a gain that must be known for this test
    gains: tuple[tuple[int, ...], ...] = ()
    centred: bool = True  # z is the columns' deviation from their mean; else their level counts as well


class Predictor(NamedTuple):
    """A regression and the ways in which it may cease to hold."""

    name: str  # as a sentence begins: "the pedal"
    block: str  # "driver", "vehicle" or "sensing"
    needs: str  # what must be measured, in words
    outcome: int  # column of the row
    lagged: tuple[tuple[int, int], ...]  # (column, lag in rows); a constant follows
    fitted: tuple[int, ...]  # indices into these; the others only define directions
    misfits: tuple[Misfit, ...]
    noise_scales: bool = False  # its noise may grow in proportion to the prediction


def scaled_coefficients(indices: Sequence[int]) -> Callable[[Array], Array]:
    """Make the direction in which some coefficients grow in proportion.

    Example:
        >>> scaled_coefficients([1])(np.array([5.0, 2.0, 1.0]))
        array([0., 2., 0.])
    """
    places = list(indices)

    def direction(theta: Array) -> Array:
        out = np.zeros_like(theta)
        out[places] = theta[places]
        return out

    return direction


def whitened_signal(outcome_lags: Sequence[int], signal: Sequence[int]) -> Callable[[Array], Array]:
    """Make the direction of a signal that adds to the outcome: it passes the outcome's own autoregression.

    Args:
        outcome_lags: places of the outcome's lags 1, 2, ...
        signal: places of the signal's lags 0, 1, 2, ...

    Example:
        >>> whitened_signal([0], [1, 2])(np.array([0.8, 0.0, 0.0]))
        array([ 0. ,  1. , -0.8])
    """

    def direction(theta: Array) -> Array:
        out = np.zeros_like(theta)
        out[signal[0]] = 1.0
        out[signal[1:]] = -theta[outcome_lags]
        return out

    return direction
