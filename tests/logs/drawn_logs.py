"""Logs of drawn frames, and how they are read."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np

from canid.io.logs import open_log
from canid.values.frame_columns import frames_of
from canid.values.types import Columns, Damage, Flag, Frame

START = 1_600_000_000.0
SIZES = (0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def frame(rng: random.Random, k: int, kinds: tuple[str, ...]) -> Frame:
    """Any kind of frame, on any of three buses."""
    t, bus, kind = (
        (k * 700 + rng.randrange(600)) * 1000 * 1e-9 if k else 0.0,
        rng.randrange(3),
        rng.choice(kinds),
    )
    extended = rng.random() < 0.3
    id_ = rng.randrange(1 << 29) if extended else rng.randrange(1 << 11)
    flags = int(Flag.EXTENDED) * extended | int(Flag.TX) * (rng.random() < 0.2)
    if kind == "fd":
        flags |= int(Flag.FD) | rng.choice((0, int(Flag.BRS), int(Flag.ESI), int(Flag.BRS | Flag.ESI)))
        return Frame(t, bus, id_, rng.randbytes(rng.choice(SIZES)), flags)
    if kind == "remote":
        return Frame(t, bus, id_, b"", flags | int(Flag.REMOTE), rng.randrange(9))
    if kind == "error":
        return Frame(t, bus, 0, b"", int(Flag.ERROR))
    return Frame(t, bus, id_, rng.randbytes(rng.choice((8, 8, 8, 0, 1, 5))), flags)


ALL = ("classic", "classic", "classic", "fd", "remote", "error")


def drive(seed: int, n: int, kinds: tuple[str, ...] = ALL) -> list[Frame]:
    rng = random.Random(seed)
    return [frame(rng, k, kinds) for k in range(n)]


def read(path: Path) -> list[Frame]:
    """The frames of the columns; and what every chunk promises."""
    out, damage = read_damaged(path)
    assert damage is None
    return out


def read_damaged(path: Path) -> tuple[list[Frame], Damage | None]:
    """The same of a log that is not whole."""
    out: list[Frame] = []
    log = open_log(path)
    for chunk in log.columns():
        check_chunk(chunk)
        out += frames_of(chunk)
    return out, log.damage


def check_chunk(chunk: Columns) -> None:
    n = len(chunk.t)
    assert n > 0
    assert [column.dtype.str[1:] for column in chunk] == ["f8", "u2", "u4", "u1", "u1", "u1"]
    assert [len(column) for column in chunk] == [n] * 6
    assert chunk.data.shape[1] in (8, 64)
    held = np.where(chunk.flags & int(Flag.REMOTE), 0, chunk.length)
    assert not chunk.data[np.arange(chunk.data.shape[1]) >= held[:, np.newaxis]].any()
