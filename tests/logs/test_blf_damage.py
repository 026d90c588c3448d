"""DamagedSpans .blf files: nothing hangs, nothing is invented, at most the bad container is lost."""

from __future__ import annotations

import random
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

from canid.io.logs import open_log, write_log
from canid.values.errors import ConfigError, LogError
from canid.values.types import Frame

COUNT = 9_000
# frames of 48 bytes in a container of 128 kB
PER_CONTAINER = 128 * 1024 // 48


def original() -> list[Frame]:
    rng = random.Random(1)
    return [Frame(i * 500_000 * 1e-9, i % 2, i % 2048, rng.randbytes(rng.randrange(9))) for i in range(COUNT)]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("damage") / "whole.blf"
    write_log(path, original(), 1.6e9)
    return path.read_bytes()


def container(data: bytes, method: int = 2, declared: int | None = None) -> bytes:
    packed = zlib.compress(data, 1) if method == 2 else data
    size = 32 + len(packed)
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10)
    return (
        head
        + struct.pack("<H6xL4x", method, len(data) if declared is None else declared)
        + packed
        + bytes(size % 4)
    )


def obj(size: int = 48, kind: int = 1, header: int = 32, version: int = 1, ns: int = 0) -> bytes:
    head = struct.pack("<4sHHLL", b"LOBJ", header, version, size, kind) + struct.pack("<LHHQ", 2, 0, 0, ns)
    return head + struct.pack("<HBBL8s", 1, 0, 8, 0x123, b"12345678")


def absolute(path: Path) -> tuple[list[tuple[int, int, int, bytes]], object]:
    """(µs of the epoch, bus, id, data) of each frame, and the damage."""
    log = open_log(path)
    frames = list(log)
    return [(round((log.start_utc + f.t) * 1e6), f.bus, f.id, f.data) for f in frames], log.damage


def is_subsequence(part: list[tuple[int, int, int, bytes]], whole: list[tuple[int, int, int, bytes]]) -> bool:
    rest = iter(whole)
    return all(item in rest for item in part)


def mutants(data: bytes, n: int) -> list[tuple[str, bytes]]:
    rng = random.Random(2)
    out = []
    for _ in range(n):
        at = rng.randrange(len(data))
        out.append((f"truncated at {at}", data[:at]))
        # bits of the start time are spared: they change what is written, not what can be read
        at = rng.randrange(72, len(data))
        flipped = bytearray(data)
        flipped[at] ^= 1 << rng.randrange(8)
        out.append((f"bit flipped in byte {at}", bytes(flipped)))
        at, size = rng.randrange(72, len(data)), rng.choice((4, 16, 512, 4096, 40_000))
        out.append(
            (f"{size} zeros at {at}", data[:at] + bytes(min(size, len(data) - at)) + data[at + size :])
        )
        at = rng.randrange(72, len(data))
        out.append((f"{size} bytes missing at {at}", data[:at] + data[at + size :]))
        at = rng.randrange(72, len(data))
        out.append((f"garbage at {at}", data[:at] + rng.randbytes(size) + data[at:]))
    return out


