"""What one predictor is: a line of a table. Which column it foretells, from which ones, and which misfits it looks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from canid.types import Array


class Misfit(NamedTuple):
    """A direction in which a model may fail: e = ρ z, z = (columns) · along(theta)."""

    says: str  # {share} is what is left of what was learnt, 1 + ρ; {rho} is ρ
    along: Callable[[Array], Array]  # theta (m,) -> (m,)
    margin: float  # |ρ| that is no misfit


class Predictor(NamedTuple):
    """A regression and the ways in which it may cease to hold."""

    name: str
    block: str  # "driver", "vehicle" or "sensing"
    outcome: int  # column of the row
    lagged: tuple[tuple[int, int], ...]  # (column, lag in rows); after these the constant
    fitted: tuple[int, ...]  # indices into these; the others only point in a direction
    misfits: tuple[Misfit, ...]
