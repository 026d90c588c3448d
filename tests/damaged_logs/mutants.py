"""What happens to files: cut off, bits flipped, blocks zeroed, lost or there twice, sizes that lie."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from typing import NamedTuple

from tests.damaged_logs.bases import Base

# a sector, a page, a container, and less than an object
_BLOCKS = (1, 4, 30, 512, 4096)


class Mutant(NamedTuple):
    """A damaged log."""

    what: str
    data: bytes
    hit: tuple[
        int, int
    ]  # bytes of the whole log, from the first up to behind the last, that are not as they were


Way = Callable[[random.Random, Base], Mutant]


def truncated(rng: random.Random, base: Base) -> Mutant:
    """The file ends early."""
    at = rng.randrange(len(base.data))
    return Mutant(f"truncated at {at}", base.data[:at], (at, len(base.data)))


def flipped(rng: random.Random, base: Base) -> Mutant:
    """One bit, or some within a few bytes, are others."""
    at = rng.randrange(len(base.data))
    end = min(at + rng.choice((1, 1, 8)), len(base.data))
    data = bytearray(base.data)
    for k in range(at, end):
        data[k] ^= 1 << rng.randrange(8)
    return Mutant(f"bits flipped in bytes {at} to {end}", bytes(data), (at, end))


def zeroed(rng: random.Random, base: Base) -> Mutant:
    """A block that never reached the disk."""
    at = rng.randrange(len(base.data))
    end = min(at + rng.choice(_BLOCKS), len(base.data))
    return Mutant(f"zeros from {at} to {end}", base.data[:at] + bytes(end - at) + base.data[end:], (at, end))


def removed(rng: random.Random, base: Base) -> Mutant:
    """A block is missing."""
    at = rng.randrange(len(base.data))
    end = min(at + rng.choice(_BLOCKS), len(base.data))
    return Mutant(f"bytes {at} to {end} removed", base.data[:at] + base.data[end:], (at, end))


def twice(rng: random.Random, base: Base) -> Mutant:
    """A block is there twice."""
    at = rng.randrange(len(base.data))
    end = min(at + rng.choice(_BLOCKS), len(base.data))
    return Mutant(f"bytes {at} to {end} twice", base.data[:end] + base.data[at:], (end, end))


def part_removed(rng: random.Random, base: Base) -> Mutant:
    """A container or line is missing as a whole."""
    k = rng.randrange(len(base.parts))
    begin = base.parts[k].begin
    end = base.parts[k + 1].begin if k + 1 < len(base.parts) else base.parts[k].end
    return Mutant(f"part {k} removed", base.data[:begin] + base.data[end:], (begin, end))


def part_twice(rng: random.Random, base: Base) -> Mutant:
    """A container or line is there twice."""
    k = rng.randrange(len(base.parts))
    begin = base.parts[k].begin
    end = base.parts[k + 1].begin if k + 1 < len(base.parts) else base.parts[k].end
    return Mutant(f"part {k} twice", base.data[:end] + base.data[begin:], (end, end))


def lying(rng: random.Random, base: Base) -> Mutant:
    """A size in a header of a .blf is another; in a text, a word."""
    data = base.data
    if base.suffix != ".blf":
        return zeroed(rng, base)
    # every header, those of objects in stored containers too; a size of the header itself, of the object, its
    # type, a container's compression and size
    at = data.index(b"LOBJ", rng.choice(base.parts).begin)
    inside = [at]
    if not base.checked and rng.random() < 0.5:
        inside = []
        end = next(part.end for part in base.parts if part.begin <= at < part.end)
        while at >= 0:
            inside.append(at)
            at = data.find(b"LOBJ", at + 4, end)
    at = rng.choice(inside)
    offset, form = rng.choice(((4, "<H"), (8, "<L"), (8, "<L"), (12, "<L"), (16, "<H"), (24, "<L")))
    (true,) = struct.unpack_from(form, data, at + offset)
    lie = rng.choice((0, 1, 15, 16, true - 1, true + 1, true + 48, 2 * true, 1 << 16, 1 << 24, (1 << 32) - 1))
    size = struct.calcsize(form)
    word = struct.pack(form, lie % (1 << 8 * size))
    begin, end = at + offset, at + offset + size
    return Mutant(f"{lie} at {begin}, not {true}", data[:begin] + word + data[end:], (begin, end))


WAYS: tuple[Way, ...] = (truncated, flipped, zeroed, removed, twice, part_removed, part_twice, lying)


def mutant(rng: random.Random, base: Base) -> Mutant:
    """Damage a log in one way."""
    return rng.choice(WAYS)(rng, base)
