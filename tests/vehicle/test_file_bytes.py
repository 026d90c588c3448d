"""Whatever a name of a configuration file or a log leads to, it is read or refused in one line, and never waited for."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from canid.io.logs.input_file import regular_file
from canid.signals.vehicle import file_bytes
from canid.ui.cli import main
from canid.values.errors import ConfigError, LogError

KERNEL = (
    "/proc/kmsg",
    "/proc/self/mem",
    "/proc/self/pagemap",
    "/proc/self/environ",
    "/proc/self/attr/current",
)
OTHERS = (
    "/dev/zero",
    "/dev/full",
    "/dev/tty",
    "/proc/self/task",
    "/proc/self/fd/0/x",
    "/sys/kernel/mm",
    "a\0b",
    "x" * 300,
)


@pytest.mark.parametrize("name", [*KERNEL, *OTHERS])
def test_what_is_no_file_is_one_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Files of the kernel, which may wait for an event that nobody asked for, devices, folders, impossible names."""
    for read in (lambda: file_bytes.read(Path(name), 1000, "DBC file"), lambda: regular_file(Path(name))):
        with pytest.raises((ConfigError, LogError)) as caught:
            read()
        assert "\n" not in str(caught.value)
    if "\0" not in name:
        assert main(["init", name + ".dbc" if name in OTHERS[-1:] else name]) == 2
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1
        assert "Traceback" not in said


def test_a_link_to_a_file_of_the_kernel_is_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Under the name of every text format, of a table, and of a database that a vehicle file has."""
    for suffix in (".log", ".asc", ".csv", ".trc", ".mf4", ".blf", ".parquet", ".dbc"):
        path = tmp_path / f"x{suffix}"
        path.symlink_to("/proc/kmsg")
        assert main(["init" if suffix == ".dbc" else "check", str(path)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    vehicle = tmp_path / "v.toml"
    vehicle.write_text('dbc = "x.dbc"\n[signals]\nspeed = "A.b"\n', encoding="utf-8")
    assert main(["check", "--vehicle", str(vehicle)]) == 2
    # who may not open it gets the reason of the system
    assert re.search("x.dbc is not a regular file|x.dbc cannot be read", capsys.readouterr().err)


def test_an_error_while_reading_is_one_line(tmp_path: Path) -> None:
    """Of any errno: the descriptor gives an error once it is open, as a file system may."""
    path = tmp_path / "x.dbc"
    path.write_bytes(b"x" * 100)
    handle = os.open(path, os.O_WRONLY)
    try:
        with pytest.raises(OSError, match="Bad file descriptor"):
            file_bytes._read(handle, 10)
    finally:
        os.close(handle)
    reading, writing = os.pipe2(os.O_NONBLOCK)
    try:
        with pytest.raises(BlockingIOError):
            file_bytes._read(reading, 10)
        os.write(writing, b"abc")
        with pytest.raises(BlockingIOError):
            file_bytes._read(reading, 10)
    finally:
        os.close(reading)
        os.close(writing)


def test_files_are_read_whole(tmp_path: Path) -> None:
    """Of every size up to the largest, and one byte more is refused."""
    path = tmp_path / "x"
    for size in (0, 1, 1 << 20, (1 << 20) + 1, 3_000_000):
        data = os.urandom(size)
        path.write_bytes(data)
        assert file_bytes.read(path, 3_000_000, "DBC file") == data
    with pytest.raises(ConfigError, match=r"has 3,000,000 bytes; at most 2,999,999 are read"):
        file_bytes.read(path, 2_999_999, "DBC file")
