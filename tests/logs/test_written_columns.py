"""Columns are written as the same frames were one by one: the same objects, containers and lines, byte for byte."""

from __future__ import annotations

import os
import random
import zlib
from pathlib import Path

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_marker import marker
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.io.logs.log_writer import open_writer
from canid.io.logs.text_writers import AscWriter, CandumpWriter
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES, columns_of, rows
from canid.values.types import Columns, Event, Flag, Frame
from tests.fixtures.frame_by_frame import CONTAINER_BYTES, asc_line, blf_object, candump_line
from tests.fixtures.readers import by_python_can

START = 1_700_000_000_123_456_789
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def any_frame(rng: random.Random, ns: int) -> Frame:
    """A frame of any kind that a bus can carry, at any time, on any bus."""
    flags = rng.choice(
        (0, 0, 0, Flag.FD, Flag.FD | Flag.BRS, Flag.FD | Flag.BRS | Flag.ESI, Flag.REMOTE, Flag.ERROR)
    )
    flags = int(flags) | rng.choice((0, 0, Flag.EXTENDED)) | rng.choice((0, 0, Flag.TX))
    id_ = rng.randrange(1 << 29 if flags & (Flag.EXTENDED | Flag.ERROR) else 1 << 11)
    if flags & Flag.REMOTE:
        return Frame(ns * 1e-9, rng.choice((0, 1, 9, 300)), id_, b"", flags, rng.randrange(9))
    size = rng.choice(FD_LENGTHS) if flags & Flag.FD else rng.randrange(9)
    return Frame(ns * 1e-9, rng.choice((0, 1, 9, 300)), id_, rng.randbytes(size), flags)


def drive(rng: random.Random, n: int) -> list[Frame]:
    """Frames with steps of the clock forward and back, of classic CAN alone or of all kinds."""
    ns, frames = 0, []
    plain = rng.random() < 0.3
    for k in range(n):
        ns += rng.choice((0, 1, 499, 125_000, 10**9, 10**13)) - rng.choice((0, 0, 0, 250_000, 2 * 10**9))
        frames.append(Frame(ns * 1e-9, 0, k % 2048, rng.randbytes(8)) if plain else any_frame(rng, ns))
    return frames


def before_the_first(frames: list[Frame]) -> int:
    """Ns from the earliest frame to t = 0."""
    return max(-round(min((frame.t for frame in frames), default=0.0) * 1e9), 0)


def parts(rng: random.Random, frames: list[Frame]) -> list[Columns | Event]:
    """The frames cut anywhere, as wide as they need or wider, with events between some of the cuts."""
    out: list[Columns | Event] = []
    row = 0
    while row < len(frames):
        size = rng.choice((1, 1, 2, 7, 100, 4000))
        chunk = columns_of(frames[row : row + size])
        if chunk.data.shape[1] == CLASSIC_BYTES and rng.random() < 0.2:
            wide = np.zeros((len(chunk.t), FD_BYTES - CLASSIC_BYTES), np.uint8)
            chunk = chunk._replace(data=np.concatenate([chunk.data, wide], axis=1))
        out.append(chunk)
        row += size
        if rng.random() < 0.3:
            out.append(Event(rng.random() * 1e3, "mark", os.urandom(8).hex()))
    return out


def contents(path: Path) -> list[bytes]:
    """What each container of a .blf holds, inflated by zlib."""
    data, at, out = path.read_bytes(), 144, []
    while at < len(data):
        size = blf.OBJECT.unpack_from(data, at)[3]
        out.append(zlib.decompress(data[at + blf.CONTAINER_HEAD_SIZE : at + size]))
        at += size + size % 4
    return out


