"""A recording whose file another program deletes, moves, replaces or truncates: reported, continued, and nothing lost."""

from __future__ import annotations

import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_buses
from canid.io.files import held_folder
from canid.io.logs import open_log
from canid.io.recording.recorder import Recorder
from canid.io.recording.recorder_stats import Stats
from canid.io.recording.rotation import Rotation

# s: noticed within 1 s is promised; a busy machine may need more
PATIENCE = 300.0
FORMATS = (".blf", ".asc", ".log")


class Sender(threading.Thread):
    """Numbered frames onto a virtual bus, some 2,000 per second, until it is stopped."""

    def __init__(self, channel: str):
        super().__init__(daemon=True)
        self._can = python_can.load()
        self._bus: Any = self._can.Bus(channel, interface="virtual")
        self._stopping = threading.Event()
        self.count = 0

    def run(self) -> None:
        while not self._stopping.wait(0.005):
            for _ in range(10):
                data = self.count.to_bytes(4, "big")
                self._bus.send(self._can.Message(arbitration_id=1, data=data, is_extended_id=False))
                self.count += 1

    def stop(self) -> int:
        self._stopping.set()
        self.join()
        self._bus.shutdown()
        return self.count


@pytest.fixture
def sender(request: pytest.FixtureRequest) -> Iterator[Sender]:
    each = Sender(request.node.name)
    yield each
    if each.is_alive():
        each.stop()


