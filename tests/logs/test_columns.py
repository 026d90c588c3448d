"""The columns of a log are its frames: against python-can, against can-utils and asammdf, and against themselves."""

from __future__ import annotations

import pickle
import random
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.buses import messages, python_can
from canid.io.logs import open_log, write_log
from canid.values.errors import LogError
from canid.values.frame_columns import columns_of, frames_of, gather
from canid.values.types import Flag, Frame
from tests.fixtures.measured_logs import MEASURED, MISSING
from tests.logs.drawn_logs import ALL, START, drive, read
from tests.logs.samples import write_with_python_can


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    n=st.integers(1, 60),
    kinds=st.lists(st.sampled_from(ALL), min_size=1, max_size=3),
    suffix=st.sampled_from((".blf", ".asc", ".log")),
)
def test_what_is_written_comes_back(
    seed: int, n: int, kinds: list[str], suffix: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any mix of frames: columns give them back, and one by one they are the same."""
    path = tmp_path_factory.mktemp("columns") / f"x{suffix}"
    frames = drive(seed, n, tuple(kinds))
    write_log(path, frames, START)
    got = read(path)
    assert got == list(open_log(path))
    key = (lambda f: f._replace(t=round(f.t * 1e6))) if suffix != ".blf" else (lambda f: f)
    assert [key(f) for f in got] == [key(f) for f in frames]


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
@pytest.mark.parametrize("kinds", [("classic",), ALL], ids=["classic", "mixed"])
def test_python_can_says_the_same_of_its_own_files(
    suffix: str, kinds: tuple[str, ...], tmp_path: Path
) -> None:
    """Logs by python-can's writers, several containers and blocks: each message that its reader finds, in order."""
    path = tmp_path / f"x{suffix}"
    can = python_can.load()
    with can.Logger(str(path)) as writer:
        for one in drive(5, 9_000, kinds):
            writer.on_message_received(messages.message_of(one, START))
    with getattr(can, {".blf": "BLFReader", ".asc": "ASCReader"}[suffix])(str(path)) as reader:
        theirs = list(reader)
    got = read(path)
    assert len(got) == len(theirs) == 9_000
    zero = theirs[0].timestamp
    for ours, message in zip(got, theirs, strict=True):
        length = message.dlc if message.is_remote_frame else -1
        expected = Frame(
            message.timestamp,
            message.channel,
            message.arbitration_id,
            bytes(message.data),
            messages.flags_of(message),
            length,
        )
        if message.is_fd and suffix == ".asc" and not message.data:
            # for its .asc reader every CAN FD frame without data is a remote one, which CAN FD does not have
            expected = expected._replace(flags=expected.flags & ~int(Flag.REMOTE))
        # python-can keeps no direction of error frames
        if message.is_error_frame:
            assert ours.flags & Flag.ERROR
        else:
            assert (ours.id, ours.data, ours.flags) == (expected.id, expected.data, expected.flags)
            assert ours.bus == message.channel
        assert abs(ours.t - (message.timestamp - zero)) < 1e-6


@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("log", ["rav4/rav4_highway.blf", "openacc/human_h22_v3.blf"])
def test_measured_logs_are_what_python_can_reads(log: str) -> None:
    """Every frame of a real log: id, bus, data, direction, time."""
    path = MEASURED / log
    if not path.exists():
        pytest.skip(MISSING)
    got = read(path)
    with python_can.load().BLFReader(str(path)) as reader:
        zero = None
        for ours, message in zip(got, reader, strict=True):
            zero = message.timestamp if zero is None else zero
            assert (ours.id, ours.bus, ours.data) == (
                message.arbitration_id,
                message.channel,
                bytes(message.data),
            )
            assert bool(ours.flags & Flag.TX) != message.is_rx
            assert abs(ours.t - (message.timestamp - zero)) < 1e-6


@pytest.mark.parametrize("level", [-1, 0, 9])
def test_any_compression(level: int, tmp_path: Path) -> None:
    """Containers that are stored, or packed at any level."""
    path = tmp_path / "x.blf"
    frames = drive(6, 4_000)
    with python_can.load().BLFWriter(str(path), compression_level=level) as writer:
        for one in frames:
            writer.on_message_received(messages.message_of(one, START))
    got = read(path)
    assert [(f.id, f.data) for f in got] == [(f.id, f.data) for f in frames]


def head(kind: int, body: bytes, ns: int, version: int = 1) -> bytes:
    size = 32 + 8 * (version == 2)
    stamp = struct.pack("<LHHQ", 2, 0, 0, ns) + bytes(8 * (version == 2))
    return struct.pack("<4sHHLL", b"LOBJ", size, version, size + len(body), kind) + stamp + body


def blf(objects: list[bytes], per_container: int, cut: int) -> bytes:
    """A file of these objects, padded as the format does, in containers that end `cut` bytes off an object's end."""
    row = b"".join(one + bytes(len(one) % 4) for one in objects)
    out = struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0")
    edges = [*range(per_container + cut, len(row), per_container), len(row)]
    begin = 0
    for end in edges:
        packed = zlib.compress(row[begin:end])
        size = 32 + len(packed)
        out += (
            struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, 2, end - begin) + packed + bytes(size % 4)
        )
        begin = end
    return out


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), n=st.integers(1, 80), per=st.integers(60, 3000), cut=st.integers(-30, 30))
def test_objects_of_all_kinds_and_sizes(
    seed: int, n: int, per: int, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Objects of odd sizes, of other types, with longer headers, with signatures in their data, across containers."""
    rng = random.Random(seed)
    objects: list[bytes] = []
    expected: list[tuple[int, bytes, int]] = []
    for k in range(n):
        data = rng.choice((rng.randbytes(8), b"LOBJ\x20\0\1\0", b"xxLOBJxx"))
        version = rng.choice((1, 1, 2))
        kind = rng.choice((1, 86, 100, 101, 65, 73))
        if kind in (1, 86):
            objects.append(head(kind, struct.pack("<HBBL8s", 1, 0, 8, k, data), k, version))
            expected.append((k, data, 0))
        elif kind == 100:
            body = struct.pack("<HBBLLBBB5x64s", 2, 1, 10, k, 0, 0, 3, 16, data * 2)
            objects.append(head(kind, body, k, version))
            expected.append((k, data * 2, int(Flag.FD | Flag.BRS | Flag.TX)))
        elif kind == 101:
            logged = rng.randrange(17)  # CANoe leaves zeros at the end out
            payload = (data * 2)[:logged]
            body = (
                struct.pack("<BBBBLLLLLLLHBBL", 1, 10, 16, 0, k, 0, 0x1000, 0, 0, 0, 0, 0, 0, 0, 0) + payload
            )
            objects.append(head(kind, body, k, version))
            expected.append((k, payload.ljust(16, b"\0"), int(Flag.FD)))
        elif kind == 65:  # something else, of any length, that may have the form of objects
            objects.append(head(kind, (b"LOBJ" * 30)[: rng.randrange(90)], k))
        else:
            body = struct.pack("<HHLBBBxLLH2x8s", 1, 0, 0, 0, 0, 2, 0, k, 0, b"ab")
            objects.append(head(kind, body, k, version))
            expected.append((k, b"ab", int(Flag.ERROR)))
    path = tmp_path_factory.mktemp("objects") / "x.blf"
    path.write_bytes(blf(objects, per, cut))
    assert [(f.id, f.data, f.flags) for f in read(path)] == expected


@pytest.mark.slow("many logs, written and read")
def test_damage_costs_the_same_read_together_or_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Containers are walked many at a time; what is bad in one is found, lost and reported as if each stood alone."""
    from canid.io.logs.blf import blf_reader

    path = tmp_path / "x.blf"
    write_log(path, drive(7, 20_000), START)
    whole = path.read_bytes()
    rng = random.Random(8)
    for k in range(40):
        data = bytearray(whole)
        at = rng.randrange(144, len(data))
        data[at : at + rng.choice((1, 30, 5000))] = rng.randbytes(rng.choice((1, 30, 5000)))
        path.write_bytes(data)
        found = []
        for batch in (1, 1 << 30):
            monkeypatch.setattr(blf_reader, "BATCH_BYTES", batch)
            log = open_log(path)
            found.append(
                (
                    [list(column) for chunk in log.columns() for column in zip(*chunk[:5], strict=True)],
                    log.damage,
                )
            )
        assert found[0] == found[1], k


@pytest.mark.slow("many logs, written and read")
def test_wanted_ids_are_all_there(tmp_path: Path) -> None:
    """Asked for some ids, a log gives each frame of theirs, at the same time; and few others."""
    frames = drive(9, 30_000)
    for suffix in (".blf", ".asc", ".log"):
        path = tmp_path / f"x{suffix}"
        write_log(path, frames, START)
        every = read(path)
        for ids in ({5}, {f.id for f in frames[:40]}):
            got = [f for chunk in open_log(path).columns(ids) for f in frames_of(chunk)]
            assert [f for f in got if f.id in ids] == [f for f in every if f.id in ids]
            assert len(got) < len(every) or suffix == ".log"


# --- .asc ------------------------------------------------------------------------------------------


@pytest.mark.slow("many logs, written and read")
def test_mf4_columns_are_asammdfs(tmp_path: Path) -> None:
    """An .mf4 by asammdf's writer: ids, data and times as asammdf itself returns them."""
    pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")
    path = tmp_path / "x.mf4"
    frames = drive(12, 60, ("classic",))
    code = (
        "import sys, pickle, asammdf, warnings\nwarnings.simplefilter('ignore')\n"
        "import can\nfrom canid.io.buses.messages import message_of\n"
        "frames = pickle.load(sys.stdin.buffer)\n"
        "with can.Logger(sys.argv[1]) as writer:\n"
        "    for frame in frames: writer.on_message_received(message_of(frame, 1.6e9))\n"
        "with asammdf.MDF(sys.argv[1]) as log:\n"
        "    ids = log.get('CAN_DataFrame.ID', raw=True) if 'CAN_DataFrame.ID' in log else log.get('ID')\n"
        "    data = log.get('CAN_DataFrame.DataBytes', raw=True)\n"
        "    pickle.dump((ids.samples.tolist(), data.samples.tolist(), ids.timestamps.tolist()), sys.stdout.buffer)\n"
    )

    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(path)],
        input=pickle.dumps(frames),
        capture_output=True,
        check=True,
        timeout=600,
    )
    ids, data, t = pickle.loads(done.stdout)
    got = read(path)
    assert [f.id for f in got] == [id_ & 0x1FFFFFFF for id_ in ids]
    assert [f.data for f in got] == [bytes(row)[: len(f.data)] for row, f in zip(data, got, strict=True)]
    assert [f.data for f in got] == [f.data for f in frames]
    assert np.allclose([f.t for f in got], np.array(t) - t[0], atol=2e-6)


