"""Frames as a bus has them, drawn: what generators of text logs write in their own ways."""

from __future__ import annotations

import random

from tests.formats_oracle.written import WrittenFrame

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def drawn(
    rng: random.Random,
    buses: tuple[int, ...],
    *,
    fd: bool = False,
    remote: bool = False,
    error: bool = False,
    sent: bool = False,
    tick_ns: int = 1000,
    ordered: bool = False,
) -> list[WrittenFrame]:
    """2 to 40 frames; times are multiples of `tick_ns` since the first one, some earlier than it.

    Args:
        rng: drawn from.
        buses: their numbers.
        fd: some are CAN FD.
        remote: some are remote frames.
        error: some are error frames, with data and an id of error bits.
        sent: some are sent.
        tick_ns: resolution.
        ordered: no frame is earlier than the one before it.
    """
    at, frames = 0, []
    for _ in range(rng.randint(2, 40)):
        ns = at if ordered else max(at - rng.choice((0, 0, 0, rng.randint(0, 400))) * tick_ns, -(10**9))
        frames.append(_one(rng, ns, rng.choice(buses), fd, remote, error, sent))
        at += rng.choice((1, rng.randint(1, 500), rng.randint(1, 900_000))) * tick_ns
    if not ordered and rng.random() < 0.3:  # two logs joined, of which the second began earlier
        shift = rng.randint(1, 500_000) * tick_ns
        half = len(frames) // 2
        frames = frames[:half] + [one._replace(ns=one.ns - shift) for one in frames[half:]]
    first = frames[0].ns
    return [one._replace(ns=one.ns - first) for one in frames]


def _one(
    rng: random.Random, ns: int, bus: int, fd: bool, remote: bool, error: bool, sent: bool
) -> WrittenFrame:
    extended = rng.random() < 0.4
    id_ = (
        rng.choice((rng.randint(0, 0x7FF), rng.randint(0, 0x1FFFFFFF))) if extended else rng.randint(0, 0x7FF)
    )
    way = sent and rng.random() < 0.3
    kind = rng.random()
    if error and kind < 0.1:
        return WrittenFrame(
            ns, bus, rng.randint(1, 0x1FF), False, rng.randbytes(8), frozenset({"error"}), way
        )
    if remote and kind < 0.25:
        return WrittenFrame(ns, bus, id_, extended, b"", frozenset({"remote"}), way, rng.randint(0, 8))
    if fd and kind < 0.5:
        marks = {"fd", *(mark for mark in ("brs", "esi") if rng.random() < 0.5)}
        return WrittenFrame(
            ns, bus, id_, extended, rng.randbytes(rng.choice(FD_LENGTHS)), frozenset(marks), way
        )
    return WrittenFrame(ns, bus, id_, extended, rng.randbytes(rng.randint(0, 8)), frozenset(), way)


def encoded(rng: random.Random, lines: list[str], *, utf16: bool = True) -> tuple[bytes, str]:
    """The lines as a file: line ends of Linux or Windows, ASCII or UTF-16; and how, in words."""
    end = rng.choice(("\n", "\n", "\r\n"))
    text = end.join(lines) + end
    kind = rng.choice(("plain", "plain", "UTF-16 LE", "UTF-16 BE")) if utf16 else "plain"
    if kind == "plain":
        return text.encode("ascii"), "plain"
    name = kind.lower().replace(" ", "-")
    return (b"\xff\xfe" if name.endswith("le") else b"\xfe\xff") + text.encode(name), kind
