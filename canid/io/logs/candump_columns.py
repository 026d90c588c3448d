"""Parses lines of `candump -L` as arrays: lines of one length whose fields stand in the same columns.

Of the lines of a length, the first says where time, interface, id and data stand; all that have the same characters
between them are read together. What is not certain here is left to `candump_reader`, which is the definition: the
results are the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.line_columns import Bytes, LineColumns, none_found, widened
from canid.io.logs.text_lines import MAX_TIME_NS, Block
from canid.values import timestamps
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.types import Flag

Rows = npt.NDArray[np.int64]

# time, interface, id, flags of CAN FD, data, direction: plain frames alone
_USUAL = re.compile(
    rb"\((\d{1,10})\.(\d{1,9})\)[ \t]+([!-~]+)[ \t]+([0-9A-F]{3}|[0-9A-F]{8})#(?:#([0-9A-F]))?"
    rb"((?:[0-9A-F]{2})*)(?:[ \t]+([RT]))?\r?\n",
    re.IGNORECASE,
)
# kinds of lines tried per length, and lines below which a kind is not worth an array; the rest is parsed one by one
_MAX_KINDS, _MIN_LINES = 32, 8
# bytes of a usual line: 64 of data, and names of interfaces; and of data of a classic frame
_MAX_LINE, _CLASSIC = 512, 8
_NONE = 255
_DIGITS = np.full(256, _NONE, np.uint8)
for _k, _digit in enumerate("0123456789abcdef"):
    _DIGITS[[ord(_digit), ord(_digit.upper())]] = _k
# linux/can.h: flags of struct canfd_frame
BRS_BIT, ESI_BIT = 1, 2
_FD_FLAGS = np.array(
    [
        int(Flag.FD | (Flag.BRS if bits & BRS_BIT else 0) | (Flag.ESI if bits & ESI_BIT else 0))
        for bits in range(16)
    ],
    np.uint8,
)
_MAX_SECONDS = MAX_TIME_NS // timestamps.NS_PER_S - 1


class _Fields(NamedTuple):
    """Where each field stands in lines of one kind."""

    seconds: tuple[int, int]
    fraction: tuple[int, int]
    interface: str
    id: tuple[int, int]
    fd: int  # column of the flags' digit; -1: a classic frame
    data: tuple[int, int]
    sent: bool
    between: Rows  # columns of all other characters


def read(block: Block, buses: Mapping[str, int]) -> LineColumns:
    r"""All plain frames of a block whose interfaces are known.

    >>> lines = read(Block(b"(1.5) can0 1F0#0Aff\n" * 10, np.arange(1, 11) * 20, 1), {"can0": 0})
    >>> bool(lines.found.all()), int(lines.ns[0]), int(lines.id[9]), lines.data[8, :2].tolist()
    (True, 1500000000, 496, [10, 255])
    """
    begin = np.concatenate([[0], block.ends[:-1]])
    sizes = block.ends - begin
    out = none_found(len(begin))
    octets = np.frombuffer(block.data, np.uint8)
    order = np.argsort(np.minimum(sizes, _MAX_LINE).astype(np.int16), kind="stable")
    borders = np.flatnonzero(np.diff(np.minimum(sizes, _MAX_LINE)[order], prepend=-1, append=-1))
    for a, b in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        size = int(sizes[order[a]])
        if b - a >= _MIN_LINES and size < _MAX_LINE:
            rows = order[a:b]
            overlapping = np.lib.stride_tricks.sliding_window_view(octets, size)
            out = _same_length(overlapping[begin[rows]], rows, buses, out)
    return out


def _same_length(lines: Bytes, rows: Rows, buses: Mapping[str, int], out: LineColumns) -> LineColumns:
    for _ in range(_MAX_KINDS):
        if len(rows) < _MIN_LINES:
            break
        first = lines[0].tobytes()
        fields = _fields(first)
        # a line of another kind is left out with all that differ from it in their time at most
        same = fields.between if fields is not None else np.arange(first.find(b")") + 1, len(first))
        alike = (lines[:, same] == lines[0, same]).all(axis=1)
        bus = None if fields is None else buses.get(fields.interface)
        if fields is not None and bus is not None:
            out = _read(fields, bus, lines[alike], rows[alike], out)
        if alike.all():
            break
        lines, rows = lines[~alike], rows[~alike]
    return out


def _fields(line: bytes) -> _Fields | None:
    match = _USUAL.fullmatch(line)
    if match is None:
        return None
    length = (match.end(6) - match.start(6)) // 2
    if length > (_CLASSIC if match[5] is None else 64):
        return None
    varies = np.zeros(len(line), bool)
    for group in (1, 2, 4, 5, 6):
        varies[slice(*match.span(group)) if match[group] is not None else slice(0)] = True
    return _Fields(
        match.span(1),
        match.span(2),
        match[3].decode("latin-1"),
        match.span(4),
        match.start(5),
        match.span(6),
        match[7] in (b"T", b"t"),
        np.flatnonzero(~varies),
    )


def _read(fields: _Fields, bus: int, lines: Bytes, rows: Rows, out: LineColumns) -> LineColumns:
    """Parse lines of one kind; those with another character in the place of a digit are left out."""
    (a, b), (c, d) = fields.id, fields.data
    codes = _DIGITS[lines]
    right = np.ones(len(rows), bool)
    for begin, end in (fields.seconds, fields.fraction):
        right &= codes[:, begin:end].max(axis=1, initial=0) < 10
    hexadecimal = [codes[:, a:b], codes[:, c:d]]
    if fields.fd >= 0:
        hexadecimal.append(codes[:, fields.fd : fields.fd + 1])
    for digits in hexadecimal:
        right &= digits.max(axis=1, initial=0) < 16
    seconds = _number(codes, *fields.seconds, 10)
    id_ = _number(codes, a, b, 16)
    extended = b - a > 3
    right &= (seconds <= _MAX_SECONDS) & (id_ <= (MAX_EXTENDED_ID if extended else MAX_STANDARD_ID))
    if not right.all():
        codes, rows, seconds, id_ = codes[right], rows[right], seconds[right], id_[right]
    begin, end = fields.fraction
    out.found[rows] = True
    out.ns[rows] = seconds * timestamps.NS_PER_S + _number(codes, begin, end, 10) * 10 ** (9 - (end - begin))
    out.bus[rows], out.id[rows] = bus, id_
    out.flags[rows] = int(Flag.TX) * fields.sent | int(Flag.EXTENDED) * extended
    if fields.fd >= 0:
        out.flags[rows] |= _FD_FLAGS[codes[:, fields.fd]]
    length = (d - c) // 2
    out.length[rows] = length
    out = widened(out, length)
    out.data[rows, :length] = codes[:, c:d:2] << 4 | codes[:, c + 1 : d : 2]
    return out


def _number(codes: Bytes, begin: int, end: int, base: int) -> npt.NDArray[np.int64]:
    """Digits as whole numbers, exact: ten decimal or eight hexadecimal digits at most."""
    weights = float(base) ** np.arange(end - begin - 1, -1, -1)
    value: npt.NDArray[np.int64] = (codes[:, begin:end].astype(np.float64) @ weights).astype(np.int64)
    return value
