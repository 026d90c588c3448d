"""Typed serialisation of states: MessagePack by msgspec, driven by type hints and strict on the way back.

A state is NamedTuples, tuples and mappings of numbers, texts, enums and numpy arrays; its annotations define its form.
Floats keep every bit, arrays their dtype and shape.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple

import msgspec
import numpy as np

# characters of a library's message that stand in a sentence
MAX_MESSAGE_LENGTH = 200
_FAILURES = (msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError)


class MismatchError(ValueError):
    """A value is not of the type that it should have; the text says where."""


class Codec(NamedTuple):
    """Serialisation of one type."""

    structure: str  # the type spelt out to its leaves; the same structure: values can be exchanged
    encode: Callable[[Any], bytes]  # raises MismatchError
    decode: Callable[[bytes], Any]  # raises MismatchError


def codec(kind: Any) -> Codec:
    """Make the serialisation of a type.

    Args:
        kind: bool, int, float, str, an Enum, a NamedTuple; `X | None`, `tuple[X, ...]`, `tuple[X, Y]`,
            `Mapping[X, Y]`, `npt.NDArray[...]` of such.

    Raises:
        TypeError: a type that is none of these.

    Example:
        >>> numbers = codec(tuple[float, int | None])
        >>> numbers.structure
        'tuple[float, int | None]'
        >>> numbers.decode(numbers.encode((float("nan"), None)))
        (nan, None)
        >>> numbers.encode((0.1, 3.0))
        Traceback (most recent call last):
        canid.models.saving.state_codec.MismatchError: Expected `int | null`, got `float` - at `$[1]`
    """
    spelt = structure(kind)
    encoder = msgspec.msgpack.Encoder(enc_hook=_plain)
    decoder = msgspec.msgpack.Decoder(kind, dec_hook=_array)

    def encode(value: Any) -> bytes:
        try:
            # the encoder knows no types: decoding checks them, and makes a float of an integer that stands for one
            return encoder.encode(decoder.decode(encoder.encode(value)))
        except _FAILURES as error:
            raise MismatchError(str(error)[:MAX_MESSAGE_LENGTH]) from None

    def decode(data: bytes) -> Any:
        try:
            value = decoder.decode(data)
            # there is one form of a value: no key twice, no integer for a float
            canonical = encoder.encode(value) == data
        except _FAILURES as error:
            raise MismatchError(str(error)[:MAX_MESSAGE_LENGTH]) from None
        if not canonical:
            raise MismatchError("it is not in the form in which canid saves it")
        return value

    return Codec(spelt, encode, decode)


def structure(kind: Any) -> str:
    """Spell a type out to its leaves; an enum with its members, but without their values, which may be sentences.

    Raises:
        TypeError: a type that `codec` does not support.

    Example:
        >>> structure(Codec)
        Traceback (most recent call last):
        TypeError: collections.abc.Callable[[typing.Any], bytes] cannot be saved
        >>> structure(dict[str, tuple[float, ...]])
        'dict[str, tuple[float, ...]]'
    """
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind in (bool, int, float, str):
        return str(kind.__name__)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"{kind.__name__}<{' '.join(kind.__members__)}>"
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        hints = typing.get_type_hints(kind)
        return f"{kind.__name__}({', '.join(f'{name}: {structure(hints[name])}' for name in kind._fields)})"
    if origin in (typing.Union, types.UnionType) and len(args) == 2 and type(None) in args:
        return f"{structure(next(arg for arg in args if arg is not type(None)))} | None"
    if origin is tuple:
        return f"tuple[{', '.join('...' if arg is Ellipsis else structure(arg) for arg in args)}]"
    if origin in (dict, Mapping):
        return f"dict[{structure(args[0])}, {structure(args[1])}]"
    if origin is np.ndarray:
        return f"array[{np.dtype(typing.get_args(args[1])[0]).newbyteorder('<').str}]"
    raise TypeError(f"{kind} cannot be saved")


class _PlainArray(NamedTuple):
    dtype: str  # little-endian
    shape: tuple[int, ...]
    data: bytes  # C order


def _plain(value: Any) -> Any:
    """Encoding hook: numpy's values as plain ones."""
    if isinstance(value, np.ndarray):
        stored = value.dtype.newbyteorder("<")
        return _PlainArray(stored.str, value.shape, value.astype(stored, order="C", copy=False).tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be saved")


def _array(kind: Any, plain: Any) -> Any:
    """Decoding hook: an array of the dtype that its annotation has."""
    dtype = np.dtype(typing.get_args(typing.get_args(kind)[1])[0])
    try:
        stored, shape, data = msgspec.convert(plain, _PlainArray)
    except msgspec.ValidationError:
        raise ValueError(f"no array of {dtype}") from None  # the decoder adds the place
    if stored != dtype.newbyteorder("<").str:
        raise ValueError(f"no array of {dtype}")
    if any(n < 0 for n in shape):  # numpy would infer one
        raise ValueError("a shape with a negative number")
    # a copy: aligned as numpy's own arrays are, and with a buffer of its own
    return np.frombuffer(data, stored).reshape(shape).astype(dtype, copy=True)
