"""Serialisation keeps every bit of a value, and takes back nothing whose types are not exactly right."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.models.saving.fingerprint import fingerprint
from canid.models.saving.state_codec import MismatchError, codec, structure


class Lamp(Enum):
    RED = "a sentence"
    BLUE = "another"


class Inner(NamedTuple):
    count: int
    open: bool
    lamp: Lamp | None


class Outer(NamedTuple):
    pair: tuple[float, str]
    rows: tuple[tuple[float, ...], ...]
    inner: Inner | None
    window: npt.NDArray[np.float64]
    small: npt.NDArray[np.float32]
    flags: npt.NDArray[np.bool_]
    apart: Mapping[tuple[str, str], float]


ANY_FLOAT = st.floats(width=64) | st.sampled_from([math.nan, math.inf, -math.inf, -0.0, 5e-324])
INNER = st.builds(Inner, st.integers(-(2**63), 2**64 - 1), st.booleans(), st.sampled_from(Lamp) | st.none())


@st.composite
def arrays(draw: st.DrawFn, dtype: Any) -> Any:
    shape = draw(st.lists(st.integers(0, 3), min_size=1, max_size=3))
    raw = draw(st.binary(min_size=8 * math.prod(shape), max_size=8 * math.prod(shape)))
    if dtype is np.bool_:
        return np.frombuffer(raw, np.uint8)[: math.prod(shape)].reshape(shape) > 127
    return np.frombuffer(raw, dtype)[: math.prod(shape)].reshape(shape)


VALUES = st.builds(
    Outer,
    st.tuples(ANY_FLOAT, st.text()),
    st.lists(st.lists(ANY_FLOAT).map(tuple)).map(tuple),
    INNER | st.none(),
    arrays(np.float64),
    arrays(np.float32),
    arrays(np.bool_),
    st.dictionaries(st.tuples(st.text(), st.text()), ANY_FLOAT),
)


OUTER = codec(Outer)


def same(a: Any, b: Any) -> bool:
    """Equal in type and to the last bit."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return bool(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(tuple(a.items()), tuple(b.items()))
    return struct.pack("<d", a) == struct.pack("<d", b) if isinstance(a, float) else a == b


@pytest.mark.slow("states of whole drives, written and read")
@settings(max_examples=150, deadline=None, derandomize=True)
@given(VALUES)
def test_every_value_comes_back_to_the_last_bit(value: Outer) -> None:
    """Of any NaN: the very same bits."""
    assert same(OUTER.decode(OUTER.encode(value)), value)


GOOD = Outer(
    (1.5, "a"),
    ((1.0,), ()),
    Inner(1, True, Lamp.RED),
    np.ones((2, 2)),
    np.ones(1, np.float32),
    np.array([True]),
    {("a", "b"): 1.0},
)


def plain() -> Any:
    """GOOD as lists, mappings, numbers and texts; an array is [dtype, shape, bytes]."""
    return msgspec.msgpack.decode(OUTER.encode(GOOD))


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of everything in a plain value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *[p for key, x in inside for p in leaves(x, (*path, key))]]


def put(path: tuple[Any, ...], wrong: Any) -> bytes:
    """GOOD with one part replaced."""
    broken = at = plain()
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = wrong
    return msgspec.msgpack.encode(broken)


@pytest.mark.parametrize("path", leaves(plain())[1:], ids=str)
def test_a_wrong_type_anywhere_is_refused_with_its_place(path: tuple[Any, ...]) -> None:
    """Each part in turn becomes something of another type."""
    for wrong in ({"wrong": 1}, [[[]]], 1.5 if isinstance(leaf(path), str | bytes) else "wrong"):
        with pytest.raises(MismatchError, match=re.escape(f"$[{path[0]}]")):
            OUTER.decode(put(path, wrong))


def leaf(path: tuple[Any, ...]) -> Any:
    value = plain()
    for key in path:
        value = value[key]
    return value


