"""Names from files are data: none of them reaches a terminal as anything but visible text."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from canid.values.shipped_files import shipped

ROOT = Path(__file__).parents[2]
# clear the screen, set the title, a directional override, C1's CSI, a forged line, rich's own markup
EVIL = "\x1b[2J\x1b]0;owned\x07\u202e\x9b31m\ncanid: all is well [/] [bold]"
UNSAFE = {*map(chr, [*range(0x09), 0x0B, 0x0C, *range(0x0E, 0x20), *range(0x7F, 0xA0)]), "\u202e", "\u2028"}


@pytest.fixture
def hostile(log: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A vehicle and a log with hostile names."""
    folder = tmp_path / f"dir{EVIL.replace('/', '')}"
    folder.mkdir()
    text = (shipped() / "generic.toml").read_text()
    name = json.dumps("Car" + EVIL)  # TOML's basic strings have JSON's escapes
    lines = [line for line in text.splitlines() if not line.startswith("name =")]
    vehicle = folder / "car.toml"
    vehicle.write_text("\n".join([f"name = {name}".replace("\x7f", ""), *lines]))
    shutil.copy(shipped() / "generic.dbc", folder / "generic.dbc")
    drive = folder / f"drive{EVIL.replace('/', '')}.blf"
    shutil.copy(log, drive)
    return vehicle, drive


def run(words: list[str], cwd: Path) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))",
            *words,
        ],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        timeout=600,
        check=False,
    )


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(
    "verb", ["identify", "replay", "check", "diagnose", "recover", "export", "init", "wrong"]
)
def test_no_name_of_a_file_acts_on_the_terminal(
    verb: str, hostile: tuple[Path, Path], tmp_path: Path
) -> None:
    """Both standard streams of each verb, with a hostile vehicle name, log name and folder: printable lines only."""
    vehicle, drive = hostile
    words = {
        "recover": [str(drive), "-o", str(tmp_path / f"copy{EVIL.replace('/', '')}.blf")],
        "init": [str(vehicle.with_name("generic.dbc"))],
        "wrong": [str(drive)],
        "check": [str(drive), "--vehicle", str(vehicle)],
    }.get(verb, [str(drive), "--vehicle", str(vehicle), "--stop", "3"])
    ran = run([f"no{EVIL}" if verb == "wrong" else verb, *words], tmp_path)
    for stream in (ran.stdout, ran.stderr):
        text = stream.decode("utf-8")
        assert not set(text) & UNSAFE, text
        assert not any(line.startswith("canid: all is well") for line in text.splitlines())
    assert b"Traceback" not in ran.stderr


@pytest.mark.slow("whole commands, one after the other")
def test_json_keeps_names_as_they_are(hostile: tuple[Path, Path], tmp_path: Path) -> None:
    """What is escaped for a terminal is not for a program."""
    vehicle, drive = hostile
    ran = run(["identify", str(drive), "--vehicle", str(vehicle), "--stop", "3", "--json", "-"], tmp_path)
    result = json.loads(ran.stdout)
    assert (result["log"], result["vehicle"]) == (str(drive), "Car" + EVIL)


@pytest.mark.slow("whole commands, one after the other")
def test_a_name_that_is_no_text_can_be_said(log: Path, tmp_path: Path) -> None:
    """A file name whose bytes are no UTF-8: shown as an escape, in JSON too; no traceback."""
    drive = os.fsencode(tmp_path) + b"/drive\xff\x1b.blf"
    shutil.copy(log, os.fsdecode(drive))
    ran = run(
        ["identify", os.fsdecode(drive), "--vehicle", "generic", "--stop", "3", "--json", "a.json"], tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    assert b"\x1b" not in ran.stdout
    assert json.loads((tmp_path / "a.json").read_text())["log"] == os.fsdecode(drive)


@pytest.mark.slow("whole commands, one after the other")
def test_the_live_view_of_a_terminal_holds_no_foreign_sequence(
    hostile: tuple[Path, Path], tmp_path: Path
) -> None:
    """`canid replay` on a real pseudo-terminal: rich's own sequences are there, those of the names are not."""
    vehicle, drive = hostile
    reader, writer = pty.openpty()
    got = bytearray()

    def read() -> None:
        try:
            while data := os.read(reader, 65536):
                got.extend(data)
        except OSError:
            pass

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    code = "import sys; from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    words = ["replay", str(drive), "--vehicle", str(vehicle), "--stop", "20"]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdin=writer,
        stdout=writer,
        stderr=writer,
        env=os.environ | {"PYTHONPATH": str(ROOT), "TERM": "xterm-256color", "OMP_NUM_THREADS": "1"},
        start_new_session=True,
    )
    assert process.wait(600.0) == 0
    os.close(writer)
    time.sleep(0.5)
    text = got.decode("utf-8", "replace")
    assert "\x1b[" in text
    assert "\x1b[2J" not in text
    assert "\x1b]0" not in text
    assert not set(text) & {"\x07", "\x9b", "\u202e"}
    os.close(reader)
