"""Values that were computed last, by name and parameters: derivatives by different parameters share most of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from canid.types import Array

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
