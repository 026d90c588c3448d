"""Fingerprints of configuration values: SHA-256 of a canonical text."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Any

# hex digits; 64 bits: a collision among a thousand vehicles has the probability 3e-14
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
    return hashlib.sha256(_canonical(value).encode()).hexdigest()[:DIGITS]


def _canonical(value: Any) -> str:
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, Mapping):
        return (
            "{"
            + ",".join(sorted(f"{_canonical(key)}:{_canonical(item)}" for key, item in value.items()))
            + "}"
        )
    if isinstance(value, frozenset | set):
        return "<" + ",".join(sorted(map(_canonical, value))) + ">"
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        fields = zip(value._fields, value, strict=True)
        return (
            f"{type(value).__name__}("
            + ",".join(f"{name}={_canonical(field)}" for name, field in fields)
            + ")"
        )
    if isinstance(value, tuple | list):
        return "[" + ",".join(map(_canonical, value)) + "]"
    return repr(value)
