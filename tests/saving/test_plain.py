"""The plain form keeps every bit of a value, and takes back nothing whose types are not exactly right."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.saving.fingerprint import fingerprint
from canid.saving.plain import MismatchError, form


class Colour(Enum):
    RED = "a sentence"
    BLUE = "another"


class Inner(NamedTuple):
    count: int
    open: bool
    colour: Colour | None


class Outer(NamedTuple):
    pair: tuple[float, str]
    rows: tuple[tuple[float, ...], ...]
    inner: Inner | None
    window: npt.NDArray[np.float64]
    small: npt.NDArray[np.float32]
    flags: npt.NDArray[np.bool_]
    apart: Mapping[tuple[str, str], float]


ANY_FLOAT = st.floats(width=64) | st.sampled_from([math.nan, math.inf, -math.inf, -0.0, 5e-324])
INNER = st.builds(Inner, st.integers(), st.booleans(), st.sampled_from(Colour) | st.none())


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


def same(a: Any, b: Any) -> bool:
    """Equal in type and to the last bit (of any NaN: that it is one)."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return bool(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(tuple(a.items()), tuple(b.items()))
    return a.hex() == b.hex() if isinstance(a, float) else a == b


@settings(max_examples=150, deadline=None, derandomize=True)
@given(VALUES)
def test_every_value_comes_back_to_the_last_bit(value: Outer) -> None:
    """Through real JSON text, with numbers that JSON does not have."""
    through = json.loads(json.dumps(form(Outer).encode(value), allow_nan=False))
    assert same(form(Outer).decode(through), value)


GOOD = Outer(
    (1.5, "a"),
    ((1.0,), ()),
    Inner(1, True, Colour.RED),
    np.ones((2, 2)),
    np.ones(1, np.float32),
    np.array([True]),
    {("a", "b"): 1.0},
)


def leaves(plain: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where anything stands in a plain value."""
    inside = plain.items() if isinstance(plain, dict) else enumerate(plain) if isinstance(plain, list) else ()
    return [path, *[p for key, x in inside for p in leaves(x, (*path, key))]]


def put(plain: Any, path: tuple[Any, ...], wrong: Any) -> Any:
    """The plain value with one part replaced."""
    broken = at = json.loads(json.dumps(plain))
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = wrong
    return broken


@pytest.mark.parametrize("path", leaves(form(Outer).encode(GOOD))[1:], ids=str)
def test_a_wrong_type_anywhere_is_refused_with_its_place(path: tuple[Any, ...]) -> None:
    """Each part in turn becomes something that belongs nowhere."""
    for wrong in ({"wrong": 1}, [[[]]], "wrong" if path[-1] != 1 and path[0] != "apart" else 1):
        with pytest.raises(MismatchError, match=re.escape(f".{path[0]}")):
            form(Outer).decode(put(form(Outer).encode(GOOD), path, wrong))


@pytest.mark.parametrize(
    ("path", "wrong"),
    [
        (("pair", 0), 1),
        (("pair", 0), True),
        (("pair", 0), None),
        (("pair", 0), "1.5"),
        (("pair",), [1.5]),
        (("rows", 0, 0), "NaN"),
        (("inner", "count"), True),
        (("inner", "count"), 1.0),
        (("inner", "open"), 1),
        (("inner", "colour"), "red"),
        (("window", "shape"), [2, 3]),
        (("window", "shape"), [-1, 2]),
        (("window", "shape"), [2.0, 2.0]),
        (("window", "dtype"), "<f4"),
        (("window", "dtype"), "object"),
        (("window", "base64"), "@@@@"),
        (("window", "base64"), ""),
        (("apart",), [[["a", "b"], 1.0], [["a", "b"], 2.0]]),
    ],
)
def test_what_is_nearly_right_is_refused(path: tuple[Any, ...], wrong: Any) -> None:
    """An integer is no float, 1 no yes, a dtype no other dtype, a shape no guess."""
    with pytest.raises(MismatchError, match=re.escape(f".{path[0]}")):
        form(Outer).decode(put(form(Outer).encode(GOOD), path, wrong))


def test_fields_missing_added_or_in_another_order_are_refused() -> None:
    plain = form(Inner).encode(Inner(1, True, None))
    for broken in (
        {**plain, "more": 1},
        {"count": 1, "open": True},
        dict(reversed(plain.items())),
        {**plain, "colour": "GREEN"},
    ):
        with pytest.raises(MismatchError):
            form(Inner).decode(broken)


def test_what_is_not_of_its_type_is_not_saved() -> None:
    """A state that broke its own annotations would be refused when it is read: it is when it is written."""
    with pytest.raises(MismatchError, match=r"\.inner\.count"):
        form(Outer).encode(GOOD._replace(inner=Inner("1", True, None)))  # type: ignore[arg-type]
    with pytest.raises(MismatchError, match=r"\.window.*float32"):
        form(Outer).encode(GOOD._replace(window=np.ones(3, np.float32)))
    assert form(float).encode(np.float64(0.1)) == 0.1


def test_structures_tell_types_apart() -> None:
    """Another field, order, name or type is another structure; the sentences of an enum are not part of it."""

    class Other(NamedTuple):
        count: int
        open: bool
        colour: int | None

    class Renamed(NamedTuple):
        number: int
        open: bool
        colour: Colour | None

    kinds = [Inner, Other, Renamed, Outer, tuple[int, ...], tuple[int], int | None, int, bool, float]
    assert len({form(kind).structure for kind in kinds}) == len(kinds)
    assert form(Inner).structure == "Inner(count: int, open: bool, colour: Colour<RED BLUE>?)"


def test_a_type_without_a_plain_form_is_a_wrong_call() -> None:
    for kind in (Any, object, set[int], int | str):
        with pytest.raises(TypeError, match="no plain form"):
            form(kind)


def test_fingerprints_do_not_depend_on_order_and_see_every_change() -> None:
    value = {"a": Inner(1, True, Colour.RED), "b": frozenset({3, 1, 2})}
    assert fingerprint(value) == fingerprint(dict(reversed(value.items())))
    others = [
        {**value, "a": Inner(2, True, Colour.RED)},
        {**value, "a": Inner(1, True, Colour.BLUE)},
        {**value, "b": frozenset({3, 1})},
        {"a": value["a"]},
        {**value, "b": (1, 2, 3)},
    ]
    assert len({fingerprint(x) for x in [value, *others]}) == 6
