"""A state with absurd content and a correct checksum is refused with a sentence, or harmless: never an exception."""

from __future__ import annotations

import base64
import copy
import hashlib
import json
import math
import random
import time
import tracemalloc
import warnings
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest

from canid.models.pipeline import pipeline
from canid.models.saving.checksum import Refused, seal, unseal
from canid.models.saving.saved_state import Restored, resume, saver
from canid.values.types import Estimate, Status

NOW = 1.8e9
# of the drive, that a restored state runs on: all rows of both models and several fits
SECONDS = 30.0
# states of a seed that run on; what is refused does not
RUNS = 3


def saved(driven, t: float) -> bytes:
    known = pipeline.known(driven.states[driven.at(t)])
    assert known is not None
    return saver(driven.vehicle, driven.running).save(known, NOW)


def plain_of(fields: dict[str, Any]) -> Any:
    """What is known, as lists, mappings, numbers and texts; an array is [dtype, shape, bytes]."""
    return msgspec.msgpack.decode(base64.b64decode(fields["known"]))


def sealed(fields: dict[str, Any], plain: Any) -> bytes:
    """The same state with another content, under a checksum that fits."""
    return seal({**fields, "known": base64.b64encode(msgspec.msgpack.encode(plain)).decode()})


def is_array(plain: Any) -> bool:
    return isinstance(plain, list) and len(plain) == 3 and isinstance(plain[2], bytes)


