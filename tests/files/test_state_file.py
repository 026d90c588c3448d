"""Whatever kills whoever writes, the state file is whole: the old one or the new one."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canid.io.files import state_file
from canid.models.saving.checksum import unseal
from canid.values.errors import ConfigError, OutputError

# writes two states of half a megabyte in turn, until it is killed; says when the first one is there
WRITER = """
import sys
from canid.io.files import state_file
from canid.models.saving.checksum import seal
states = [seal({"turn": turn, "window": "0123456789" * 50_000}) for turn in range(2)]
turn = 0
while True:
    state_file.write(sys.argv[1], states[turn % 2])
    if not turn:
        print("written", flush=True)
    turn += 1
"""


def test_kill_9_while_saving_leaves_a_whole_file(tmp_path: Path) -> None:
    """Killed at many instants of many savings; the next process saves over what was left behind."""
    path = tmp_path / "driver.json"
    for trial in range(12):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"written\n"
        time.sleep(0.0007 * trial)
        writer.kill()
        writer.wait()
        writer.stdout.close()
        data = state_file.read(path)
        assert data is not None
        assert isinstance(unseal(data), dict)
        state_file.check_writable(path)  # as the next session does first
        assert [file.name for file in tmp_path.iterdir()] == ["driver.json"]
    state_file.write(path, b"whole")
    assert [file.name for file in tmp_path.iterdir()] == ["driver.json"]


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk shows at the latest when the data are brought to it."""
    path = tmp_path / "driver.json"
    state_file.write(path, b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="the state cannot be written"):
        state_file.write(path, b"new")
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["driver.json"]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "driver.json").symlink_to(tmp_path / "disk" / "state.json")
    state_file.write(tmp_path / "driver.json", b"state")
    assert (tmp_path / "driver.json").is_symlink()
    assert (tmp_path / "disk" / "state.json").read_bytes() == b"state"


def test_what_is_no_file_or_has_no_folder_is_reported_before_the_drive(tmp_path: Path) -> None:
    for path in (tmp_path, Path("/dev/null")):
        with pytest.raises(ConfigError, match="is no file"):
            state_file.read(path)
    with pytest.raises(OutputError, match="cannot be written"):
        state_file.check_writable(tmp_path / "missing" / "driver.json")
    state_file.check_writable(tmp_path / "driver.json")
    assert not list(tmp_path.iterdir())
    assert state_file.read(tmp_path / "driver.json") is None


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read and write everything")
def test_permissions_are_reported_before_the_drive(tmp_path: Path) -> None:
    path = tmp_path / "driver.json"
    path.write_bytes(b"state")
    path.chmod(0o000)
    with pytest.raises(ConfigError, match="Permission denied"):
        state_file.read(path)
    with pytest.raises(OutputError, match="write-protected"):
        state_file.check_writable(path)
