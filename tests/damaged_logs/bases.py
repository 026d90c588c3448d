"""Small logs to be damaged, of many kinds, and which frame stands in which bytes of them."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from canid.io.buses import messages, python_can
from canid.io.logs import open_log, write_log
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.values.types import Event, Flag, Frame
from tests.fixtures.frame_by_frame import blf_object

START = 1_600_000_000  # s, epoch
_HEADER = 144
_KINDS = (0, Flag.FD, Flag.FD | Flag.BRS, Flag.EXTENDED, Flag.TX, Flag.REMOTE, Flag.ERROR)
_DLC = (0, 1, 5, 8, 12, 24, 64)


class Part(NamedTuple):
    """What is lost together: a container with its frames, or a line."""

    begin: int  # byte in the file
    end: int
    frames: range  # whole or in part


# who wrote a .blf, as python-can states it: its start is UTC
_PYTHON_CAN = (5, 0, 0, 0, 2, 6, 8, 1)


class Base(NamedTuple):
    """A whole log."""

    name: str
    suffix: str
    data: bytes
    frames: list[Frame]  # as canid reads it undamaged; no two are alike but for their times
    start_ns: int  # epoch ns of the first frame
    parts: list[Part]
    header: int  # bytes before the first part
    checked: bool  # its parts have checksums: what is damaged is lost, and never another frame


def drive(rng: random.Random, n: int, kinds: Iterable[int], buses: int) -> list[Frame]:
    """Frames of some kinds, in the order of time, no two with the same id and data."""
    kinds, frames, us = tuple(kinds), [], 0
    for k in range(n):
        flags = int(rng.choice(kinds))
        us += rng.randrange(1, 2000)
        if flags & (Flag.REMOTE | Flag.ERROR):
            # nothing but the id distinguishes it from others
            length = rng.randrange(9) if flags & Flag.REMOTE else -1
            data = b"" if flags & Flag.REMOTE else bytes(8)
            frames.append(
                Frame(us * 1e-6, rng.randrange(buses), 0x10000 + k, data, flags | Flag.EXTENDED, length)
            )
            continue
        count = rng.choice([n for n in _DLC if n >= 4]) if flags & Flag.FD else rng.randrange(4, 9)
        data = k.to_bytes(4, "big") + rng.randbytes(count - 4) if count >= 4 else b""
        largest = 0x1FFFFFFF if flags & Flag.EXTENDED else 0x7FF
        frames.append(Frame(us * 1e-6, rng.randrange(buses), rng.randrange(largest + 1), data, flags))
    first = frames[0].t
    # whole ns since the first frame: what every format keeps
    return [frame._replace(t=round((frame.t - first) * 1e6) * 1000 * 1e-9) for frame in frames]


def bases(folder: Path, seed: int = 1) -> list[Base]:
    """All kinds of logs; `folder` holds them while they are made."""
    rng = random.Random(seed)
    everything = drive(rng, 600, _KINDS, 3)
    made = [
        _own_blf(folder, "classic", drive(rng, 600, (0,), 1), 50),
        _own_blf(folder, "fd", drive(rng, 400, (Flag.FD, Flag.FD | Flag.BRS), 1), 40),
        _own_blf(folder, "mixed", everything, 50),
        _python_can_blf(folder, "crossing", drive(rng, 500, _KINDS[:5], 2)),
        _stored_blf("stored", drive(rng, 500, _KINDS, 2), 40, whole=True),
        _stored_blf("stored-crossing", drive(rng, 300, (0, Flag.EXTENDED), 2), 40, whole=False),
    ]
    for name, suffix, kinds in (
        ("asc", ".asc", _KINDS[:6]),
        ("asc-classic", ".asc", (0, Flag.EXTENDED)),
        ("candump", ".log", _KINDS[:6]),
        ("csv", ".csv", (0, Flag.FD, Flag.EXTENDED, Flag.REMOTE)),
    ):
        made.append(_text(folder, name, suffix, drive(rng, 250, kinds, 1 if suffix == ".csv" else 2)))
    return made


def _own_blf(folder: Path, name: str, frames: list[Frame], each: int) -> Base:
    """Written as canid records: a checkpoint now and then, each a container; and events between the frames."""
    path = folder / f"{name}.blf"
    writer = BlfWriter(path, START * 1_000_000_000)
    for k, frame in enumerate(frames):
        if k % 120 == 7:
            writer.note(Event(frame.t, "remark", f"event {k}"))
        writer.append(frame)
        if k % each == each - 1:
            writer.checkpoint(sync=False)
    writer.close()
    return _blf_base(name, path.read_bytes(), path, checked=True)


def _python_can_blf(folder: Path, name: str, frames: list[Frame]) -> Base:
    """Written by python-can, whose objects go on from container to container."""
    path = folder / f"{name}.blf"
    can = python_can.load()
    with can.BLFWriter(str(path), max_container_size=4096) as writer:
        writer.max_container_size = 4096
        for frame in frames:
            writer.on_message_received(messages.message_of(frame, START))
    return _blf_base(name, path.read_bytes(), path, checked=True)


def _stored_blf(name: str, frames: list[Frame], each: int, *, whole: bool) -> Base:
    """Containers that are not compressed; `whole`: none of their objects goes on in the next one."""
    start = (2020, 9, 0, 13, 12, 26, 40, 0)  # START as a SYSTEMTIME
    items = [(item := blf_object(frame, round(frame.t * 1e9))) + bytes(len(item) % 4) for frame in frames]
    if whole:
        rows = [b"".join(items[k : k + each]) for k in range(0, len(items), each)]
    else:
        row, size = b"".join(items), 48 * each + 11
        rows = [row[k : k + size] for k in range(0, len(row), size)]
    body = b""
    for row in rows:
        head = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(row), 10, 0, len(row))
        body += head + row + bytes((32 + len(row)) % 4)
    uncompressed = _HEADER + sum(32 + len(row) for row in rows)
    fixed = struct.pack(
        "<4sL8BQQLL8H8H", b"LOGG", _HEADER, *_PYTHON_CAN, _HEADER + len(body), uncompressed, len(items), 0, *start, *start
    )  # fmt: skip
    return _blf_base(name, fixed.ljust(_HEADER, b"\0") + body, None, checked=False, expected=frames)


def _blf_base(
    name: str, data: bytes, path: Path | None, *, checked: bool, expected: list[Frame] | None = None
) -> Base:
    """Find the containers, and the frames in each by the sizes of its objects: by hand, not by canid's reader."""
    if path is not None:
        log = open_log(path)
        frames, start_ns = list(log), log.start_ns
        assert log.damage is None
        assert start_ns is not None
    else:
        assert expected is not None
        frames, start_ns = expected, START * 1_000_000_000
    spans, inner, at = [], [], _HEADER
    while (at := data.find(b"LOBJ", at)) >= 0:
        size, method, declared = struct.unpack_from("<8xL4xH6xL", data, at)
        row = data[at + 32 : at + size]
        inner.append(zlib.decompress(row) if method == 2 else row)
        assert len(inner[-1]) == declared
        spans.append((at, at + size))
        at += size
    whole = b"".join(inner)
    of_frame, at = [], 0  # (first byte, byte behind) of each frame in `whole`
    while (at := whole.find(b"LOBJ", at)) >= 0:
        size, kind = struct.unpack_from("<LL", whole, at + 8)
        if kind != 96:
            of_frame.append((at, at + size))
        at += size
    assert len(of_frame) == len(frames)
    parts, begin = [], 0
    for span, row in zip(spans, inner, strict=True):
        end = begin + len(row)
        inside = [k for k, (a, b) in enumerate(of_frame) if a < end and b > begin]
        parts.append(Part(*span, range(inside[0], inside[-1] + 1) if inside else range(0)))
        begin = end
    return Base(name, ".blf", data, frames, start_ns, parts, _HEADER, checked)


def _text(folder: Path, name: str, suffix: str, frames: list[Frame]) -> Base:
    path = folder / f"{name}{suffix}"
    if suffix == ".csv":
        with python_can.load().Logger(str(path)) as writer:
            for frame in frames:
                writer.on_message_received(messages.message_of(frame, START))
    else:
        write_log(path, frames, START)
    log = open_log(path)
    read = list(log)
    assert log.damage is None
    assert log.start_ns is not None
    assert len(read) == len(frames)
    data, parts, begin = path.read_bytes(), [], 0
    for line in data.splitlines(keepends=True):
        # of all formats here, lines that hold a frame are these
        if (
            b" Rx " in line
            or b" Tx " in line
            or line.startswith(b"(")
            or (line[:1].isdigit() and suffix == ".csv")
        ):
            parts.append(Part(begin, begin + len(line), range(len(parts), len(parts) + 1)))
        begin += len(line)
    assert len(parts) == len(frames)
    return Base(name, suffix, data, read, log.start_ns, parts, parts[0].begin, checked=False)