def leaves(plain: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of everything that can be changed: numbers, texts, arrays, and lists as a whole."""
    if isinstance(plain, dict):
        for key, of in plain.items():
            yield from leaves(of, (*path, key))
    elif isinstance(plain, list) and not is_array(plain):
        yield path
        for k in range(len(plain)) if len(plain) < 25 else (0, len(plain) // 2, len(plain) - 1):
            yield from leaves(plain[k], (*path, k))
    else:
        yield path


def at(plain: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        plain = plain[step]
    return plain


NUMBERS = (
    *(0.0, -1.0, 1.0, 1e-300, -1e-12, 1e6, 1e15, -1e15, 1e150, 1e300, -1e300),
    *(math.nan, math.inf, -math.inf),
)
WHOLE = (0, -1, 1, 10**6, 2**53, 2**64 - 1, -(2**63))


def absurd(value: Any, rng: random.Random) -> Any:
    """Another value of the same plain type, that is no measurement."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice(WHOLE)
    if isinstance(value, float):
        return rng.choice(NUMBERS)
    if isinstance(value, str):
        return rng.choice(("", "x" * 100_000, "a\n\x1b[2J", "OK", "kalman"))
    if is_array(value):
        return absurd_array(value, rng)
    if isinstance(value, list):
        return rng.choice(
            ([], value[:-1], value * 2, value * 500 if len(value) < 100 else value[::-1], [value])
        )
    assert value is None
    return rng.choice((0.0, [], {}, "x"))


def absurd_array(value: list[Any], rng: random.Random) -> list[Any]:
    dtype, shape, data = value
    array = np.frombuffer(data, dtype).reshape(shape).copy()
    kind = rng.choice(("fill", "one", "shape", "grow", "empty", "huge"))
    if kind == "fill" or not array.size:
        array = np.full_like(array, rng.choice(NUMBERS))
    elif kind == "one":
        array.flat[rng.randrange(array.size)] = rng.choice(NUMBERS)
    elif kind == "shape":
        array = array.reshape(rng.choice(((-1,), (1, -1), (-1, 1), (1, 1, -1))))
    elif kind == "grow":
        array = np.concatenate([array] * 3)
    elif kind == "empty":
        array = array[:0]
    else:
        return [dtype, rng.choice(([10**9], [2**63], [0, 10**18], [-1], [2**62, 4])), data]
    return [dtype, list(array.shape), np.ascontiguousarray(array, dtype).tobytes()]


def check_survives(driven, saving, data: bytes, what: object, runs: bool = True) -> bool | None:
    """Restore, and run on for a part of the drive; return whether it was used.

    None: it could be used, and is not asked to run on.
    """
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = saving.restore(data, NOW)
        if isinstance(found, Refused):
            assert found.says.startswith("the saved state ")
            assert len(found.says) < 400, what
            assert found.says.isprintable(), what
            return False
        if not runs:
            return None
        state, _ = resume(driven.running, saving, data, NOW)
        for chunk in driven.chunks[: driven.at(SECONDS)]:
            state, out = driven.running.step(state, chunk)
            for _, item in out:
                if isinstance(item, Estimate) and item.headline:
                    assert item.status is Status.OK
                    values = [channel.K.value for channel in item.channels.values()]
                    assert any(value == value and abs(value) < 1e9 for value in values), what
    # half a minute of a sound state takes 1 s; what takes twenty times that is a bomb
    assert time.process_time() - began < 25.0, what
    return True


@pytest.mark.slow("states of whole drives, written and read")
@pytest.mark.parametrize("t", [12.0, 30.0, 61.0])
def test_a_sound_state_is_used(driven, t: float) -> None:
    """Before the models begin, and with them: what was learnt passes every rule, and quickly."""
    saving = saver(driven.vehicle, driven.running)
    data = saved(driven, t)
    began = time.process_time()
    found = saving.restore(data, NOW)
    assert isinstance(found, Restored), found
    assert time.process_time() - began < 5.0


@pytest.mark.slow("states of whole drives, written and read")
@pytest.mark.parametrize("seed", range(4))
def test_every_leaf_made_absurd_is_refused_or_harmless(driven, seed: int) -> None:
    """Numbers, shapes, lists, texts and names of a sealed state, each changed to something absurd."""
    rng = random.Random(seed)
    saving = saver(driven.vehicle, driven.running)
    fields = unseal(saved(driven, (30.0, 61.0, 90.0, 12.0)[seed]))
    assert isinstance(fields, dict)
    plain = plain_of(fields)
    # of the many estimates that are alike, some; all of models, windows and times
    paths = [path for path in leaves(plain) if path[:1] != (2,) or rng.random() < 0.1]
    used = run = 0
    for path in rng.sample(paths, min(40, len(paths))):
        changed = copy.deepcopy(plain)
        if path:
            at(changed, path[:-1])[path[-1]] = absurd(at(plain, path), rng)
        else:
            changed = absurd(plain, rng)
        survived = check_survives(driven, saving, sealed(fields, changed), path, runs=used < RUNS)
        used += survived is True
        run += survived is not None
    assert run > 10
    assert used < run


@pytest.mark.parametrize(
    "data",
    [
        b"\x91" * 10**6 + b"\xc0",  # a million arrays in one another
        b"\x81\xa1a" * 10**6 + b"\xc0",  # a million mappings
        b"\xdd\xff\xff\xff\xff",  # an array that claims 4 thousand million entries
        b"\x94\xdd\xff\xff\xff\xff" + b"\xcb" * 64,
        b"\xdf\xff\xff\xff\xff",  # a mapping
        b"\xc6\xff\xff\xff\xff",  # bytes
        b"\xc1",  # never used
        b"",
    ],
    ids=lambda data: data[:6].hex() or "empty",
)
def test_bombs_in_what_is_known_are_refused_at_once(driven, data: bytes) -> None:
    """Depth and sizes that are claimed but not there cost neither time nor memory."""
    saving = saver(driven.vehicle, driven.running)
    fields = unseal(saved(driven, 12.0))
    assert isinstance(fields, dict)
    encoded = base64.b64encode(data).decode()
    tracemalloc.start()
    began = time.process_time()
    try:
        found = saving.restore(seal({**fields, "known": encoded}), NOW)
        assert tracemalloc.get_traced_memory()[1] < 20 * len(data) + 5e6
    finally:
        tracemalloc.stop()
    assert isinstance(found, Refused)
    assert found.says.startswith("the saved state is damaged: ")
    assert time.process_time() - began < 2.0


def test_checksums_over_what_is_no_state(driven) -> None:
    """Depth, digits and sizes of the JSON itself."""
    saving = saver(driven.vehicle, driven.running)
    fields = unseal(saved(driven, 30.0))
    assert isinstance(fields, dict)
    head = {**fields, "known": 0}
    for inner in (
        "[" * 100_000 + "]" * 100_000,
        "9" * 5000,
        '{"a":' * 100_000 + "1" + "}" * 100_000,
        "1e999",
    ):
        raw = seal(head).replace(b'"known": 0', b'"known": ' + inner.encode())
        body = raw.split(b"\n", 2)[2]
        whole = (
            raw.split(b"\n", 1)[0]
            + b'\n"sha256": "'
            + hashlib.sha256(body).hexdigest().encode()
            + b'",\n'
            + body
        )
        assert not check_survives(driven, saving, whole, inner[:10])
    for key, value in (
        ("vehicle", "x" * 10**6),
        ("canid", ["x"]),
        ("configuration", {"x" * 10**5: "y"}),
        ("saved_utc", 1e300),
    ):
        assert not check_survives(driven, saving, seal({**fields, key: value}), key)
    assert json.loads(b"{" + seal(fields).split(b"\n", 2)[2])["known"]
