"""A sealed state with absurd content is refused with a sentence, or runs on without a word: never an exception."""

from __future__ import annotations

import copy
import json
import random
import time
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from canid import pipeline
from canid.saving.knowledge import Restored, go_on, keeping
from canid.saving.sealed import Refused, seal, unseal
from canid.types import Estimate, Status

NOW = 1.8e9
SECONDS = 60.0


def saved(driven, t: float) -> bytes:
    known = pipeline.known(driven.states[driven.at(t)])
    assert known is not None
    return keeping(driven.vehicle, driven.running).save(known, NOW)


def leaves(plain: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of everything that can be changed: numbers, texts, arrays, and lists as a whole."""
    if isinstance(plain, dict) and "base64" not in plain:
        for key, of in plain.items():
            yield from leaves(of, (*path, key))
    elif isinstance(plain, list):
        yield path
        for k in sorted({0, len(plain) // 2, len(plain) - 1} & set(range(len(plain)))):
            yield from leaves(plain[k], (*path, k))
    else:
        yield path


def at(plain: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        plain = plain[step]
    return plain


NUMBERS = (0.0, -1.0, 1.0, 1e-300, -1e-12, 1e6, 1e15, -1e15, 1e150, 1e300, -1e300, "nan", "inf", "-inf")
WHOLE = (0, -1, 1, 10**6, 2**53, 10**30, -(10**30))


def absurd(value: Any, rng: random.Random) -> Any:
    """Another value of the same JSON type, that nobody has measured."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice(WHOLE)
    if isinstance(value, float) or value in ("nan", "inf", "-inf"):
        return rng.choice(NUMBERS)
    if isinstance(value, str):
        return rng.choice(("", "x" * 100_000, "a\n\x1b[2J", "OK", "kalman"))
    if isinstance(value, list):
        return rng.choice(
            ([], value[:-1], value * 2, value * 500 if len(value) < 100 else value[::-1], [value])
        )
    if value is None:
        return rng.choice((0.0, [], {}, "x"))
    array = array_of(value)
    kind = rng.choice(("fill", "one", "shape", "grow", "empty", "huge"))
    if kind == "fill" or not array.size:
        array = np.full_like(array, float(rng.choice(NUMBERS)))
    elif kind == "one":
        array.flat[rng.randrange(array.size)] = float(rng.choice(NUMBERS))
    elif kind == "shape":
        array = array.reshape(rng.choice(((-1,), (1, -1), (-1, 1), (1, 1, -1))))
    elif kind == "grow":
        array = np.concatenate([array] * 3)
    elif kind == "empty":
        array = array[:0]
    else:
        return {**value, "shape": rng.choice(([10**9], [10**30], [0, 10**18], [-1], [2**62, 4]))}
    return plain_of(array, value)


def array_of(value: dict[str, Any]) -> np.ndarray:
    import base64

    return np.frombuffer(base64.b64decode(value["base64"]), value["dtype"]).reshape(value["shape"]).copy()


def plain_of(array: np.ndarray, value: dict[str, Any]) -> dict[str, Any]:
    import base64

    raw = np.ascontiguousarray(array, value["dtype"]).tobytes()
    return {"dtype": value["dtype"], "shape": list(array.shape), "base64": base64.b64encode(raw).decode()}


def check_survives(driven, keep, data: bytes, what: object) -> bool:
    """Restore, and run on for a minute of the drive; return whether it was used."""
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = keep.restore(data, NOW)
        if isinstance(found, Refused):
            assert found.says.startswith("the saved state ")
            assert len(found.says) < 400, what
            assert found.says.isprintable(), what
            return False
        state, _ = go_on(driven.running, keep, data, NOW)
        for frame in driven.frames[: driven.at(SECONDS)]:
            state, out = driven.running.step(state, frame)
            for item in out:
                if isinstance(item, Estimate) and item.headline:
                    assert item.status is Status.OK
                    values = [channel.K.value for channel in item.channels.values()]
                    assert any(value == value and abs(value) < 1e9 for value in values), what
    # a minute of a sound state takes 2 s; what takes ten times that is a bomb
    assert time.process_time() - began < 25.0, what
    return True


@pytest.mark.parametrize("t", [12.0, 30.0, 61.0])
def test_a_sound_state_is_used(driven, t: float) -> None:
    """Before the models begin, and with them: what was learnt passes every rule, and quickly."""
    keep = keeping(driven.vehicle, driven.running)
    data = saved(driven, t)
    began = time.process_time()
    found = keep.restore(data, NOW)
    assert isinstance(found, Restored), found
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize("seed", range(4))
def test_every_leaf_made_absurd_is_refused_or_harmless(driven, seed: int) -> None:
    """Numbers, shapes, lists, texts and names of a sealed state, each changed to something absurd."""
    rng = random.Random(seed)
    keep = keeping(driven.vehicle, driven.running)
    fields = unseal(saved(driven, (30.0, 61.0, 90.0, 12.0)[seed]))
    assert isinstance(fields, dict)
    paths = list(leaves(fields["known"]))
    # the interesting ones: models, windows and times; those of the last estimates are many and alike
    paths = [path for path in paths if path[:1] != (2,) or rng.random() < 0.1]
    used = run = 0
    for path in rng.sample(paths, min(60, len(paths))):
        changed = copy.deepcopy(fields)
        inside = at(changed["known"], path[:-1]) if path else changed
        inside[path[-1] if path else "known"] = absurd(at(fields["known"], path), rng)
        data = seal(changed)
        if isinstance(keep.restore(data, NOW), Refused) or used < 4:
            used += check_survives(driven, keep, data, path)
            run += 1
    assert run > 15
    assert used < run


def test_seals_over_what_is_no_state(driven) -> None:
    """Depth, digits and sizes of the JSON itself."""
    keep = keeping(driven.vehicle, driven.running)
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
        import hashlib

        whole = (
            raw.split(b"\n", 1)[0]
            + b'\n"sha256": "'
            + hashlib.sha256(body).hexdigest().encode()
            + b'",\n'
            + body
        )
        assert not check_survives(driven, keep, whole, inner[:10])
    for key, value in (
        ("vehicle", "x" * 10**6),
        ("canid", ["x"]),
        ("configuration", {"x" * 10**5: "y"}),
        ("saved_utc", 1e300),
    ):
        assert not check_survives(driven, keep, seal({**fields, key: value}), key)
    assert json.loads(b"{" + seal(fields).split(b"\n", 2)[2])["known"]
