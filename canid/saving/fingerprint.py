"""A short text that two values share exactly where they mean the same: of a vehicle's mapping, of settings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Any

# hex digits; 64 bits: two of the vehicles of one fleet share one by chance in 1 of 10^13 fleets of a thousand
DIGITS = 16


def fingerprint(value: Any) -> str:
    """Hash a value of NamedTuples, tuples, mappings, sets, enums, texts and numbers.

    The order of a mapping or a set, and the order of a file's lines, make no difference.

    Example:
        >>> fingerprint({"a": 1.0, "b": (2, None)}) == fingerprint({"b": (2, None), "a": 1.0})
        True
        >>> fingerprint({"a": 1.0}) == fingerprint({"a": 1.0000000000000002})
        False
    """
    return hashlib.sha256(_spelt(value).encode()).hexdigest()[:DIGITS]


def _spelt(value: Any) -> str:
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, Mapping):
        return "{" + ",".join(sorted(f"{_spelt(key)}:{_spelt(of)}" for key, of in value.items())) + "}"
    if isinstance(value, frozenset | set):
        return "<" + ",".join(sorted(map(_spelt, value))) + ">"
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        fields = zip(value._fields, value, strict=True)
        return f"{type(value).__name__}(" + ",".join(f"{name}={_spelt(of)}" for name, of in fields) + ")"
    if isinstance(value, tuple | list):
        return "[" + ",".join(map(_spelt, value)) + "]"
    return repr(value)
