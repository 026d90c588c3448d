"""Whole containers are inflated by libdeflate, all others by zlib: which of them did it shows nowhere."""

from __future__ import annotations

import io
import random
import struct
import tracemalloc
import zlib
from types import SimpleNamespace

import deflate
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.logs.blf import blf_containers
from canid.io.logs.blf.blf_containers import Gap, Payload, containers
from canid.io.logs.blf.blf_layout import MAX_INFLATED_BYTES


def container(data: bytes, *, declared: int = 0, more: int = 0, level: int = 6) -> bytes:
    """A container of `data`, padded; `declared`, `more`: how far its sizes are off."""
    packed = zlib.compress(data, level)
    head = struct.pack(
        "<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(packed) + more, 10, 2, (len(data) + declared) % (1 << 32)
    )
    return head + packed + bytes(-len(packed) % 4)


def some_data(rng: random.Random, n: int) -> bytes:
    """What a container may hold: signatures, too, that are stored as they are where nothing is compressed."""
    row = b"LOBJ" + rng.randbytes(12) + bytes(16)
    return b"".join(rng.choice((row, rng.randbytes(32), bytes(32), row[:7])) for _ in range(n))


def read(data: bytes) -> list[Payload | Gap]:
    return list(containers(io.BytesIO(data), 0, len(data)))


def zlib_decompress(packed: bytes, size: int) -> bytearray:
    """The same call by zlib alone, which goes on behind the declared size."""
    try:
        data = bytearray(zlib.decompress(packed))
    except zlib.error as error:
        raise deflate.DeflateError(str(error)) from None
    if len(data) > size:
        raise deflate.DeflateError("more than declared")
    return data


BY_ZLIB = SimpleNamespace(
    zlib_decompress=zlib_decompress, adler32=zlib.adler32, DeflateError=deflate.DeflateError
)


def damaged(rng: random.Random, data: bytes, how: str) -> bytes:
    at, out = rng.randrange(len(data)), bytearray(data)
    if how == "flip":
        out[at] ^= 1 << rng.randrange(8)
    elif how == "cut":
        del out[at:]
    elif how == "lost":
        del out[at : at + rng.randrange(1, 400)]
    elif how == "zeros":
        out[at : at + 64] = bytes(len(out[at : at + 64]))
    elif how == "inserted":
        out[at:at] = rng.randbytes(rng.randrange(1, 40))
    return bytes(out)


@settings(max_examples=250, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    sizes=st.lists(st.integers(1, 300), min_size=1, max_size=6),
    off=st.sampled_from((0, 0, 0, -1, 1, 40)),
    more=st.sampled_from((0, 0, 0, -1, 3, 9, 200)),
    level=st.sampled_from((0, 1, 6, 9)),
    hows=st.lists(st.sampled_from(("none", "flip", "cut", "lost", "zeros", "inserted")), max_size=3),
)
def test_sound_or_damaged_both_say_the_same(
    seed: int, sizes: list[int], off: int, more: int, level: int, hows: list[str]
) -> None:
    """Payloads, where they end, gaps and their words: with zlib in libdeflate's place nothing is different."""
    rng = random.Random(seed)
    wrong = rng.randrange(len(sizes))
    data = b"".join(
        container(some_data(rng, n), declared=off * (k == wrong), more=more * (k == wrong), level=level)
        for k, n in enumerate(sizes)
    )
    for how in hows:
        data = damaged(rng, data, how) if data else data
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blf_containers, "deflate", BY_ZLIB)
        expected = read(data)
    assert read(data) == expected


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    sizes=st.lists(st.integers(1, 4200), min_size=1, max_size=4),
    level=st.sampled_from((0, 1, 6, 9)),
)
def test_whole_containers_are_whole_at_once_and_by_the_piece(seed: int, sizes: list[int], level: int) -> None:
    """Containers of up to 130 kB: what was packed, by libdeflate, and by the stream that takes what it refuses."""
    rng = random.Random(seed)
    held = [some_data(rng, n) for n in sizes]
    data = b"".join(container(one, level=level) for one in held)
    got = read(data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blf_containers, "_inflate_at_once", lambda *_: None)
        assert read(data) == got
    assert [item.data for item in got if isinstance(item, Payload)] == held


def test_what_libdeflate_does_not_know_zlib_settles() -> None:
    """Sizes that are off, bytes behind the stream, a size that reaches over the next container: nothing is lost."""
    first, second = b"LOBJ" + bytes(range(256)) * 8, bytes(5000)
    for off, more in ((-1, 0), (1, 0), (1000, 0), (-len(first), 0), (0, -5), (0, 3), (0, 40)):
        got = read(container(first, declared=off, more=more) + container(second))
        assert [item.data for item in got if isinstance(item, Payload)] == [first, second], (off, more)
    # the first one's size reaches over the second
    both = container(first, more=len(container(second))) + container(second) + container(first)
    assert [item.data for item in read(both) if isinstance(item, Payload)] == [first, second, first]


def test_a_checksum_that_fails_is_damage() -> None:
    """A bit of the stream's checksum: its data are intact, which cannot be known."""
    made = bytearray(container(b"LOBJ" + bytes(2000)))
    made[32 + len(zlib.compress(b"LOBJ" + bytes(2000))) - 1] ^= 1
    (gap,) = read(bytes(made))
    assert isinstance(gap, Gap)
    assert gap.why == "a container's compressed data are damaged"


@pytest.mark.parametrize("declared", [MAX_INFLATED_BYTES + 1, (1 << 32) - 1])
def test_a_declared_size_takes_no_memory(declared: int) -> None:
    """A small stream that claims to hold up to 4 GB: its data are read, and no such memory is allocated."""
    data = bytes(1000)
    made = container(data, declared=declared - len(data))
    tracemalloc.start()
    try:
        got = read(made)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert [item.data for item in got if isinstance(item, Payload)] == [data]
    assert peak < 4 * 1024 * 1024


def test_a_bomb_makes_no_more_than_is_declared() -> None:
    """120 kB that would be 120 MB, said to be 100 kB: found out, and never held."""
    packed = zlib.compress(bytes(120 << 20), 9)
    assert len(packed) < blf_containers.AT_ONCE_BYTES
    made = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, 100_000) + packed
    tracemalloc.start()
    try:
        (gap,) = read(made)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert isinstance(gap, Gap)
    assert "inflates to more than" in gap.why
    assert peak < 4 * MAX_INFLATED_BYTES
