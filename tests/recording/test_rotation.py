"""A recording in many files: names, limits, rings, and what is never deleted."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_buses
from canid.io.logs import open_log
from canid.io.recording.file_series import Series
from canid.io.recording.log_files import LogFiles
from canid.io.recording.recorder import Recorder
from canid.io.recording.rotation import Rotation, checked
from canid.ui.cli import main
from canid.values.errors import ConfigError
from canid.values.frame_columns import columns_of
from canid.values.types import Event, Flag, Frame


@pytest.fixture
def send(request: pytest.FixtureRequest) -> Iterator[Callable[..., None]]:
    """Numbered frames onto a virtual bus of the test's name, stamped as stated."""
    can = python_can.load()
    bus: Any = can.Bus(request.node.name, interface="virtual", preserve_timestamps=True)

    def one(i: int, stamp: float | None = None) -> None:
        at = time.time() if stamp is None else stamp
        data = i.to_bytes(4, "big") + (i * 2654435761 % 2**32).to_bytes(4, "big")
        bus.send(can.Message(arbitration_id=i % 2048, data=data, is_extended_id=False, timestamp=at))

    yield one
    bus.shutdown()


def buses_of(request: pytest.FixtureRequest) -> list[Any]:
    return open_buses([{"interface": "virtual", "channel": request.node.name, "preserve_timestamps": True}])


