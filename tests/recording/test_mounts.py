"""A rotating recording whose folder is mounted over, unmounted, renamed, removed or replaced, with real mounts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from canid.io.logs import open_log
from tests.fixtures import mounted_recording
from tests.fixtures.mounted_recording import ACTIONS, Settings, record_under

# which event says what happened to the folder
SAID = {
    "mounted_over": "folder_covered",
    "bound_over_when_a_file_begins": "folder_covered",
    "mounted_and_unmounted": "folder_covered",
    "unmounted_lazily": "folder_gone",
    "renamed": "recording_moved",
    "removed_and_made_anew": "folder_gone",
    "replaced_by_a_link": "recording_moved",
}


@pytest.fixture
def namespace() -> None:
    """Mounts that no other process sees."""
    why = mounted_recording.unavailable()
    if why:
        pytest.skip(why)


def numbers(folder: Path, suffix: str = ".blf") -> list[int]:
    """The frames of all logs below a folder, sorted."""
    found: list[int] = []
    for path in folder.rglob(f"*{suffix}"):
        log = open_log(path)
        found += [int.from_bytes(frame.data[:4], "big") for frame in log]
        assert log.damage is None
    return sorted(found)


@pytest.mark.slow("seven recordings in real time, each in a process of its own")
@pytest.mark.parametrize("suffix", [".blf", ".log"])
@pytest.mark.parametrize("kind", [action.__name__ for action in ACTIONS])
def test_a_rotating_recording_goes_on_whatever_becomes_of_its_folder(
    kind: str, suffix: str, namespace: None, tmp_path: Path
) -> None:
    """Every frame is in a file that is there; it is said once, and no file is named that is not there."""
    done = record_under(Settings(str(tmp_path), kind, ["--file-size", "10kB"], suffix))
    found = numbers(tmp_path, suffix)
    assert done.code == 143, done.said
    if kind == "removed_and_made_anew":  # finished files were their owner's to remove
        assert found == list(range(found[0], done.sent))
    elif kind == "unmounted_lazily":  # what was open there is copied: no name leads to it here
        assert sorted(set(found)) == list(range(done.sent))
    else:
        assert found == list(range(done.sent))
    assert done.written == done.sent
    assert done.absent == []
    assert done.events.count(SAID[kind]) == 1, done.events
    assert not {"write_error", "recording_waits", "recording_lost"} & set(done.events)


@pytest.mark.slow("a recording in real time, in a process of its own")
def test_a_single_file_is_written_on_below_a_mount(namespace: None, tmp_path: Path) -> None:
    """It stays one file, and the end says what hides it and what shows it."""
    done = record_under(Settings(str(tmp_path), "mounted_over", [], before_s=0.3))
    assert done.code == 143, done.said
    assert numbers(tmp_path / "rec") == list(range(done.sent))
    assert [path.name for path in tmp_path.rglob("*.blf")] == ["x.blf"]
    assert done.events == ["listen_only", "folder_covered"]
    assert f"`umount {tmp_path / 'rec'}` shows them" in done.printed


SERIES = """
import subprocess, sys
from pathlib import Path
from canid.io.recording.journal import Journal
from canid.io.recording.log_folders import LogFolders
from canid.io.recording.rotation import Rotation
from canid.values.types import Event
folder, reported = Path(sys.argv[1]), []
folders = LogFolders(folder / "x.blf", Rotation(time=1.0, keep_time=1e9), lambda what, says: reported.append(what))
writers = [folders.open_first()]
subprocess.run(["mount", "-t", "tmpfs", "none", folder], check=True)
writers.append(folders.open_next(anywhere=False))
journal = Journal(None)
journal.created = folders.own_journal
journal.follow(writers[-1].path, 0.0, writers[-1].disk.folder)
journal.write(Event(0.0, "one", "first"), 0)
journal.close()
folders.prune()
assert [writer.disk.find().place.name for writer in writers] == ["COVERED"] * 2
assert list(folder.iterdir()) == reported == []
for writer in writers:
    writer.close()
folders.close()
"""


def test_files_journal_and_list_of_a_series_stay_in_their_folder(namespace: None, tmp_path: Path) -> None:
    """What is mounted over the folder gets none of them, and all are there when it is gone."""
    command = [*mounted_recording.NAMESPACE, sys.executable, "-c", SERIES, str(tmp_path)]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": str(mounted_recording.ROOT)})
    found = sorted(path.name.partition(".")[2] for path in tmp_path.iterdir())
    assert found == ["blf", "blf", "events.jsonl", "series"]
