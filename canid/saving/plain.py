"""Typed values as plain JSON values and back, driven by type hints; every type is checked on the way back.

A state is NamedTuples, tuples and mappings of numbers, texts, enums and numpy arrays. Whoever writes a new one gets
its plain form from the annotations that he writes anyway. Floats keep every bit (but which NaN it is), arrays
their dtype and shape.
"""

from __future__ import annotations

import base64
import math
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache
from typing import Any, NamedTuple

import numpy as np

# JSON has no word for these numbers
_NO_NUMBER = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


class MismatchError(ValueError):
    """A value is not of the type that it should have; the text says where."""


class Form(NamedTuple):
    """The plain form of one type."""

    structure: str  # the type spelt out to its leaves; the same structure: values can be exchanged
    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]  # raises MismatchError


@cache
def form(kind: Any) -> Form:
    """Make the plain form of a type.

    Args:
        kind: bool, int, float, str, an Enum, a NamedTuple; `X | None`, `tuple[X, ...]`, `tuple[X, Y]`,
            `Mapping[X, Y]`, `npt.NDArray[...]` of such.

    Raises:
        TypeError: a type that has none.

    Example:
        >>> numbers = form(tuple[float, int | None])
        >>> numbers.structure, numbers.encode((float("nan"), None))
        ('(float, int?)', ['nan', None])
        >>> numbers.decode([0.1, 3])
        (0.1, 3)
        >>> numbers.decode([0.1, 3.0])
        Traceback (most recent call last):
        canid.saving.plain.MismatchError: [1]: 3.0 is no int
    """
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is float:
        return Form("float", _from_float, _to_float)
    if kind in (bool, int, str):
        return _exactly(kind)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _enum(kind)
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return _record(kind)
    if origin in (typing.Union, types.UnionType) and len(args) == 2 and type(None) in args:
        return _optional(form(next(arg for arg in args if arg is not type(None))))
    if origin is tuple and len(args) == 2 and args[1] is Ellipsis:
        return _row(form(args[0]))
    if origin is tuple:
        return _fixed([form(arg) for arg in args if arg != ()])
    if origin in (dict, Mapping):
        return _mapping(form(args[0]), form(args[1]))
    if origin is np.ndarray:
        return _array(np.dtype(typing.get_args(args[1])[0]))
    raise TypeError(f"{kind} has no plain form")


def _within(place: object, decode: Callable[[Any], Any], plain: Any) -> Any:
    """Decode a part; a mismatch inside it tells its place."""
    try:
        return decode(plain)
    except MismatchError as error:
        between = "" if str(error).startswith(("[", ".")) else ": "
        raise MismatchError(f"{place}{between}{error}") from None


def _be(kind: type, plain: Any) -> Any:
    # exactly: True is an int to isinstance
    if type(plain) is not kind:
        shown = repr(plain) if not isinstance(plain, list | dict) else type(plain).__name__
        raise MismatchError(f"{shown if len(shown) < 40 else shown[:40] + '...'} is no {kind.__name__}")
    return plain


def _exactly(kind: type) -> Form:
    def encode(value: Any) -> Any:
        return _be(kind, value.item() if isinstance(value, np.generic) else value)

    return Form(kind.__name__, encode, lambda plain: _be(kind, plain))


def _from_float(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, float | int | np.floating | np.integer):
        raise MismatchError(f"{value!r} is no float")
    number = float(value)
    return number if math.isfinite(number) else str(number)


def _to_float(plain: Any) -> float:
    if type(plain) is str and plain in _NO_NUMBER:
        return _NO_NUMBER[plain]
    number: float = _be(float, plain)
    return number


def _enum(kind: type[Enum]) -> Form:
    def encode(value: Any) -> str:
        if not isinstance(value, kind):
            raise MismatchError(f"{value!r} is no {kind.__name__}")
        return value.name

    def decode(plain: Any) -> Enum:
        name = _be(str, plain)
        if name not in kind.__members__:
            raise MismatchError(f"{name[:40]!r} is no {kind.__name__}")
        return kind[name]

    # without the values: they are sentences that may be put better
    return Form(f"{kind.__name__}<{' '.join(kind.__members__)}>", encode, decode)