@pytest.mark.parametrize("trial", range(12))
def test_a_blf_holds_the_same_objects_in_the_same_containers(trial: int, seed: int, tmp_path: Path) -> None:
    """All kinds of frames, cut anywhere, with events and checkpoints in between: the reference's objects."""
    rng = random.Random(f"{seed} {trial}")
    frames = drive(rng, rng.choice((1, 50, 9000)))
    writer = BlfWriter(tmp_path / "x.blf", START)
    writer.lead_ns = before_the_first(frames) + rng.choice((0, 10**9))
    rest = (START - writer.lead_ns) % 1_000_000 + writer.lead_ns
    expected: list[bytes] = [b""]

    def add(item: bytes) -> None:
        if len(expected[-1]) + len(item) > CONTAINER_BYTES:
            expected.append(b"")
        expected[-1] += item

    row = 0
    for part in parts(rng, frames):
        if isinstance(part, Event):
            writer.note(part)
            add(marker(part, round(part.t * 1e9) + rest))
        else:
            writer.append_columns(part)
            for frame in frames[row : row + len(part.t)]:
                add(blf_object(frame, round(frame.t * 1e9) + rest))
            row += len(part.t)
        if rng.random() < 0.1:
            writer.checkpoint(sync=False)
            assert writer.kept == writer.frames == row
            if expected[-1]:
                expected.append(b"")
    writer.close()
    assert contents(tmp_path / "x.blf") == [each for each in expected if each]
    assert writer.frames == writer.kept == len(frames)
    log = open_log(tmp_path / "x.blf")
    assert len(list(log)) == len(frames)
    assert log.damage is None


@pytest.mark.parametrize("trial", range(12))
def test_text_logs_hold_the_same_lines(trial: int, seed: int, tmp_path: Path) -> None:
    """Candump's and Vector's lines, with and without a start, with times before the start."""
    rng = random.Random(f"{seed} {trial}")
    frames = drive(rng, rng.choice((1, 50, 3000)))
    lead = before_the_first(frames) + rng.choice((0, 10**9 + 999))
    start = rng.choice((None, START, lead))
    log = CandumpWriter(tmp_path / "x.log", start)
    asc = AscWriter(tmp_path / "x.asc", start)
    log.lead_ns = asc.lead_ns = lead
    # from whole ms on, or from 1970 where the stamps are of no date
    own = (START - lead) % 1_000_000 + lead if start == START else lead
    for part in parts(rng, frames):
        for writer in (log, asc):
            if not isinstance(part, Event):
                writer.append_columns(part)
            if rng.random() < 0.1:
                writer.checkpoint(sync=False)
    log.close()
    asc.close()
    assert (tmp_path / "x.log").read_text() == "".join(
        candump_line(frame, lead if start is None else start) for frame in frames
    )
    text = (tmp_path / "x.asc").read_text()
    body = text[text.index("Start of measurement\n") + len("Start of measurement\n") :]
    assert body == "".join(asc_line(frame, own) for frame in frames) + "End TriggerBlock\n"


def test_python_can_reads_what_libdeflate_packed(seed: int, tmp_path: Path) -> None:
    """Containers are packed by another library than zlib: python-can, which has zlib alone, reads every frame."""
    rng = random.Random(seed)
    frames = [Frame(k * 1e-3, 0, k % 2048, rng.randbytes(8)) for k in range(20_000)]
    writer = BlfWriter(tmp_path / "x.blf", START)
    writer.append_columns(columns_of(frames))
    writer.close()
    read = by_python_can(tmp_path / "x.blf")
    assert read.complaint == ""
    assert read.frames == [(frame.id, frame.data) for frame in frames]


def test_nothing_of_a_chunk_is_taken_that_the_format_cannot_hold(tmp_path: Path) -> None:
    """One frame of 9 bytes in classic CAN among others: ValueError, and the writer is as it was."""
    frames = [Frame(0.0, 0, 1, b"a"), Frame(0.1, 0, 2, bytes(9)), Frame(0.2, 0, 3, b"c")]
    chunk = columns_of(frames)
    writer = open_writer(tmp_path / "x.blf", START)
    with pytest.raises(ValueError, match="classic CAN carries 8"):
        writer.append_columns(chunk)
    assert (writer.frames, writer.waiting) == (0, 0)
    writer.append_columns(rows(chunk, 0, 1))
    writer.append_columns(rows(chunk, 2, 3))
    writer.close()
    assert [frame.id for frame in open_log(tmp_path / "x.blf")] == [1, 3]
