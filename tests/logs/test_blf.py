"""The .blf reader and writer against python-can, and against themselves."""

from __future__ import annotations

import math
import random
import struct
import zlib
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.buses import messages, python_can
from canid.io.logs import open_log, write_log
from canid.io.logs.blf.blf_reader import read_blf
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.io.logs.reader_state import ReadState
from canid.values.errors import OutputError
from canid.values.frame_columns import columns_of
from canid.values.types import Flag, Frame
from tests.fixtures.measured_logs import files, needs_measured

LOGS = files("*/*.blf")
FD_LENGTHS = (0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def any_frame() -> st.SearchStrategy[Frame]:
    """Every kind of frame that a bus can bring."""

    def build(ns: int, bus: int, kind: str, extended: bool, flags: int, id_: int, data: bytes) -> Frame:
        word = flags | (Flag.EXTENDED if extended else 0)
        id_ = id_ if extended else id_ & 0x7FF
        t = ns * 1e-9
        if kind == "fd":
            length = max(n for n in FD_LENGTHS if n <= len(data))
            return Frame(t, bus, id_, data[:length], int(word | Flag.FD))
        word &= ~(Flag.BRS | Flag.ESI)
        if kind == "remote":
            return Frame(t, bus, id_, b"", int(word | Flag.REMOTE), len(data) % 9)
        if kind == "error":
            return Frame(t, bus, id_, data[:8], int((word & ~Flag.TX) | Flag.ERROR))
        return Frame(t, bus, id_, data[:8], int(word))

    return st.builds(
        build,
        st.integers(0, 10**14),  # up to 28 hours
        st.integers(0, 20),
        st.sampled_from(("classic", "classic", "fd", "remote", "error")),
        st.booleans(),
        st.sampled_from((0, int(Flag.TX), int(Flag.BRS), int(Flag.BRS | Flag.ESI | Flag.TX))),
        st.integers(0, 0x1FFFFFFF),
        st.binary(max_size=64),
    )


def from_zero(frames: list[Frame]) -> list[Frame]:
    """The same frames with the first at t = 0, in whole ns."""
    first = round(frames[0].t * 1e9)
    return [frame._replace(t=(round(frame.t * 1e9) - first) * 1e-9) for frame in frames]


starts = st.one_of(st.just(math.nan), st.floats(1e9, 4e9))


@pytest.mark.slow("many logs, written and read")
@settings(max_examples=150, deadline=None)
@given(frames=st.lists(any_frame(), min_size=1, max_size=30), start=starts)
def test_what_is_written_comes_back_bit_for_bit(
    frames: list[Frame], start: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Every kind of frame, also out of order, comes back equal; the start to 1 µs."""
    frames = from_zero(frames)
    # ns from whole ms, which the header holds, to the start
    room = 0 if math.isnan(start) else round(start * 1e6) % 1000 * 1000
    if round(min(frame.t for frame in frames) * 1e9) < -room:
        with pytest.raises(ValueError, match="zero"):
            write_log(tmp_path_factory.mktemp("blf") / "x.blf", frames, start)
        frames = from_zero(sorted(frames))
    path = tmp_path_factory.mktemp("blf") / "x.blf"
    write_log(path, frames, start)
    log = open_log(path)
    assert list(log) == frames
    assert log.damage is None
    assert math.isnan(log.start_utc) if math.isnan(start) else abs(log.start_utc - start) < 1e-6


@settings(max_examples=100, deadline=None)
@given(frames=st.lists(any_frame(), min_size=1, max_size=30))
def test_python_can_reads_the_same_frames(
    frames: list[Frame], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """python-can's reader finds each frame with the same id, data, kind and absolute time."""
    frames = from_zero(sorted(frames))
    path = tmp_path_factory.mktemp("blf") / "x.blf"
    write_log(path, frames, 1533224087.123456)
    with python_can.load().BLFReader(str(path)) as reader:
        theirs = list(reader)
    assert len(theirs) == len(frames)
    for message, frame in zip(theirs, frames, strict=True):
        assert messages.flags_of(message) == frame.flags
        assert (message.channel, message.arbitration_id, bytes(message.data)) == (
            frame.bus,
            frame.id,
            frame.data,
        )
        # float epoch seconds resolve 0.24 µs
        assert abs(message.timestamp - 1533224087.123456 - frame.t) < 5e-7
        if frame.flags & Flag.REMOTE:
            assert message.dlc == frame.length


@settings(max_examples=100, deadline=None)
@given(frames=st.lists(any_frame(), min_size=1, max_size=30))
def test_python_cans_files_are_read(frames: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> None:
    """What python-can's writer writes is read: equal frames, times within python-can's rounding."""
    frames = from_zero(sorted(frames))
    path = tmp_path_factory.mktemp("blf") / "x.blf"
    with python_can.load().BLFWriter(str(path)) as writer:
        for frame in frames:
            writer.on_message_received(messages.message_of(frame, 1533224087.0))
    log = open_log(path)
    ours = list(log)
    assert [frame._replace(t=0.0) for frame in ours] == [frame._replace(t=0.0) for frame in frames]
    assert all(abs(mine.t - frame.t) < 5e-7 for mine, frame in zip(ours, frames, strict=True))
    assert abs(log.start_utc - 1533224087.0) < 5e-7
    assert log.damage is None


@needs_measured
@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.name)
def test_real_logs_equal_python_can(path: Path) -> None:
    """On every real log every frame equals python-can's."""
    log = open_log(path)
    count = 0
    with python_can.load().BLFReader(str(path)) as reader:
        for frame, message in zip(log, reader, strict=True):
            count += 1
            assert frame.bus == message.channel
            assert frame.id == message.arbitration_id
            assert frame.data == bytes(message.data)
            assert frame.flags == messages.flags_of(message)
            assert abs(log.start_utc + frame.t - message.timestamp) < 5e-7
    assert log.damage is None
    assert log.progress == 1.0
    if path.name == "rav4_highway.blf":
        assert count == 135_468
        assert log.start_utc == 1533224087.0  # 2018-08-02 15:34:47 UTC
        assert {frame.bus for frame in log} == {0, 1}


def test_large_logs_span_containers(tmp_path: Path) -> None:
    """20,000 frames fill many containers and come back whole; the bytes are the same each time."""
    frames = [Frame(i * 500_000 * 1e-9, i % 3, i % 2048, i.to_bytes(8, "big")) for i in range(20_000)]
    write_log(tmp_path / "a.blf", frames, 1.6e9)
    write_log(tmp_path / "b.blf", frames, 1.6e9)
    assert list(open_log(tmp_path / "a.blf")) == frames
    assert (tmp_path / "a.blf").read_bytes() == (tmp_path / "b.blf").read_bytes()
    with python_can.load().BLFReader(str(tmp_path / "a.blf")) as reader:
        assert sum(1 for _ in reader) == reader.object_count == 20_000
        assert reader.file_size == (tmp_path / "a.blf").stat().st_size
        assert abs(reader.stop_timestamp - (1.6e9 + 9.9995)) <= 1e-3


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    """Writing over a log is refused."""
    path = tmp_path / "x.blf"
    write_log(path, [Frame(0.0, 0, 1, b"")])
    before = path.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        write_log(path, [Frame(0.0, 0, 2, b"")])
    assert path.read_bytes() == before


def test_after_each_checkpoint_the_file_is_complete(tmp_path: Path) -> None:
    """A copy made after any checkpoint reads undamaged, with start and counts, also by python-can."""
    path = tmp_path / "x.blf"
    writer = BlfWriter(path, 1_600_000_000_123_456_789)
    assert open_log(path).damage is None  # from the very beginning
    frames = [Frame(i * 1e6 * 1e-9, 0, i, b"\x01") for i in range(100)]
    for i, frame in enumerate(frames, 1):
        writer.append(frame)
        if i % 10 == 0:
            writer.checkpoint(sync=False)
            log = open_log(path)
            assert list(log) == frames[:i]
            assert log.damage is None
            assert abs(log.start_utc - 1_600_000_000.123456789) < 2e-7
            with python_can.load().BLFReader(str(path)) as reader:
                assert [m.arbitration_id for m in reader] == list(range(i))
                assert reader.object_count == i
    writer.close()


def test_more_data_than_a_frame_carries_is_a_wrong_call(tmp_path: Path) -> None:
    """Nine bytes in a classic frame raise ValueError instead of losing one."""
    with closing(BlfWriter(tmp_path / "x.blf")) as writer, pytest.raises(ValueError, match="9 bytes"):
        writer.append(Frame(0.0, 0, 1, bytes(9)))


def classic_object(ns: int, id_: int) -> bytes:
    """An object of type 1, version 1 (docs/formats/blf.md)."""
    head = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, ns)
    return head + struct.pack("<HBBL8s", 1, 0, 2, id_, b"\x01\x02")


def blf_of(objects: list[bytes], compression: int) -> bytes:
    """A file of one container."""
    inner = b"".join(objects)
    body = struct.pack("<H6xL4x", compression, len(inner)) + (zlib.compress(inner) if compression else inner)
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body + bytes(len(body) % 4)
    sizes = struct.pack("<QQLL", 144 + len(container), 144 + len(inner) + 32, len(objects), 0)
    return b"LOGG" + struct.pack("<L8x", 144) + sizes + bytes(144 - 40) + container


@pytest.mark.parametrize("compression", [0, 2])
@pytest.mark.parametrize("seed", range(4))
def test_an_id_without_its_mark_has_29_bits(tmp_path: Path, compression: int, seed: int) -> None:
    """Some writers leave out bit 31 of ids of 29 bits. Without a checksum one such id alone is damage."""
    rng = random.Random(seed)
    unmarked = rng.randrange(0x800, 1 << 29)
    alone = rng.choice([n for n in (0x800, 0x12345, 0x1FFFFFFF) if n != unmarked])
    ids = [rng.randrange(0x800) for _ in range(20)] + [unmarked] * rng.randrange(2, 9)
    rng.shuffle(ids)
    written = tmp_path / "unmarked.blf"
    written.write_bytes(blf_of([classic_object(1_000_000 * k, n) for k, n in enumerate(ids)], compression))
    log = open_log(written)
    assert [(frame.id, bool(frame.flags & Flag.EXTENDED)) for frame in log] == [(n, n >= 0x800) for n in ids]
    assert log.damage is None
    written.write_bytes(
        blf_of([classic_object(1_000_000 * k, n) for k, n in enumerate([*ids, alone])], compression)
    )
    log = open_log(written)
    assert (alone in {frame.id for frame in log}) == bool(compression)
    assert (log.damage is None) == bool(compression)


def test_a_file_that_grows_between_its_size_and_its_header_is_undamaged(tmp_path: Path) -> None:
    """A recorder appends a container, then writes the header that counts it; a reader may have asked for the size before."""
    log = tmp_path / "growing.blf"
    writer = BlfWriter(log, 0)
    frames = [Frame(0.01 * k, 0, 0x100, b"ab") for k in range(20)]
    writer.append_columns(columns_of(frames[:10]))
    writer.checkpoint()
    state = ReadState(size=log.stat().st_size)
    writer.append_columns(columns_of(frames[10:]))
    writer.checkpoint()
    assert sum(len(chunk.t) for chunk in read_blf(log, state)) == 20
    assert state.damage is None
    assert state.size == log.stat().st_size
    writer.close()
