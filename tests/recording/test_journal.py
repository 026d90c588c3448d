"""The journal: an output that may fail, block, be taken or be deleted."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.io.recording.journal import PATIENCE_S, Journal
from canid.values.types import Event

# s: a busy machine may need them; what is asked is that it comes to pass
PATIENCE = 300.0


def wait_for(condition: Callable[[], Any]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    assert condition()


def write(journal: Journal, *names: str) -> None:
    for name in names:
        journal.write(Event(1.0, name, "it happened"), 0)


def names(path: Path) -> list[str]:
    return [json.loads(line)["what"] for line in path.read_text().splitlines()]


def taken_by_a_link(path: Path) -> None:
    (path.parent / "target").write_text('{"t": 1}\n')
    path.symlink_to(path.parent / "target")


def taken_by_a_dangling_link(path: Path) -> None:
    path.symlink_to(path.parent / "nowhere")


def taken_by_a_fifo(path: Path) -> None:
    os.mkfifo(path)


def taken_by_a_folder(path: Path) -> None:
    path.mkdir()


def taken_by_a_log(path: Path) -> None:
    path.write_bytes(b"LOGG and more")


def taken_by_an_empty_file(path: Path) -> None:
    path.touch()


@pytest.mark.parametrize(
    "take",
    [
        taken_by_a_link,
        taken_by_a_dangling_link,
        taken_by_a_fifo,
        taken_by_a_folder,
        taken_by_a_log,
        taken_by_an_empty_file,
    ],
)
def test_what_has_the_journals_name_is_neither_followed_nor_changed(
    take: Callable[[Path], None], tmp_path: Path
) -> None:
    """A link, a FIFO, a folder, a foreign file: events go under another name, and the journal says so."""
    path = tmp_path / "x.events.jsonl"
    take(path)
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir() if each.is_file()}
    reported: list[str] = []
    journal = Journal(tmp_path / "x.blf", lambda what, says: reported.append(what))
    write(journal, "one", "two")
    journal.close()
    assert journal.failed == 0
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    assert names(tmp_path / "x.events-2.jsonl") == ["one", "two"]
    assert reported == ["journal_elsewhere"]
    assert not (tmp_path / "nowhere").exists()


def test_a_journal_of_an_earlier_session_goes_on_behind_half_a_line(tmp_path: Path) -> None:
    """What a killed process wrote in part stays a line of its own."""
    path = tmp_path / "x.events.jsonl"
    path.write_text('{"t": 1.0, "utc": null, "what": "old", "says": ""}\n{"t": 2.0, "wh')
    journal = Journal(tmp_path / "x.blf")
    write(journal, "new")
    journal.close()
    lines = path.read_text().splitlines()
    assert lines[1] == '{"t": 2.0, "wh'
    assert json.loads(lines[2])["what"] == "new"


def test_a_journal_that_is_deleted_comes_back_whole(tmp_path: Path) -> None:
    """Deleted while nothing happens: its lines are there again before the next event."""
    path = tmp_path / "x.events.jsonl"
    reported: list[str] = []
    journal = Journal(tmp_path / "x.blf", lambda what, says: reported.append(what))
    write(journal, "one", "two")
    wait_for(lambda: path.exists() and len(names(path)) == 2)
    path.unlink()
    wait_for(path.exists)
    write(journal, "three")
    journal.close()
    assert names(path) == ["one", "two", "three"]
    assert (reported, journal.failed) == (["journal_restored"], 0)


def test_a_journal_whose_folder_is_removed_is_carried_to_the_next_one(tmp_path: Path) -> None:
    """Its lines stand in the journal of the log with which the recording goes on."""
    folder = tmp_path / "folder"
    folder.mkdir()
    journal = Journal(folder / "x.blf")
    write(journal, "one")
    wait_for((folder / "x.events.jsonl").exists)
    wait_for(lambda: names(folder / "x.events.jsonl") == ["one"])
    (folder / "x.events.jsonl").unlink()
    folder.rmdir()
    wait_for(lambda: journal._carried)
    journal.follow(tmp_path / "x.blf", 0.0)
    write(journal, "two")
    journal.close()
    assert names(tmp_path / "x.events.jsonl") == ["one", "two"]
    assert journal.failed == 0


def test_a_journal_that_blocks_ends_within_its_time_and_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that does not answer costs the end about a second, and every event that it holds up is counted."""
    stuck = threading.Event()
    really = os.write
    path = tmp_path / "x.events.jsonl"

    def write_on_a_stuck_disk(fd: int, data: bytes) -> int:
        stuck.wait(PATIENCE)
        return really(fd, data)

    monkeypatch.setattr(os, "write", write_on_a_stuck_disk)
    journal = Journal(tmp_path / "x.blf")
    write(journal, "one", "two")
    began = time.monotonic()
    journal.close()
    took = time.monotonic() - began
    write(journal, "three")
    assert time.monotonic() - began < PATIENCE / 2
    assert took >= PATIENCE_S
    assert journal.failed == 3
    stuck.set()
    wait_for(lambda: path.exists() and len(names(path)) == 3)


FULL = """
import resource, signal, sys
from pathlib import Path
from canid.io.recording.journal import Journal
from canid.values.types import Event
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
journal = Journal(Path(sys.argv[1]))
for i in range(20):
    journal.write(Event(float(i), "event", "x" * 40), 0)
journal.close()
print(journal.failed)
"""


@pytest.mark.parametrize("limit", [0, 1, 99, 100, 1000, 1234])
def test_a_full_disk_leaves_whole_lines_and_a_count(limit: int, tmp_path: Path) -> None:
    """Lines in the file and events that are counted as unwritten make up all."""
    command = [sys.executable, "-c", FULL, str(tmp_path / "x.blf"), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = (tmp_path / "x.events.jsonl").read_text()
    assert lines == "" or lines.endswith("\n")
    assert len(lines.splitlines()) + int(done.stdout) == 20


def test_a_journal_that_is_closed_keeps_no_thread_and_brings_nothing_back(tmp_path: Path) -> None:
    """After `close` the file is its owner's to delete; an event that comes later goes where the others are."""
    threads = threading.active_count()
    journal = Journal(tmp_path / "x.blf")
    write(journal, "a")
    journal.close()
    wait_for(lambda: threading.active_count() == threads)
    (tmp_path / "x.events.jsonl").rename(tmp_path / "y.events.jsonl")
    time.sleep(1.0)  # twice as long as it takes to notice a deletion
    assert not (tmp_path / "x.events.jsonl").exists()
    (tmp_path / "y.events.jsonl").rename(tmp_path / "x.events.jsonl")
    write(journal, "b")
    assert names(tmp_path / "x.events.jsonl") == ["a", "b"]
    wait_for(lambda: threading.active_count() == threads)


def test_an_event_after_the_end_goes_to_the_name_that_was_used(tmp_path: Path) -> None:
    """Another program's file has the journal's own name: what comes after `close` goes behind what came before."""
    (tmp_path / "x.events.jsonl").write_text("notes")
    journal = Journal(tmp_path / "x.blf")
    write(journal, "a")
    journal.close()
    write(journal, "b")
    assert names(tmp_path / "x.events-2.jsonl") == ["a", "b"]