def _record(kind: Any) -> Form:
    hints = typing.get_type_hints(kind)
    parts = {name: form(hints[name]) for name in kind._fields}

    def encode(value: Any) -> Any:
        if type(value) is not kind:
            raise MismatchError(f"{type(value).__name__} is no {kind.__name__}")
        return {
            name: _within(f".{name}", part.encode, x)
            for (name, part), x in zip(parts.items(), value, strict=True)
        }

    def decode(plain: Any) -> Any:
        if list(_be(dict, plain)) != list(parts):
            raise MismatchError(f"{kind.__name__} has the fields {', '.join(parts)}")
        return kind(*[_within(f".{name}", part.decode, plain[name]) for name, part in parts.items()])

    inside = ", ".join(f"{name}: {part.structure}" for name, part in parts.items())
    return Form(f"{kind.__name__}({inside})", encode, decode)


def _optional(inner: Form) -> Form:
    def encode(value: Any) -> Any:
        return None if value is None else inner.encode(value)

    def decode(plain: Any) -> Any:
        return None if plain is None else inner.decode(plain)

    return Form(f"{inner.structure}?", encode, decode)


def _row(inner: Form) -> Form:
    def encode(value: Any) -> Any:
        return [_within(f"[{i}]", inner.encode, x) for i, x in enumerate(_be(tuple, value))]

    def decode(plain: Any) -> Any:
        return tuple([_within(f"[{i}]", inner.decode, x) for i, x in enumerate(_be(list, plain))])

    return Form(f"({inner.structure}, ...)", encode, decode)


def _fixed(parts: list[Form]) -> Form:
    def encode(value: Any) -> Any:
        _count(_be(tuple, value))
        return [_within(f"[{i}]", part.encode, value[i]) for i, part in enumerate(parts)]

    def decode(plain: Any) -> Any:
        _count(_be(list, plain))
        return tuple([_within(f"[{i}]", part.decode, plain[i]) for i, part in enumerate(parts)])

    def _count(value: Any) -> None:
        if len(value) != len(parts):
            raise MismatchError(f"{len(value)} entries instead of {len(parts)}")

    return Form(f"({', '.join(part.structure for part in parts)})", encode, decode)


def _mapping(keys: Form, values: Form) -> Form:
    # pairs: a key need not be a text
    pairs = _row(_fixed([keys, values]))

    def decode(plain: Any) -> Any:
        found = dict(pairs.decode(plain))
        if len(found) != len(plain):
            raise MismatchError("a key comes twice")
        return found

    return Form(
        f"{{{keys.structure}: {values.structure}}}", lambda value: pairs.encode(tuple(value.items())), decode
    )


def _array(dtype: np.dtype[Any]) -> Form:
    stored = dtype.newbyteorder("<")

    def encode(value: Any) -> Any:
        if not isinstance(value, np.ndarray) or value.dtype != dtype:
            raise MismatchError(f"{getattr(value, 'dtype', type(value).__name__)} is no array of {dtype}")
        raw = value.astype(stored, order="C", copy=False).tobytes()
        return {
            "dtype": stored.str,
            "shape": list(value.shape),
            "base64": base64.b64encode(raw).decode("ascii"),
        }

    def decode(plain: Any) -> Any:
        if list(_be(dict, plain)) != ["dtype", "shape", "base64"] or plain["dtype"] != stored.str:
            raise MismatchError(f"no array of {dtype}")
        shape = tuple([_be(int, n) for n in _be(list, plain["shape"])])
        if any(n < 0 for n in shape):  # numpy would guess one
            raise MismatchError("a shape with a negative number")
        try:
            raw = base64.b64decode(_be(str, plain["base64"]), validate=True)
            # a copy: aligned as numpy's own arrays are, and nobody's buffer but its own
            return np.frombuffer(raw, stored).reshape(shape).astype(dtype, copy=True)
        except (ValueError, OverflowError) as error:
            raise MismatchError(
                f"no array of {dtype} of {len(shape)} dimensions: {str(error)[:80]}"
            ) from None

    return Form(f"array<{stored.str}>", encode, decode)
