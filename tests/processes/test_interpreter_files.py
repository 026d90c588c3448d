"""The files that start a child process are found by what the kernel reads of them."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from canid.values.processes import interpreter_files

needs_elf = pytest.mark.skipif(
    sys.platform != "linux" or sys.maxsize < 1 << 32 or sys.byteorder != "little", reason="of Linux, 64 bits"
)


@needs_elf
def test_the_interpreter_and_its_loader_are_found() -> None:
    """What /proc says that this process is, and the loader that it has mapped; each is there."""
    found = interpreter_files.executed()
    assert all(os.path.exists(path) for path in found)
    real = {os.path.realpath(path) for path in found}
    assert os.path.realpath("/proc/self/exe") in real
    assert os.path.realpath(sys.executable) in real
    mapped = {line.split()[-1] for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()}
    assert real <= {os.path.realpath(path) for path in mapped}


@needs_elf
def test_a_wrapper_names_what_it_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scripts of scripts, to the program and its loader; a script that starts itself ends."""
    inner, outer, loop = tmp_path / "inner", tmp_path / "outer", tmp_path / "loop"
    inner.write_text("#!/bin/sh -e\nexec true\n", encoding="ascii")
    outer.write_text(f"#! {inner} x\n", encoding="ascii")
    loop.write_text(f"#!{loop}\n", encoding="ascii")
    for path in (inner, outer, loop):
        path.chmod(0o755)
    assert subprocess.run([outer], check=False).returncode == 0
    monkeypatch.setattr(sys, "executable", str(outer))
    found = interpreter_files.executed()
    assert found[:3] == (str(outer), str(inner), "/bin/sh")
    assert os.path.realpath("/proc/self/exe") in {os.path.realpath(path) for path in found}
    monkeypatch.setattr(sys, "executable", str(loop))
    assert interpreter_files.executed()[0] == str(loop)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"#!",
        b"#!\n",
        b"\x7fELF",
        b"\x7fELF\x02\x01" + bytes(60),
        # headers that begin beyond the file, of no size, and a loader whose name is not there
        b"\x7fELF\x02\x01" + bytes(26) + struct.pack("<Q", 1 << 40) + bytes(14) + struct.pack("<HH", 56, 9) + bytes(99),
        b"\x7fELF\x02\x01" + bytes(26) + struct.pack("<Q", 64) + bytes(14) + struct.pack("<HH", 0, 9) + bytes(99),
        b"\x7fELF\x02\x01" + bytes(26) + struct.pack("<Q", 64) + bytes(14) + struct.pack("<HH", 56, 1) + bytes(6)
        + struct.pack("<II4Q", 3, 0, 1 << 40, 0, 0, 9) + bytes(16),
    ],
)  # fmt: skip
def test_what_is_no_program_starts_nothing_else(
    content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Damaged, empty or missing: the file alone, and no exception."""
    path = tmp_path / "python"
    path.write_bytes(content)
    monkeypatch.setattr(sys, "executable", str(path))
    assert interpreter_files.executed()[0] == str(path)
    assert str(path) not in interpreter_files.executed()[1:]
    path.unlink()
    assert interpreter_files.executed()
