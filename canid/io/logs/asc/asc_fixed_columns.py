"""Parses lines of an .asc as arrays: lines of the same shape have every field in the same columns.

Two lines have the same shape if each character is of the same class (hexadecimal digit, space, point, ...). Of a
shape, the words of one line give the columns of time, id and data in all of them. What is not certain here is left to
`asc_line`, which is the definition: the results are the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.asc.asc_line import FD_TAIL_WORDS
from canid.io.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, FD64_REMOTE
from canid.io.logs.line_columns import Bytes, LineColumns, none_found, widened
from canid.io.logs.text_lines import Block
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES, MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.types import Flag

Rows = npt.NDArray[np.int64]

# high half of a code: its class; low half, for hexadecimal digits: the digit. All letters of "Length = ... BitCount = ...
# ID = ..." are digits or classes of their own: lines of one shape have these words in the same columns.
_DIGIT, _SPACE, _POINT, _R, _T, _X, _OTHER, _N, _ALIEN, _L, _G, _H, _I, _O, _U, _EQUALS = (
    k << 4 for k in range(16)
)
_CLASS = 0xF0
# shapes tried per length of line, and lines below which a shape is not worth an array; the rest is parsed one by one
_MAX_SHAPES, _MIN_LINES = 16, 8
_TX, _EXTENDED = int(Flag.TX), int(Flag.EXTENDED)
_FD, _BRS, _ESI = int(Flag.FD), int(Flag.BRS), int(Flag.ESI)


def _codes() -> bytes:
    codes = [_ALIEN] * 256
    for k in range(0x21, 0x7F):
        codes[k] = _OTHER
    for text, code in (
        (" \t\r\n", _SPACE), (".,", _POINT), ("Rr", _R), ("Tt", _T), ("x", _X), ("Nn", _N), ("Ll", _L), ("Gg", _G),
        ("Hh", _H), ("Ii", _I), ("Oo", _O), ("Uu", _U), ("=", _EQUALS),
    ):  # fmt: skip
        for character in text:
            codes[ord(character)] = code
    for k in range(16):
        codes[ord(f"{k:x}")] = codes[ord(f"{k:X}")] = _DIGIT | k
    return bytes(codes)


_CODES = _codes()
_CANFD = bytes([0xC, 0xA, _N, 0xF, 0xD])
# the keys of what may follow a classic frame's data
_TAIL_KEY_CODES = tuple(key.encode().translate(_CODES) for key in ("Length", "BitCount", "ID"))


class _Shape(NamedTuple):
    """The columns of each field in lines of one shape."""

    point: int
    time: tuple[int, int]
    bus: tuple[int, int]
    id: tuple[int, int]
    extended: bool
    sent: bool
    length: int  # bytes
    dlc: int  # its column
    dlc_value: int
    data: tuple[int, ...]  # column of each byte's first digit
    letters: tuple[tuple[int, int], ...] = ()  # columns of letters that are digits too, and which
    kind: int = -1  # classic: column of the "d"
    flags: tuple[int, int] = (0, 0)  # FD: the flags' digits; (0, 0): there are none
    brs_esi: tuple[int, int] = (-1, -1)
    size: int = -1  # FD: column of the number of bytes
    size_digits: bytes = b""


def read(block: Block, wanted: npt.NDArray[np.bool_] | None = None) -> LineColumns:
    r"""All frames of usual shapes in a block whose numbers are hexadecimal.

    `wanted`: (n,) the lines that are; None: all.

    >>> fixed = read(Block(b"0.5 1 1F0 Rx d 2 0A ff\n" * 10, np.arange(1, 11) * 23, 1))
    >>> bool(fixed.found[:9].all()), int(fixed.ns[0]), int(fixed.id[8]), fixed.data[8, :2].tolist()
    (True, 500000000, 496, [10, 255])
    """
    begin = np.concatenate([[0], block.ends[:-1]])
    sizes = block.ends - begin
    codes = block.data.translate(_CODES)
    out = none_found(len(begin))
    if wanted is not None:
        sizes = np.where(wanted, sizes, 0)
    if not block.data.endswith(b"\n"):
        sizes[-1] = 0  # not whole
    # lines are taken in whole words of eight bytes, which the last ones may not have
    sizes[begin + (sizes + 7) // 8 * 8 > len(codes)] = 0
    if not sizes.size or sizes.max() >= 1 << 15:
        return out
    order = np.argsort(sizes.astype(np.int16), kind="stable")
    borders = np.flatnonzero(np.diff(sizes[order], prepend=-1, append=-1))
    for a, b in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        if b - a >= _MIN_LINES and sizes[order[a]]:
            rows = order[a:b]
            out = _same_length(codes, begin[rows], int(sizes[rows[0]]), rows, out)
    return out


def _same_length(codes: bytes, begin: Rows, size: int, rows: Rows, out: LineColumns) -> LineColumns:
    words = -(-size // 8)
    overlapping = np.ndarray((len(codes) - 8 * words + 1,), f"V{8 * words}", codes, 0, (1,))
    lines = overlapping[begin]
    within = np.frombuffer((bytes([_CLASS]) * size).ljust(8 * words, b"\0"), np.uint64)
    for _ in range(_MAX_SHAPES):
        classes = lines.view(np.uint64).reshape(-1, words) & within
        alike = classes == classes[0]
        same = slice(None) if alike.all() else alike.all(axis=1)
        shape = _shape(lines[0].tobytes()[:size])
        if shape is not None:
            matrix = lines[same].view(np.uint8).reshape(-1, 8 * words)
            out = _read(shape, matrix, rows[same], out)
        if isinstance(same, slice):
            break
        lines, rows = lines[~same], rows[~same]
        if len(rows) < _MIN_LINES:
            break
    return out


def _words(classes: bytes) -> list[tuple[int, int]]:
    spaces = np.frombuffer(classes, np.uint8) == _SPACE
    edges = np.flatnonzero(np.diff(spaces, prepend=True, append=True)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _shape(line: bytes) -> _Shape | None:
    """The columns of each field in lines like this one (its codes); None where it is not a usual frame."""
    classes = bytes(code & _CLASS for code in line)
    if _ALIEN in classes:
        return None
    words = _words(classes)
    if len(words) < 6:
        return None
    kinds = [classes[a:b] for a, b in words]
    whole, point, fraction = kinds[0].partition(bytes([_POINT]))
    if not (point and 0 < len(whole) <= 9 and 0 < len(fraction) <= 9 and not any(whole + fraction)):
        return None
    at = words[0][0] + len(whole)
    if line[words[1][0] : words[1][1]] == _CANFD:
        return _fd_shape(line, words, kinds, at)
    if not (
        _digits(kinds[1], 4)
        and _digits(kinds[2].removesuffix(bytes([_X])), 8)
        and kinds[3] in (bytes([_R, _X]), bytes([_T, _X]))
        and _digits(kinds[4], 1)
        and _digits(kinds[5], 1)
    ):
        return None
    dlc = line[words[5][0]]
    length = min(dlc, CLASSIC_BYTES)
    data = _data(words, kinds, 6, length)
    letters = _tail(line, words[6 + length :], kinds[6 + length :])
    if data is None or letters is None:
        return None
    return _Shape(
        at, words[0], words[1], *_id(words[2], kinds[2]), kinds[3][0] == _T, length, words[5][0], dlc, data,
        letters, kind=words[4][0],
    )  # fmt: skip


def _fd_shape(line: bytes, words: list[tuple[int, int]], kinds: list[bytes], point: int) -> _Shape | None:
    # without or with a symbolic name; a name of one character could be either
    first = 5 if len(kinds[5]) == 1 else 6
    if len(words) < first + 4 or not (
        _digits(kinds[2], 4)
        and kinds[3] in (bytes([_R, _X]), bytes([_T, _X]))
        and _digits(kinds[4].removesuffix(bytes([_X])), 8)
        and all(_digits(kinds[first + k], 1) for k in range(3))
        and _digits(kinds[first + 3], 2)
    ):
        return None
    begin, end = words[first + 3]
    length = int("".join(map(str, line[begin:end])))
    dlc = line[words[first + 2][0]]
    if max(line[begin:end]) > 9 or length > FD_BYTES or (length == 0 and dlc > 0):
        return None
    data = _data(words, kinds, first + 4, length)
    if data is None:
        return None
    tail = words[first + 4 + length :]
    if len(tail) not in FD_TAIL_WORDS or not all(_digits(kind, 8) for kind in kinds[first + 4 + length :]):
        return None
    return _Shape(
        point, words[0], words[2], *_id(words[4], kinds[4]), kinds[3][0] == _T, length, words[first + 2][0], dlc, data,
        flags=tail[2] if tail else (0, 0),
        brs_esi=(words[first][0], words[first + 1][0]),
        size=begin,
        size_digits=line[begin:end],
    )  # fmt: skip


def _tail(
    line: bytes, words: list[tuple[int, int]], kinds: list[bytes]
) -> tuple[tuple[int, int], ...] | None:
    """Digits among the letters of what follows the data; None where that is not "Length = 240015 BitCount = ..."."""
    if len(words) % 3:
        return None
    letters: list[tuple[int, int]] = []
    for k in range(0, len(words), 3):
        begin, end = words[k]
        if line[begin:end] not in _TAIL_KEY_CODES or kinds[k + 1] != bytes([_EQUALS]):
            return None
        if not _digits(kinds[k + 2].removesuffix(bytes([_X])), 10):
            return None
        letters += [(column, line[column]) for column in range(begin, end) if line[column] < 16]
    return tuple(letters)


def _digits(kinds: bytes, most: int) -> bool:
    return 0 < len(kinds) <= most and not any(kinds)


def _id(word: tuple[int, int], kinds: bytes) -> tuple[tuple[int, int], bool]:
    extended = kinds[-1] == _X
    return (word[0], word[1] - extended), extended


def _data(
    words: list[tuple[int, int]], kinds: list[bytes], first: int, length: int
) -> tuple[int, ...] | None:
    octet_kinds = kinds[first : first + length]
    if len(octet_kinds) < length or any(len(kind) != 2 or any(kind) for kind in octet_kinds):
        return None
    return tuple(begin for begin, _ in words[first : first + length])


def _read(shape: _Shape, codes: Bytes, rows: Rows, out: LineColumns) -> LineColumns:
    """Parse lines of one shape; lines with a letter in place of a decimal digit, or the like, are left out."""
    begin, end = shape.time
    ten = (slice(begin, shape.point), slice(shape.point + 1, end), slice(*shape.bus))
    exact = [(shape.dlc, shape.dlc_value), *shape.letters]
    if shape.kind >= 0:
        exact.append((shape.kind, 0xD))
    else:
        exact += [(column, digit) for column, digit in enumerate(shape.size_digits, shape.size)]
    for columns in ten:
        if codes[:, columns].max(initial=0) > 9:
            right = (codes[:, columns] <= 9).all(axis=1)
            codes, rows = codes[right], rows[right]
    for column, value in exact:
        right = codes[:, column] == value
        if not right.all():
            codes, rows = codes[right], rows[right]
    id_ = _number(codes, *shape.id, 16).astype(np.uint32)
    small = id_ <= (MAX_EXTENDED_ID if shape.extended else MAX_STANDARD_ID)
    flags = np.full(len(rows), _TX * shape.sent | _EXTENDED * shape.extended, np.uint8)
    if shape.kind < 0:
        kinds, plain = _fd_flags(shape, codes)
        flags |= kinds
        small &= plain
    if not small.all():
        codes, rows, id_, flags = codes[small], rows[small], id_[small], flags[small]
    if not len(rows):
        return out
    seconds = _number(codes, begin, shape.point, 10).astype(np.int64)
    digits = end - shape.point - 1
    out.ns[rows] = seconds * 10**9 + (_number(codes, shape.point + 1, end, 10) * 10 ** (9 - digits)).astype(
        np.int64
    )
    bus = _number(codes, *shape.bus, 10)
    out.bus[rows] = np.maximum(bus, 1) - 1
    out.id[rows] = id_
    out.flags[rows] = flags
    out.length[rows] = shape.length
    out.found[rows] = True
    out = widened(out, shape.length)
    if shape.length:
        high, low = _pairs(codes, shape.data)
        out.data[rows, : shape.length] = high << 4 | low
    return out


def _pairs(codes: Bytes, at: tuple[int, ...]) -> tuple[Bytes, Bytes]:
    """Both digits of each data byte."""
    step = at[1] - at[0] if len(at) > 1 else 3
    if at == tuple(range(at[0], at[0] + step * len(at), step)):
        last = at[-1] + 1
        return codes[:, at[0] : last : step], codes[:, at[0] + 1 : last + 1 : step]
    return codes[:, list(at)], codes[:, [column + 1 for column in at]]


def _number(codes: Bytes, begin: int, end: int, base: int) -> npt.NDArray[np.float64]:
    """Digits as whole numbers, exact: nine decimal or eight hexadecimal digits at most."""
    weights = float(base) ** np.arange(end - begin - 1, -1, -1)
    value: npt.NDArray[np.float64] = codes[:, begin:end].astype(np.float64) @ weights
    return value


def _fd_flags(shape: _Shape, codes: Bytes) -> tuple[Bytes, npt.NDArray[np.bool_]]:
    """A CAN FD line's flags, and which lines are plain data frames."""
    if shape.flags == (0, 0):
        bits = np.full(len(codes), FD64_EDL, np.uint32)
    else:
        bits = _number(codes, *shape.flags, 16).astype(np.uint32)
    plain = (bits & FD64_REMOTE) == 0
    brs, esi = (codes[:, column] for column in shape.brs_esi)
    if len(codes) and shape.brs_esi[0] >= 0:
        # the first of both may be a symbolic name of one character
        plain &= (brs <= 1) & (esi <= 1)
    return fd_flags(bits, brs, esi), plain


def fd_flags(bits: npt.NDArray[Any], brs: Bytes, esi: Bytes) -> Bytes:
    """Flags of CANFD lines, from the bits of their flags field and their BRS and ESI digits.

    Flags without EDL: a classic frame on a CAN FD channel; all zero: the writer left them out.

    >>> one = np.ones(3, np.uint8)
    >>> fd_flags(np.array([0x1000, 0, 0x10000]), one, 0 * one).tolist() == [_FD | _BRS, _FD | _BRS, 0]
    True
    """
    fd = ((bits & FD64_EDL) != 0) | (bits == 0)
    flags: Bytes = fd * np.uint8(_FD)
    flags |= (fd & ((brs == 1) | ((bits & FD64_BRS) != 0))) * np.uint8(_BRS)
    flags |= (fd & ((esi == 1) | ((bits & FD64_ESI) != 0))) * np.uint8(_ESI)
    return flags