@pytest.mark.parametrize("suffix", [".log", ".csv", ".trc"])
def test_other_formats_come_as_columns_too(suffix: str, tmp_path: Path) -> None:
    """Formats that are read frame by frame give the same columns."""
    path = tmp_path / f"x{suffix}"
    write_with_python_can(path, (one._replace(bus=0) for one in drive(13, 300, ("classic",))), START)
    assert read(path) == list(open_log(path))


def test_absurd_numbers_are_damage(tmp_path: Path) -> None:
    """Numbers that no frame can have, in any text format: the line is bad, and columns come all the same."""
    texts = {
        ".asc": b"base hex\n0.1 1 123 Rx d 0\n0.2 99999999999 123 Rx d 0\n99999999999999999999.5 1 123 Rx d 0\n",
        ".csv": b"1.0,0x1,0,0,0,0,\n1.1,0xFFFFFFFFFFFF,0,0,0,0,\n1.2,0x1,0,1,0,99999,\n",
        ".log": b"(1.0) can0 123#11\n(1.1) can0 123#R99999999\n",
    }
    for suffix, text in texts.items():
        path = tmp_path / f"x{suffix}"
        path.write_bytes(text)
        log = open_log(path)
        assert sum(len(chunk.t) for chunk in log.columns()) == 1, suffix
        assert log.damage is not None
    path = tmp_path / "y.asc"
    path.write_bytes(texts[".asc"].splitlines()[2])
    with pytest.raises(LogError):
        open_log(path)


def test_columns_and_frames_are_each_other() -> None:
    """There and back, in chunks of any size."""
    frames = drive(14, 500)
    for size in (1, 33, 500):
        parts = [columns_of(frames[k : k + size]) for k in range(0, 500, size)]
        assert [f for chunk in gather(parts, 100) for f in frames_of(chunk)] == frames


def test_damage_among_objects_without_containers_costs_one(tmp_path: Path) -> None:
    """Objects that stand in the file itself are read many at a time; a bad one is lost alone, and reported."""
    objects = [
        head(1, struct.pack("<HBBL8s", 1, 0, 8, k | 1 << 31, bytes(8)), 1000 * k) for k in range(5_000)
    ]
    body = struct.pack("<HBBLLBBB5x64s", 1, 0, 15, 7, 0, 0, 1, 99, bytes(64))  # claims 99 bytes
    objects[2_500] = head(100, body, 0)
    path = tmp_path / "x.blf"
    path.write_bytes(struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0") + b"".join(objects))
    log = open_log(path)
    assert [f.id for f in log] == [k for k in range(5_000) if k != 2_500]
    assert log.damage is not None
    assert "length" in log.damage.says
