"""What the fit-and-search engine asks of a block of the loop: its data, and its model as a function of parameters.

Two blocks answer: `DriverModel` and `VehicleModel`. Where they differ on purpose, a member of `Model` says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, Self, TypeVar

import numpy as np

from canid.models.diagnosis.fitting.likelihood import Noise, Output
from canid.models.effects.effect import Effect
from canid.values.types import Array


class Columns(Protocol):
    """The data of a block along a drive."""

    @property
    def output(self) -> Output:
        """What is explained."""
        ...


class Along(Columns, Protocol):
    """The data of a driver's block: what is explained, over time."""

    @property
    def t(self) -> Array:
        """(n,) s since the first sample."""
        ...

    def with_output(self, output: Output) -> Self:
        """Return the same drive with another output, or with other samples usable."""
        ...


class Model(Protocol):
    """A baseline and some effects, as a function of their parameters q (k,)."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """In the order in which they were added."""
        ...

    @property
    def low(self) -> Array:
        """Bounds (k,)."""
        ...

    @property
    def high(self) -> Array:
        """Bounds (k,)."""
        ...

    @property
    def scale(self) -> Array:
        """Typical size of each parameter (k,)."""
        ...

    @property
    def where(self) -> tuple[slice, ...]:
        """Each effect's parameters in q."""
        ...

    @property
    def delays(self) -> tuple[tuple[int, int], ...]:
        """Pairs of lag and dead time in q whose split has several local minima; (): no parameter is refitted for it."""
        ...

    @property
    def one_signed(self) -> bool:
        """Does a direction that the residual contradicts speak against an effect? False where strengths have any sign."""
        ...

    def with_effects(self, effects: Sequence[Effect]) -> Self:
        """Return the same baseline with these effects."""
        ...

    def free(self) -> tuple[int, ...]:
        """Parameters that a fit may move."""
        ...

    def bind(self, data: Any, noise: Noise | None = None) -> Callable[[Array], Array]:
        """Return the simulated output (n,) as a function of q alone; `noise`: that it is fitted with."""
        ...

    def ties(self, data: Any) -> Array | None:
        """Prior knowledge (m, k): each row times q is normal with variance 1; None: none."""
        ...

    def noise_features(self, data: Any, simulated: Array) -> Array | None:
        """Return what the noise scale may follow, (n, j) standardised; None: it is the same everywhere."""
        ...


class Box(NamedTuple):
    """Parameters of a baseline and some effects, in this order: the first fields of every model."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q


def box(
    effects: Sequence[Effect], low: Sequence[float], high: Sequence[float], scale: Sequence[float]
) -> Box:
    """Append the parameters of some effects to those of a baseline.

    Example:
        >>> from canid.models.effects import CATALOGUE
        >>> box([effect for effect in CATALOGUE if len(effect.parameters) == 1][:1], [0.0], [1.0], [1.0]).where
        (slice(1, 2, None),)
    """
    lows, highs, scales, where = list(low), list(high), list(scale), []
    for effect in effects:
        where.append(slice(len(lows), len(lows) + len(effect.parameters)))
        lows += [p.low for p in effect.parameters]
        highs += [p.high for p in effect.parameters]
        scales += [abs(p.typical) or 1.0 for p in effect.parameters]
    return Box(tuple(effects), np.array(lows), np.array(highs), np.array(scales), tuple(where))


def place(model: Model, effect: str) -> slice:
    """Parameters in q of one of a model's effects, by its id."""
    return model.where[[each.id for each in model.effects].index(effect)]


# of each name: those of a point, and of the steps around it
KEPT_VALUES = 6

T = TypeVar("T")


class RecentValues:
    """The most recently used values of each name.

    Example:
        >>> import numpy as np
        >>> recent = RecentValues()
        >>> recent.value("x", np.array([1.0]), lambda: 2.0), recent.value("x", np.array([1.0]), lambda: 3.0)
        (2.0, 2.0)
    """

    def __init__(self) -> None:
        self._values: dict[str, dict[bytes, Any]] = {}

    def value(self, name: str, parameters: Array, compute: Callable[[], T]) -> T:
        """Compute a value, or take it from those that were computed before.

        Args:
            name: of the function.
            parameters: (k,) all that it depends on.
            compute: what computes it.
        """
        kept, key = self._values.setdefault(name, {}), parameters.tobytes()
        # the latest is last
        out: T = kept.pop(key) if key in kept else compute()
        if len(kept) >= KEPT_VALUES:
            kept.pop(next(iter(kept)))
        kept[key] = out
        return out
