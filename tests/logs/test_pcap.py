"""Captures cut at any byte, damaged in any, without CAN, or of CAN XL; frames before the damage are those of the whole."""

from __future__ import annotations

import gzip
import random
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.values.errors import CanidError, ConfigError, LogError
from canid.values.frame_columns import frames_of
from canid.values.types import Frame
from tests.fixtures.measured_logs import files
from tests.formats_oracle import pcap_files

HEADER = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 227)


def record(body: bytes, k: int = 0, original: int | None = None) -> bytes:
    return struct.pack("<4I", 1_600_000_000, k, len(body), len(body) if original is None else original) + body


def frame(id_: int, data: bytes, flags: int = 0) -> bytes:
    return struct.pack(">IBBH", id_, len(data), flags, 0) + data.ljust(8, b"\0")


def read(path: Path) -> tuple[list[Frame], str]:
    """The frames, and what is said of damage."""
    log = open_log(path)
    frames = [one for chunk in log.columns() for one in frames_of(chunk)]
    return frames, log.damage.says if log.damage else ""


@pytest.mark.parametrize("seed_of", range(6))
def test_a_cut_file_has_the_frames_before_the_cut(seed_of: int, tmp_path: Path, seed: int) -> None:
    """Damage is stated wherever a packet is cut, and no frame is another one."""
    rng = random.Random(f"{seed} {seed_of}")
    written = pcap_files.draw(rng)
    path = tmp_path / f"x{written.suffix}"
    path.write_bytes(written.content)
    whole = read(path)[0]
    for cut in sorted(rng.sample(range(len(written.content)), 40)):
        path.write_bytes(written.content[:cut])
        try:
            frames, _ = read(path)
        except LogError:
            continue
        # buses are numbered by the interfaces that are there
        assert [one._replace(bus=0) for one in frames] == [
            one._replace(bus=0) for one in whole[: len(frames)]
        ]


def test_a_cut_packet_is_damage(tmp_path: Path) -> None:
    """Exit 4, the place, and all packets before it."""
    path = tmp_path / "x.pcap"
    records = [record(frame(0x100 + k, bytes(8)), k) for k in range(5)]
    path.write_bytes(HEADER + b"".join(records)[:-3])
    words = [sys.executable, "-m", "canid", "look", str(path)]
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ran.returncode == 4
    assert "4 frames" in ran.stdout
    assert "read 4 packets, bytes 152–180 damaged: the file ends in a packet" in ran.stdout


@pytest.mark.long("many or long logs")
def test_a_changed_byte_costs_no_frame_before_it(tmp_path: Path, seed: int) -> None:
    """Whatever byte is changed, the frames in front of it stay, and nothing is raised but what the user is to read."""
    rng = random.Random(seed)
    for _ in range(150):
        written = pcap_files.draw(rng)
        path = tmp_path / f"x{written.suffix}"
        path.write_bytes(written.content)
        whole = read(path)[0]
        at = rng.randrange(len(written.content) // 2, len(written.content))
        changed = bytearray(written.content)
        changed[at] ^= 1 << rng.randrange(8)
        path.write_bytes(changed)
        try:
            frames, _ = read(path)
        except CanidError:
            continue
        share = len(whole) // 4
        assert [one._replace(bus=0) for one in frames[:share]] == [
            one._replace(bus=0) for one in whole[:share]
        ]


def test_packets_that_cannot_be_are_named_and_left_out(tmp_path: Path) -> None:
    """An id too large, more than 64 bytes, less data than announced: damage each, the packets around them are read."""
    path = tmp_path / "x.pcap"
    bodies = [
        frame(0x100, b"ab"),
        frame(0x800, b"ab"),  # 12 bits without the bit of 29
        struct.pack(">IBBH", 0x100, 65, 0, 0) + bytes(65),
        struct.pack(">IBBH", 0x100, 8, 0, 0) + bytes(5),
        struct.pack(">IBBH", 0x100 | 1 << 30, 12, 4, 0) + bytes(64),  # a remote frame of CAN FD
        b"abc",
        struct.pack(">IBBHI", 5, 0x81, 1, 3, 7) + b"abc",  # CAN XL
        frame(0x101, b"cd"),
    ]
    path.write_bytes(HEADER + b"".join(record(body, k) for k, body in enumerate(bodies)))
    log = open_log(path)
    frames = [one for chunk in log.columns() for one in frames_of(chunk)]
    assert [(one.id, one.data) for one in frames] == [(0x100, b"ab"), (0x101, b"cd")]
    assert log.damaged == 5
    assert log.damage is not None
    assert "an id is too large, and 4 more" in log.damage.says
    assert log.other_kinds == {"CAN XL frames": 1}


def test_a_capture_of_a_network_is_no_log(tmp_path: Path) -> None:
    """Ethernet, an empty capture, a compressed one, and text: each gets a sentence of its own."""
    path = tmp_path / "x.pcap"
    path.write_bytes(HEADER[:20] + struct.pack("<I", 1) + record(bytes(60)))
    with pytest.raises(ConfigError, match=r"without CAN frames \(1 packets of other protocols\)"):
        read(path)
    path.write_bytes(HEADER)
    assert read(path) == ([], "")
    path.write_bytes(gzip.compress(HEADER))
    with pytest.raises(LogError, match="gunzip"):
        read(path)
    path.write_bytes(b"(1.0) can0 123#00\n")
    with pytest.raises(LogError, match="is no capture"):
        read(path)
    path.write_bytes(HEADER[:10])
    with pytest.raises(LogError, match="ends in its header"):
        read(path)


def test_the_suffix_does_not_decide(tmp_path: Path) -> None:
    """Wireshark saves .pcapng under either name."""
    rng = random.Random(5)
    written = next(one for one in iter(lambda: pcap_files.draw(rng), None) if one.suffix == ".pcapng")
    path = tmp_path / "x.pcap"
    path.write_bytes(written.content)
    assert len(read(path)[0]) == len(written.frames)


def test_packets_without_a_time_wait_for_the_first_that_has_one(tmp_path: Path) -> None:
    """Simple packets in front get its time, as frames that an adapter does not stamp do in other logs."""
    out = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    out += struct.pack("<IIHHII", 1, 20, 227, 0, 0, 20)
    body = frame(0x123, b"ab")
    simple = struct.pack("<III", 3, 32, 16) + body + struct.pack("<I", 32)
    ticks = 1_600_000_000 * 10**6
    timed = (
        struct.pack("<7I", 6, 48, 0, ticks >> 32, ticks & 0xFFFFFFFF, 16, 16) + body + struct.pack("<I", 48)
    )
    path = tmp_path / "x.pcapng"
    path.write_bytes(out + simple * 3 + timed + simple)
    log = open_log(path)
    assert [one.t for chunk in log.columns() for one in frames_of(chunk)] == [0.0] * 5
    assert log.start_ns == 1_600_000_000 * 10**9


@pytest.mark.parametrize("file", files("reports/53-others/drive.pcap"), ids=str)
def test_a_reported_capture(file: Path) -> None:
    """600 frames of SocketCAN in 60 s."""
    frames, damage = read(file)
    assert (len(frames), damage, {one.id for one in frames}) == (600, "", {0x100})
    assert frames[-1].t == pytest.approx(59.9, abs=0.01)