@pytest.mark.slow("many logs, written and read")
def test_mutants_lose_at_most_the_bad_containers_and_invent_nothing(written: bytes, tmp_path: Path) -> None:
    """300 mutants: nothing raises but LogError, every frame is an original, the loss is bounded and reported."""
    whole = [(round((1.6e9 + f.t) * 1e6), f.bus, f.id, f.data) for f in original()]
    path = tmp_path / "mutant.blf"
    for what, data in mutants(written, 60):
        path.write_bytes(data)
        try:
            got, damage = absolute(path)
        except LogError as error:
            assert len(data) < 144, (what, error)  # noqa: PT017  (only without a header is nothing readable)
            continue
        assert is_subsequence(got, whole), what
        if len(got) < COUNT:
            assert damage is not None, what
            assert str(len(got)) in damage.says, what
        if what.startswith(("bit", "garbage")):
            assert len(got) >= COUNT - PER_CONTAINER, what
        if "zeros" in what:
            size = int(what.split()[0])
            # as many containers as the block can touch (one holds some 30 kB of these random data)
            assert len(got) >= COUNT - PER_CONTAINER * (2 + size // 25_000), what


def test_damage_says_how_many_of_how_many(written: bytes, tmp_path: Path) -> None:
    """One flipped bit: "read N of M objects", the place, and N and M as numbers."""
    data = bytearray(written)
    data[len(data) // 2] ^= 4
    path = tmp_path / "x.blf"
    path.write_bytes(data)
    log = open_log(path)
    assert log.damage is None  # nothing is known before the end
    n = len(list(log))
    assert log.damage is not None
    assert (log.damage.read, log.damage.total) == (n, COUNT)
    assert COUNT - PER_CONTAINER <= n < COUNT
    assert log.damage.says.startswith(f"read {n} of {COUNT} objects, bytes ")
    ((first, last),) = log.damage.spans
    assert first <= len(data) // 2 <= last
    assert f"bytes {first}–{last} damaged" in log.damage.says
    assert "\n" not in log.damage.says


def header(data: bytes, count: int = 0) -> bytes:
    start = (2020, 1, 3, 1, 0, 0, 0, 0)
    fixed = struct.pack(
        "<4sL8BQQLL8H8H", b"LOGG", 144, *(0,) * 8, 144 + len(data), 144, count, 0, *start, *start
    )
    return fixed.ljust(144, b"\0")


CRAFTED = {
    "object of size 0": container(obj() + obj(size=0) + obj()) + container(obj(ns=5)),
    "object of size 15": container(obj(size=15)) + container(obj(ns=5)),
    "object of 4 GB": container(obj() + obj(size=0xFFFFFFFF)) + container(obj(ns=5)),
    "too short for a frame": container(obj(size=40)) + container(obj(ns=5)),
    "unknown header version": container(obj(version=7)) + container(obj(ns=5)),
    "container of size 0": container(b"")[:8] + bytes(4) + container(b"")[12:] + container(obj(ns=5)),
    "container that claims 4 GB": container(obj(), declared=0xFFFFFFFF, method=0) + container(obj(ns=5)),
    "unknown compression": container(obj(), method=9) + container(obj(ns=5)),
    "container with another type": container(obj())[:12]
    + b"\x0b"
    + container(obj())[13:]
    + container(obj(ns=5)),
    "zip bomb": container(bytes(200_000_000)) + container(obj(ns=5)),
    "no structure inside": container(b"A" * 100_000) + container(obj(ns=5)),
}


@pytest.mark.parametrize("name", CRAFTED)
def test_crafted_nonsense_costs_its_container_only(name: str, tmp_path: Path) -> None:
    """Each nonsense is reported, the good container behind it is read, memory stays small."""
    path = tmp_path / "x.blf"
    path.write_bytes(header(CRAFTED[name], 3) + CRAFTED[name])
    log = open_log(path)
    frames = list(log)
    if name == "container of size 0":  # its data are whole: nothing is lost
        assert len(frames) == 1
        assert log.damage is not None  # and yet it is reported
        assert "claims a size of 0 bytes, it has" in log.damage.says
    elif name == "unknown header version":  # skipped as an unknown object, or dropped: never a frame
        assert len(frames) == 1
    else:
        assert [(frame.id, frame.data) for frame in frames] == [(0x123, b"12345678")]
        assert log.damage is not None


@pytest.mark.long("many or long logs")
def test_a_zip_bomb_needs_no_memory(tmp_path: Path) -> None:
    """200 MB of zeros, 16 times over in one file: the reading process stays below 512 MB."""
    path = tmp_path / "x.blf"
    path.write_bytes(header(b"") + CRAFTED["zip bomb"] * 16)
    code = (
        "import re, sys\n"
        "from canid.io.logs import open_log\n"
        "log = open_log(sys.argv[1])\n"
        "assert len(list(log)) == 16 and log.damage\n"
        # ru_maxrss begins with what the process that started this one had
        "assert int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) < 512 * 1024\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, timeout=600)


def test_unknown_objects_are_passed_over(tmp_path: Path) -> None:
    """An object of a type that is not CAN is counted but is no damage."""
    body = container(obj() + obj(kind=65) + obj(ns=7_000))
    path = tmp_path / "x.blf"
    path.write_bytes(header(body, 3) + body)
    log = open_log(path)
    assert [frame.t for frame in log] == [0.0, 7_000 * 1e-9]
    assert log.damage is None


def test_objects_cross_container_borders(tmp_path: Path) -> None:
    """Objects cut by a container's end come back whole; so do stored containers, bare objects, v2 headers."""
    v2 = struct.pack("<4sHHLL", b"LOBJ", 40, 2, 56, 86) + struct.pack("<LBxHQ8x", 1, 0, 0, 3) + obj()[32:]
    row = b"".join(obj(ns=i * 1000) for i in range(50)) + v2
    expected = [i * 1000 * 1e-9 for i in range(50)] + [30_000 * 1e-9]
    path = tmp_path / "x.blf"
    for step in (1, 7, 16, 47, 48, 49, 1000):
        parts = [row[i : i + step] for i in range(0, len(row), step)]
        for method in (0, 2):
            body = b"".join(container(part, method=method) for part in parts)
            path.write_bytes(header(body) + body)
            log = open_log(path)
            assert [frame.t for frame in log] == expected, (step, method)
            assert log.damage is None, (step, method)
    path.write_bytes(header(row) + row)
    assert [frame.t for frame in open_log(path)] == expected


@pytest.mark.parametrize(
    ("name", "content", "error", "says"),
    [
        ("x.blf", b"", LogError, "is empty"),
        ("x.blf", b"no blf at all" * 100, LogError, "not a BLF log"),
        ("x.blf", b"LOGG\x90\0\0\0", LogError, "cut off in its header"),
        ("x.xyz", b"abc", ConfigError, "unknown log format"),
        ("x", b"abc", ConfigError, "unknown log format"),
        ("missing.blf", None, ConfigError, "no such log"),
    ],
)
def test_what_is_no_log_is_one_line(
    name: str, content: bytes | None, error: type[Exception], says: str, tmp_path: Path
) -> None:
    """Each hopeless file raises its error with one line that names the file."""
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(error, match=says) as caught:
        list(open_log(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    """A folder raises LogError, whatever its name."""
    (tmp_path / "x.blf").mkdir()
    with pytest.raises(LogError, match="folder"):
        open_log(tmp_path / "x.blf")
