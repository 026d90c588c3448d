"""A message of a child that parses what strangers wrote is values, whatever the child has become."""

from __future__ import annotations

import datetime
import io
import os
import pickle
import random
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from canid.values.processes import plain_values
from canid.values.processes.child import Child, NoAnswerError
from tests.exact import exact


class Named(NamedTuple):
    """A type that a reader lists."""

    number: int
    values: Any


class _Calls:
    """Pickled as a call."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> Any:
        return self.call


def test_values_come_as_they_were_sent() -> None:
    """Python's values, dates, arrays of every type of numbers in every layout, and types that are listed."""
    stamp = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.timezone(datetime.timedelta(hours=1)))
    values = [None, True, -(2**80), 1.5, "ü\0", b"x", (1, [2, {3: {4}}]), stamp, stamp.date(), stamp.time()]
    assert plain_values.loads(plain_values.dumps(values)) == values
    table = np.arange(24).reshape(4, 6)
    for dtype in ("?", "i1", "u1", "<i2", ">u4", "<u8", "<f4", ">f8", "<f2"):
        for array in (table, table[::2, ::-1], table.T, table[:0]):
            sent = array.astype(dtype) if array.flags.c_contiguous else array
            got = plain_values.loads(plain_values.dumps(sent))
            assert got.dtype == sent.dtype
            assert exact(got) == exact(np.array(sent))
    named = Named(3, np.array([1.5]))
    got = plain_values.loads(plain_values.dumps(named), (Named,))
    assert type(got) is Named
    with pytest.raises(pickle.UnpicklingError, match="Named is no value"):
        plain_values.loads(plain_values.dumps(named))


def test_a_message_calls_nothing(tmp_path: Path) -> None:
    """Calls of os, builtins, numpy, of canid and of attributes of what is listed are refused before they are made."""
    marker = tmp_path / "marker"
    messages = [
        pickle.dumps(_Calls(os.system, f"touch {shlex.quote(str(marker))}"), protocol=5),
        pickle.dumps(_Calls(eval, f"open({str(marker)!r}, 'w')"), protocol=5),
        pickle.dumps(_Calls(open, str(marker), "w"), protocol=2),
        pickle.dumps(np.arange(3), protocol=5),
        pickle.dumps(np.float64(1.0), protocol=5),
        pickle.dumps(np.dtype("O"), protocol=5),
        # attributes of names that may be named: pickle follows dots from protocol 4 on
        *(
            b"\x80\x05"
            + b"".join(b"\x8c" + bytes([len(text)]) + text.encode() for text in (plain_values.__name__, name))
            + b"\x93."
            for name in ("array.__call__", "pickle", "array.__globals__")
        ),
        f"cos\nsystem\n(S'touch {marker}'\ntR.".encode(),
    ]
    for message in messages:
        with pytest.raises(pickle.UnpicklingError, match="is no value"):
            plain_values.loads(message, (Named,))
    assert not marker.exists()


@pytest.mark.parametrize(
    "dtype", ["O", "S4", "U1", "V8", "M8[ns]", "i4,O", "b,O", "", "{'names': ['a']}", "f8x"]
)
def test_an_array_is_numbers(dtype: str) -> None:
    """A message cannot claim that bytes are objects, records or texts."""
    message = pickle.dumps(_Calls(plain_values.array, dtype, (1,), bytes(64)), protocol=5)
    with pytest.raises(ValueError, match="not a type of numbers"):
        plain_values.loads(message)


def test_an_array_has_the_bytes_that_it_says() -> None:
    """Too few, too many, and a shape that no memory holds."""
    for shape in ((3,), (1,), (2, 2), (2**40, 2**40), (-5,)):
        with pytest.raises((ValueError, OverflowError)):
            plain_values.array("<i8", shape, bytes(16))
    with pytest.raises(pickle.PicklingError, match="an array of object"):
        plain_values.dumps(np.array([None]))


def test_damaged_messages_are_no_answers(seed: int, tmp_path: Path) -> None:
    """Bytes of a message changed, cut and joined anywhere end in an exception or in values, never in a call."""
    rng = random.Random(seed)
    whole = bytearray(
        plain_values.dumps((Named(1, np.arange(9)), {"a": [datetime.date(2026, 1, 1)]}, "text" * 9))
    )
    for _ in range(2000):
        message = bytearray(whole)
        for _ in range(rng.randint(1, 6)):
            message[rng.randrange(len(message))] = rng.randrange(256)
        try:
            plain_values.load(io.BytesIO(message[: rng.randint(1, len(message))]), (Named,))
        except Exception:
            continue


def test_a_child_cannot_make_its_parent_act(tmp_path: Path) -> None:
    """A child that answers with a call is one that has not answered."""
    marker = tmp_path / "marker"
    code = (
        "import os, pickle, sys\n"
        "class Call:\n"
        "    def __reduce__(self):\n"
        f"        return os.system, ({shlex.join(['touch', str(marker)])!r},)\n"
        "sys.stdout.buffer.write(pickle.dumps(Call()))\n"
    )
    with (
        Child([sys.executable, "-c", code], answers=()) as child,
        pytest.raises(NoAnswerError, match="is no value"),
    ):
        child.receive()
    assert not marker.exists()