@pytest.mark.parametrize(
    ("path", "wrong"),
    [
        ((0, 0), 1),
        ((0, 0), True),
        ((0, 0), None),
        ((0, 0), "1.5"),
        ((0,), [1.5]),
        ((1, 0, 0), "NaN"),
        ((2, 0), True),
        ((2, 0), 1.0),
        ((2, 1), 1),
        ((2, 2), "red"),
        ((3, 1), [2, 3]),
        ((3, 1), [-1, 2]),
        ((3, 1), [2.0, 2.0]),
        ((3, 1), [2**62, 4]),
        ((3, 0), "<f4"),
        ((3, 0), "object"),
        ((3, 2), "text"),
        ((3, 2), b"1234"),
        ((3, 2), b""),
    ],
)
def test_what_is_nearly_right_is_refused(path: tuple[Any, ...], wrong: Any) -> None:
    """An integer is no float, 1 no yes, a dtype no other dtype, a shape no guess."""
    with pytest.raises(MismatchError):
        OUTER.decode(put(path, wrong))


def test_a_key_that_comes_twice_is_refused() -> None:
    """And whatever else canid would have written in other bytes."""
    good = OUTER.encode(GOOD)
    entry = msgspec.msgpack.encode(("a", "b")) + msgspec.msgpack.encode(1.0)
    assert good.endswith(b"\x81" + entry)
    for ending in (b"\x82" + entry + entry, b"\xde\x00\x01" + entry, b"\x81" + entry + b"\xc0"):
        with pytest.raises(MismatchError):
            OUTER.decode(good[: -len(entry) - 1] + ending)


def test_fields_missing_or_added_are_refused() -> None:
    for broken in ([1, True, None, 1], [1, True], {"count": 1, "open": True, "lamp": None}):
        with pytest.raises(MismatchError):
            codec(Inner).decode(msgspec.msgpack.encode(broken))


def test_what_is_not_of_its_type_is_not_saved() -> None:
    """A state that broke its own annotations would be refused when it is read: it is when it is written."""
    with pytest.raises(MismatchError, match=re.escape("$[2][0]")):
        OUTER.encode(GOOD._replace(inner=Inner("1", True, None)))  # type: ignore[arg-type]
    with pytest.raises(MismatchError, match=re.escape("$[3]")):
        OUTER.encode(GOOD._replace(window=np.ones(3, np.float32)))
    with pytest.raises(MismatchError):
        OUTER.encode(GOOD._replace(window=object()))  # type: ignore[arg-type]
    with pytest.raises(MismatchError):
        codec(int).encode(2**70)
    assert codec(float).decode(codec(float).encode(np.float64(0.1))) == 0.1
    assert repr(codec(float).decode(codec(float).encode(1))) == "1.0"


def test_structures_distinguish_types() -> None:
    """Another field, order, name or type is another structure; the sentences of an enum are not part of it."""

    class Other(NamedTuple):
        count: int
        open: bool
        lamp: int | None

    class Renamed(NamedTuple):
        number: int
        open: bool
        lamp: Lamp | None

    kinds = [Inner, Other, Renamed, Outer, tuple[int, ...], tuple[int], int | None, int, bool, float]
    assert len({structure(kind) for kind in kinds}) == len(kinds)
    assert structure(Inner) == "Inner(count: int, open: bool, lamp: Lamp<RED BLUE> | None)"


def test_a_type_that_is_not_supported_is_a_wrong_call() -> None:
    for kind in (Any, object, set[int], int | str):
        with pytest.raises(TypeError, match="cannot be saved"):
            codec(kind)


def test_fingerprints_do_not_depend_on_order_and_see_every_change() -> None:
    value = {"a": Inner(1, True, Lamp.RED), "b": frozenset({3, 1, 2})}
    assert fingerprint(value) == fingerprint(dict(reversed(value.items())))
    others = [
        {**value, "a": Inner(2, True, Lamp.RED)},
        {**value, "a": Inner(1, True, Lamp.BLUE)},
        {**value, "b": frozenset({3, 1})},
        {"a": value["a"]},
        {**value, "b": (1, 2, 3)},
    ]
    assert len({fingerprint(x) for x in [value, *others]}) == 6
