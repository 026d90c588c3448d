"""Values as a text that is equal only where every number is, NaN included: a result's own `repr` is short."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np


def exact(value: Any) -> str:
    """All of a value of NamedTuples, sequences, mappings and arrays, to the last digit."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        parts = (f"{name}={exact(of)}" for name, of in zip(value._fields, value, strict=True))
        return f"{type(value).__name__}({', '.join(parts)})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{exact(key)}: {exact(of)}' for key, of in value.items())}}}"
    if isinstance(value, np.ndarray):
        return f"array({value.dtype}, {value.shape}, {value.tolist()!r})"
    if isinstance(value, tuple | list | deque):
        return f"{type(value).__name__}[{', '.join(map(exact, value))}]"
    return repr(value)
