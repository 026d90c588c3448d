"""Lines of a text log from whole columns: numbers, hex and repeated texts as one matrix of characters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Columns

Octets = npt.NDArray[np.uint8]
# what the text of a frame depends on, apart from its time and its data: bus, id, flags, length
Key = tuple[int, int, int, int]

_ZERO, _SPACE = ord("0"), ord(" ")
_HEX = np.array([list(f"{octet:02X} ".encode()) for octet in range(256)], np.uint8)


class Block(NamedTuple):
    """Characters, (n, width), and which of them belong to the line."""

    octets: Octets
    shown: npt.NDArray[np.bool_]


class Lines(NamedTuple):
    """Lines one behind the other."""

    text: bytes
    ends: npt.NDArray[np.int64]  # (n,) of each line


def joined(blocks: Sequence[Block]) -> Lines:
    """Put blocks side by side.

    >>> joined([texts(["a", "bb"], np.array([1, 0])), number(np.array([7, 12]))])
    Lines(text=b'bb7a12', ends=array([3, 6]))
    """
    octets = np.concatenate([block.octets for block in blocks], axis=1)
    shown = np.concatenate([block.shown for block in blocks], axis=1)
    return Lines(octets[shown].tobytes(), np.cumsum(shown.sum(axis=1)))


def number(values: npt.NDArray[np.int64], *, digits: int = 1, fill: str = "") -> Block:
    """Whole numbers that are not negative, in decimal.

    Args:
        values: (n,)
        digits: as many at least.
        fill: what stands before a shorter number, "0" or " "; "": nothing.
    """
    width = max(len(str(int(values.max(initial=0)))), digits)
    powers = 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
    octets = (values[:, None] // powers % 10 + _ZERO).astype(np.uint8)
    if fill == "0":
        return Block(octets, np.ones(octets.shape, bool))
    needed = values[:, None] >= powers
    needed[:, -1] = True
    if fill:
        # a column that only some of the longest numbers need is no part of the shorter ones
        octets[~needed] = _SPACE
        needed[:, width - digits :] = True
    return Block(octets, needed)


def text(octets: bytes, n: int) -> Block:
    """The same text in all of n lines."""
    row = np.frombuffer(octets, np.uint8)
    return Block(np.broadcast_to(row, (n, len(row))), np.ones((n, len(row)), bool))


def texts(choices: Sequence[str], which: npt.NDArray[np.int64]) -> Block:
    """One of some texts in each line; `which` (n,) says which."""
    encoded = [each.encode("ascii") for each in choices]
    width = max((len(each) for each in encoded), default=0)
    table = np.frombuffer(b"".join(each.ljust(width) for each in encoded), np.uint8).reshape(-1, width)
    lengths = np.array([len(each) for each in encoded])
    return Block(table[which], np.arange(width) < lengths[which, None])


def hexadecimal(data: Octets, lengths: npt.NDArray[np.int64], *, spaced: bool) -> Block:
    """Data bytes (n, width) as two capital digits each, the first `lengths` (n,) of every row.

    `spaced`: a space between two of them.
    """
    width = int(lengths.max(initial=0))
    each = 3 if spaced else 2
    octets = _HEX[data[:, :width], :each].reshape(len(data), each * width)
    characters = np.maximum(each * lengths - (1 if spaced else 0), 0)
    return Block(octets, np.arange(each * width) < characters[:, None])


class Keyed(NamedTuple):
    """The different keys of a chunk, and which of them each frame has."""

    keys: list[Key]
    which: npt.NDArray[np.int64]


def keyed(chunk: Columns, lengths: npt.NDArray[np.int64]) -> Keyed:
    """Find the different combinations of bus, id, flags and length."""
    low = (chunk.id.astype(np.uint64) << np.uint64(16)) | (chunk.flags.astype(np.uint64) << np.uint64(8))
    low |= lengths.astype(np.uint64) | (chunk.bus.astype(np.uint64) << np.uint64(48))
    _, rows, which = np.unique(low, return_index=True, return_inverse=True)
    columns = (chunk.bus[rows], chunk.id[rows], chunk.flags[rows], lengths[rows])
    keys = list(zip(*(column.tolist() for column in columns), strict=True))
    return Keyed(keys, which.reshape(len(lengths)))


class TextCache:
    """Texts by key: most of them are needed again with the next frames."""

    def __init__(self, make: Callable[[Key], str], size: int):
        """`size`: keys that are kept."""
        self._make = make
        self._size = size
        self._texts: dict[Key, str] = {}

    def of(self, keys: Sequence[Key]) -> list[str]:
        """The text of each key."""
        if len(self._texts) > self._size:
            self._texts.clear()
        known = self._texts
        for key in keys:
            if key not in known:
                known[key] = self._make(key)
        return [known[key] for key in keys]
