"""Forward selection: one effect after another, the one whose evidence exceeds its bound by most, until none does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from canid.models.diagnosis.fitting.fitted_model import FittedModel
from canid.models.effects.effect import Effect
from canid.values.types import Interval

# effects named at most: an hour of driving does not distinguish more
MAX_EFFECTS = 4
# 2 Δ log likelihood within which another effect explains the same data as well: a chance of 1 in 20 of e^3
RIVAL = 6.0

F = TypeVar("F")  # what was found of an option
S = TypeVar("S")  # state of the search


class Named(NamedTuple):
    """One effect that was accepted."""

    effect: Effect
    evidence: float
    needed: float
    rivals: tuple[str, ...] = ()
    episodes: tuple[tuple[float, float], ...] = ()  # s
    estimate: Interval | None = (
        None  # of its one parameter, where that is not fitted (a random walk's size, a ceiling)
    )
    level: float = np.nan
    # of the rivals those that were fitted: id -> the model with it in place of this effect
    in_place: Mapping[str, FittedModel[Any]] = {}


class Step(NamedTuple):
    """One candidate at one step."""

    effect: Effect
    step: int
    evidence: float
    needed: float
    accepted: bool = False


class Option(NamedTuple, Generic[F]):
    """One candidate that may be accepted."""

    step: Step
    found: F
    certain: bool = False  # seen in the output itself: accepted before all others

    @property
    def margin(self) -> float:
        """Evidence above what is needed."""
        return np.inf if self.certain else self.step.evidence - self.step.needed


def forward_selection(
    state: S,
    propose: Callable[[S, int], tuple[S, list[Option[F]]]],
    accept: Callable[[S, Option[F]], tuple[S, bool]],
) -> tuple[S, tuple[Step, ...]]:
    """Accept the best option of each step.

    Args:
        state: before the first step.
        propose: state, number of the step -> state, options.
        accept: state, the best option -> state, and whether the search goes on.

    Returns:
        the state in the end, and all candidates of all steps.
    """
    steps: list[Step] = []
    for number in range(1, MAX_EFFECTS + 1):
        state, options = propose(state, number)
        options = sorted(options, key=lambda option: -option.margin)
        won = bool(options) and options[0].margin > 0
        steps += [option.step._replace(accepted=won and k == 0) for k, option in enumerate(options)]
        if not won:
            break
        state, more = accept(state, options[0])
        if not more:
            break
    return state, tuple(steps)