class Run:
    """A recording under attack."""

    def __init__(
        self, request: pytest.FixtureRequest, sender: Sender, path: Path, rotation: Rotation | None = None
    ):
        buses = open_buses([{"interface": "virtual", "channel": request.node.name}])
        self.path = path
        self.recorder = Recorder(buses, path, rotation=rotation).start()
        self.events: list[str] = []
        self._sender = sender
        sender.start()
        self.wait(lambda: self.recorder.stats().bytes > 3000)

    def wait(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition() and time.monotonic() < end:
            time.sleep(0.01)
        assert condition()

    def wait_for(self, what: str) -> None:
        self.wait(lambda: what in self.reported())
        time.sleep(0.3)  # and some more frames

    def reported(self) -> list[str]:
        self.events += [event.what for event in self.recorder.events()]
        return self.events

    def stop(self) -> tuple[Stats, int]:
        sent = self._sender.stop()
        stats = self.recorder.stop()
        self.reported()
        return stats, sent


def numbers(path: Path) -> list[int]:
    log = open_log(path)
    found = [int.from_bytes(frame.data, "big") for frame in log]
    assert log.damage is None
    return found


def logs(folder: Path, suffix: str) -> list[Path]:
    return [path for path in folder.rglob(f"*{suffix}") if path.is_file() and not path.is_symlink()]


def all_numbers(folder: Path, suffix: str, but: Path | None = None) -> list[int]:
    return sorted(i for path in logs(folder, suffix) if path != but for i in numbers(path))


def deleted(path: Path) -> None:
    path.unlink()


def replaced(path: Path) -> None:
    other = path.with_name("other")
    other.write_bytes(b"another program's")
    other.replace(path)


def moved_to_another_file_system(path: Path) -> None:
    """As mv does it."""
    shutil.copy(path, path.with_name("copy"))
    path.unlink()


def a_link_instead(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def a_folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.slow("recordings in real time")
@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(
    "attack", [deleted, replaced, moved_to_another_file_system, a_link_instead, a_folder_instead]
)
def test_a_file_that_is_deleted_comes_back_and_the_recording_goes_on(
    attack: Callable[[Path], None],
    suffix: str,
    sender: Sender,
    request: pytest.FixtureRequest,
    tmp_path: Path,
) -> None:
    """Every frame is in a file with a name; what took the old name is not touched."""
    run = Run(request, sender, tmp_path / f"x{suffix}")
    attack(run.path)
    there = os.lstat(run.path) if os.path.lexists(run.path) else None
    run.wait_for("recording_deleted")
    stats, sent = run.stop()
    assert run.events == ["recording_deleted", "recording_restored"]
    assert all_numbers(tmp_path, suffix, run.path) == list(range(sent))
    assert stats.written == stats.frames == sent
    assert (stats.state, stats.path, stats.files) == ("stopped", tmp_path / f"x-2{suffix}", 2)
    assert (tmp_path / f"x-restored{suffix}").exists()
    if there is not None:
        assert os.path.samestat(os.lstat(run.path), there)
    journal = (tmp_path / "x-2.events.jsonl").read_text().splitlines()
    assert [json.loads(line)["what"] for line in journal] == run.events


@pytest.mark.parametrize("attack", [deleted, replaced])
def test_a_file_deleted_just_before_the_end_is_there_at_the_end(
    attack: Callable[[Path], None], sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """Nobody had the time to notice: what `Stats.path` names holds every frame."""
    run = Run(request, sender, tmp_path / "x.blf")
    sent = sender.stop()
    run.wait(lambda: run.recorder.stats().written == sent)
    attack(run.path)
    stats = run.recorder.stop()
    assert stats.path is not None
    assert all_numbers(tmp_path, ".blf", run.path) == list(range(sent))
    assert stats.path.is_file()
    assert stats.path != run.path
    assert stats.written == sent


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_that_is_moved_is_written_on_where_it_is(
    suffix: str, sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """Renamed on its file system: complete under the new name, which `Stats.path` states."""
    run = Run(request, sender, tmp_path / f"x{suffix}")
    new = tmp_path / "archive" / f"y{suffix}"
    new.parent.mkdir()
    run.path.rename(new)
    run.wait_for("recording_moved")
    stats, sent = run.stop()
    assert run.events == ["recording_moved"]
    assert (stats.state, stats.path) == ("stopped", new)
    assert numbers(new) == list(range(sent))
    assert logs(tmp_path, suffix) == [new]


def test_a_moved_file_without_proc_is_copied(
    sender: Sender, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the system does not report where it went: a copy has a name that is known, and a new file the rest."""
    monkeypatch.setattr(held_folder, "path_of", lambda fd: None)
    run = Run(request, sender, tmp_path / "x.blf")
    run.path.rename(tmp_path / "y.dat")
    run.wait_for("recording_hidden")
    stats, sent = run.stop()
    assert all_numbers(tmp_path, ".blf") == list(range(sent))
    assert stats.path == tmp_path / "x-2.blf"


@pytest.mark.parametrize("rotation", [None, Rotation(size=20_000)])
def test_a_folder_that_is_removed_is_gone_on_above(
    rotation: Rotation | None, sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """The nearest folder that exists has the rest, and a copy of what was removed while it was open."""
    folder = tmp_path / "a/b"
    folder.mkdir(parents=True)
    run = Run(request, sender, folder / "x.blf", rotation)
    shutil.rmtree(tmp_path / "a")
    if rotation is None:
        run.wait_for("recording_deleted")
    else:  # the removed file may have been finished before that was noticed: then it is restored, not gone on from
        run.wait(lambda: (now := run.recorder.stats().path) is not None and now.parent == tmp_path)
    stats, sent = run.stop()
    found = all_numbers(tmp_path, ".blf")
    assert found == list(range(found[0], sent))
    assert found[0] == 0 or rotation  # finished files of a series were not open any more
    assert stats.path is not None
    assert stats.path.parent == tmp_path
    assert stats.state == "stopped"


def test_a_working_folder_that_is_removed_is_gone_on_above(
    sender: Sender, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A relative path leads nowhere then."""
    folder = tmp_path / "a"
    folder.mkdir()
    monkeypatch.chdir(folder)
    run = Run(request, sender, Path("x.blf"))
    shutil.rmtree(folder)
    run.wait_for("recording_deleted")
    stats, sent = run.stop()
    assert all_numbers(tmp_path, ".blf") == list(range(sent))
    assert stats.path is not None
    assert stats.path.parent == tmp_path


@pytest.mark.parametrize("rotation", [None, Rotation(size=20_000)])
def test_a_folder_that_is_renamed_is_followed(
    rotation: Rotation | None, sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """With all that is in it, also when another folder takes its name."""
    (tmp_path / "a").mkdir()
    run = Run(request, sender, tmp_path / "a/x.blf", rotation)
    (tmp_path / "a").rename(tmp_path / "b")
    (tmp_path / "a").mkdir()
    run.wait_for("recording_moved") if rotation is None else time.sleep(1.5)
    stats, sent = run.stop()
    assert stats.path is not None
    assert stats.path.parent == tmp_path / "b"
    assert all_numbers(tmp_path / "b", ".blf") == list(range(sent))
    assert list((tmp_path / "a").iterdir()) == []


def truncated(path: Path) -> None:
    os.truncate(path, 0)


def overwritten(path: Path) -> None:
    path.write_bytes(b"a longer text of another program's " * 10_000)


def appended(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"another program's")


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("attack", [truncated, overwritten, appended])
def test_a_file_that_is_changed_is_left_alone_and_reported(
    attack: Callable[[Path], None],
    suffix: str,
    sender: Sender,
    request: pytest.FixtureRequest,
    tmp_path: Path,
) -> None:
    """What was in it may be lost, and the state says so at the end; no later frame is."""
    run = Run(request, sender, tmp_path / f"x{suffix}")
    before = run.recorder.stats().written
    attack(run.path)
    left = run.path.read_bytes()
    run.wait_for("recording_changed")
    stats, sent = run.stop()
    assert run.events == ["recording_changed", "recording_lost"]
    assert run.path.read_bytes() == left
    assert stats.state.startswith("failed: ")
    found = numbers(tmp_path / f"x-2{suffix}")
    assert found == list(range(found[0], sent))
    assert stats.written == len(found)
    assert found[0] <= before + 10_000


def test_a_file_that_is_truncated_just_before_the_end_is_reported(
    sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """Exit code 5: the state says what is lost."""
    run = Run(request, sender, tmp_path / "x.blf")
    sent = sender.stop()
    run.wait(lambda: run.recorder.stats().written == sent)
    time.sleep(0.3)
    os.truncate(run.path, 10)
    stats = run.recorder.stop()
    assert stats.state.startswith("failed: ")
    assert stats.written == 0


def test_files_of_a_series_that_are_deleted_at_any_time_lose_only_what_was_finished(
    sender: Sender, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """The newest file is deleted again and again, at a seam or not: no frame of it is lost."""
    run = Run(request, sender, tmp_path / "x.blf", Rotation(size=20_000))
    for _ in range(6):
        time.sleep(0.25)
        path = run.recorder.stats().path
        assert path is not None
        path.unlink(missing_ok=True)
    stats, sent = run.stop()
    found = all_numbers(tmp_path, ".blf")
    assert len(set(found)) == len(found)
    # a file may have been finished, closed and then deleted, which is its owner's right: of six files at most five
    assert sent - len(found) < stats.written
    assert found[-1] == sent - 1
    reported = [
        json.loads(line) for path in tmp_path.glob("*.jsonl") for line in path.read_text().splitlines()
    ]
    assert any(event["what"] == "recording_restored" for event in reported)
    assert stats.state == "stopped"