def numbers(path: Path) -> list[int]:
    return [int.from_bytes(frame.data[:4], "big") for frame in open_log(path)]


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".log"])
def test_files_by_size_and_time_hold_every_frame_at_its_own_time(
    suffix: str, send: Callable[..., None], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """40 s of frames in files of 10 s and 20 kB: all are there, at the times of their stamps, in sorted files."""
    began, count = 1.7e9, 8000
    recorder = Recorder(
        buses_of(request), tmp_path / f"x{suffix}", rotation=Rotation(size=20_000, time=10.0)
    ).start()
    for i in range(count):
        send(i, began + i * 0.005)
    stats = recorder.stop()
    files = sorted(tmp_path.glob(f"x_*{suffix}"))
    assert stats.written == count
    assert stats.files == len(files) > 4
    assert stats.path == files[-1]
    assert [i for path in files for i in numbers(path)] == list(range(count))
    for path in files:
        log = open_log(path)
        frames = list(log)
        assert frames[0].t == 0.0
        assert frames[-1].t < 10.0
        assert path.stat().st_size <= 20_000
        first = int.from_bytes(frames[0].data[:4], "big")
        assert abs(log.start_utc - began - first * 0.005) < 2e-6


def test_frames_in_another_order_around_a_seam_keep_their_times(
    send: Callable[..., None], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """A frame stamped before the one that began the file is at its own time, for python-can's reader too."""
    stamps = [1.7e9, 1.7e9 + 1.0, 1.7e9 + 0.999, 1.7e9 + 1.5]
    recorder = Recorder(buses_of(request), tmp_path / "x.blf", rotation=Rotation(time=1.0)).start()
    for i, stamp in enumerate(stamps):
        send(i, stamp)
    recorder.stop()
    files = sorted(tmp_path.glob("x_*.blf"))
    assert [numbers(path) for path in files] == [[0], [1, 2, 3]]
    with python_can.load().BLFReader(str(files[1])) as reader:
        read = [message.timestamp for message in reader]
    assert read == pytest.approx(stamps[1:], abs=1e-6)


def test_a_ring_goes_on_over_restarts_and_deletes_nothing_else(tmp_path: Path) -> None:
    """The oldest of an earlier session goes first; what is not in the list stays, whatever its name."""
    rotation = Rotation(time=1.0, keep_share=1e-12)
    for _ in range(2):
        series = Series(tmp_path / "x.blf", Rotation(time=1.0))
        for _ in range(2):
            series.open_next().close()
        series.close()
        time.sleep(1.1)  # names hold whole seconds
    mine = sorted(path.name for path in tmp_path.glob("x_*.blf"))
    foreign = ["x_19990101T000000Z_000001.blf", "x.blf", "y_19990101T000000Z_000001.blf"]
    for name in foreign:
        (tmp_path / name).write_bytes(b"?")
    outside = tmp_path / "folder"
    outside.mkdir()
    (outside / "x_1.blf").write_bytes(b"?")
    (outside / "x.events.jsonl").write_bytes(b"?")
    with (tmp_path / "x.series").open("a") as listed:
        listed.write("+folder/x_1.blf\n+../x_1.blf\n+y_19990101T000000Z_000001.blf\n+..\nnonsense\n+\n")
    not_ours = (tmp_path / mine[0]).with_suffix(".events.jsonl")
    not_ours.write_text("{}\n")
    series = Series(tmp_path / "x.blf", rotation)
    newest = series.open_next()
    assert [path.name for path in series.prune()] == mine
    newest.close()
    series.close()
    left = sorted(path.name for path in tmp_path.iterdir() if path.is_file())
    assert left == sorted([*foreign, newest.path.name, "x.series", not_ours.name])
    assert (outside / "x_1.blf").exists()


def test_no_date_of_a_file_makes_it_old(tmp_path: Path) -> None:
    """Age counts by clocks that confirm each other: a file's date is none, in this session and of earlier ones."""
    earlier = Series(tmp_path / "x.blf", Rotation(time=1.0))
    old = earlier.open_next()
    old.close()
    earlier.close()
    series = Series(tmp_path / "x.blf", Rotation(time=1.0, keep_time=3600.0))
    files = [old, *(series.open_next() for _ in range(3))]
    for each in files:
        each.close()
        os.utime(each.path, (0, 0))
    assert series.prune() == []
    series.close()


def test_two_recordings_under_one_name_share_nothing(tmp_path: Path) -> None:
    """The second one, at the same time, writes files of another name, and lists them elsewhere."""
    one = Series(tmp_path / "x.blf", Rotation(time=1.0))
    two = Series(tmp_path / "x.blf", Rotation(time=1.0, keep_share=1e-12))
    first, second = one.open_next(), two.open_next()
    assert second.path.name.startswith("x-2_")
    assert two.prune() == []
    for each in (first, second, one, two):
        each.close()
    assert first.path.exists()


def test_a_clock_that_is_set_back_begins_a_new_file(
    send: Callable[..., None], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """Times before the file's start fit into no format: they begin a new file, and python-can reads them right."""
    recorder = Recorder(buses_of(request), tmp_path / "x.blf").start()
    send(0, 1.7e9)
    time.sleep(1.3)  # a clock that is set back all the time does not begin a file each time
    send(1, 1.7e9 - 3600.0)
    send(2, 1.7e9 - 3599.8)
    recorder.stop()
    assert numbers(tmp_path / "x.blf") == [0]
    with python_can.load().BLFReader(str(tmp_path / "x-2.blf")) as reader:
        assert [message.timestamp - 1.7e9 for message in reader] == pytest.approx(
            [-3600.0, -3599.8], abs=1e-6
        )
    assert [event.what for event in recorder.events()] == ["clock_step"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--file-size", "5"], "too small"),
        (["--file-time", "0.1"], "too short"),
        (["--keep-time", "1h"], "--file-size or --file-time"),
        (["--keep-share", "200%", "--file-time", "1h"], "more than the whole disk"),
        (["--file-size", "many"], "not a size"),
    ],
)
def test_limits_that_cannot_be_are_one_line(
    words: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 2, one line, and no file."""
    code = main(["record", "-i", "virtual", "-c", "limits", "-o", str(tmp_path / "x.blf"), *words])
    reported = capsys.readouterr().err
    assert (code, reported.count("\n")) == (2, 1)
    assert says in reported
    assert list(tmp_path.iterdir()) == []


def test_no_limit_is_no_rotation() -> None:
    assert checked(Rotation()) is None
    with pytest.raises(ConfigError):
        checked(Rotation(keep_share=0.5))


def test_an_unknown_suffix_is_reported_before_anything_is_created(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot write the format"):
        Series(tmp_path / "x.xyz", Rotation(time=1.0))
    assert list(tmp_path.iterdir()) == []


def test_a_file_never_stands_empty_under_its_name(tmp_path: Path) -> None:
    """Where hard links work, the name appears with the header in it; nothing else is left behind."""
    from canid.io.logs.log_writer import open_writer

    writer = open_writer(tmp_path / "x.blf", 1_700_000_000_000_000_000)
    assert [path.name for path in tmp_path.iterdir()] == ["x.blf"]
    assert (tmp_path / "x.blf").stat().st_size == 144
    writer.append(Frame(0.0, 0, 1, b"a"))
    writer.close()
    assert [frame.data for frame in open_log(tmp_path / "x.blf")] == [b"a"]


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_notes_make_no_file_larger_than_its_limit(suffix: str, tmp_path: Path) -> None:
    """A long note after every third frame of CAN FD: no file exceeds its limit, and no note is lost."""
    files = LogFiles(
        tmp_path / f"x{suffix}", Rotation(size=10_000), lambda *_: None, lambda *_: None, lambda *_: None
    )
    files.start_ns = 1_700_000_000_000_000_000
    files.start()
    for i in range(300):
        files.append(columns_of([Frame(i * 0.01, 0, i, os.urandom(64), Flag.FD)]))
        if i % 3 == 0:
            files.note(Event(i * 0.01, "mark", f"mark {i}: " + os.urandom(300 + i).hex()))
        files.write_notes()
    files.write_notes(last=True)
    files.close(lambda: None)
    paths = sorted(tmp_path.glob(f"x_*{suffix}"))
    assert max(path.stat().st_size for path in paths) <= 10_000
    content = b"".join(path.read_bytes() for path in paths)
    if suffix == ".asc":
        assert [content.count(b"mark %d: " % i) for i in range(0, 300, 3)] == [1] * 100
    assert sum(len(list(open_log(path))) for path in paths) == 300
