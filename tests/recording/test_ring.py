"""What a ring deletes: files that are what its list says, and nothing else, whatever happens to list and folder."""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from canid.io.files.held_folder import HeldFolder
from canid.io.recording import file_series
from canid.io.recording.file_series import Series
from canid.io.recording.journal import Journal, journal_path
from canid.io.recording.ring_list import Entry, RingList
from canid.io.recording.rotation import Rotation
from canid.values.errors import OutputError
from canid.values.types import Event, Frame
from tests.fixtures.clocks import later

LIMIT = Rotation(time=1.0)
# deletes whatever it may
NOTHING_KEPT = Rotation(time=1.0, keep_share=1e-12)


def record(folder: Path, count: int = 2, *, rotation: Rotation = LIMIT, start: int = 0) -> list[Path]:
    """A session of `count` files with some frames each; returns their paths."""
    series = Series(folder / "x.blf", rotation)
    paths = []
    for k in range(count):
        writer = series.open_next()
        writer.start_ns = 1_700_000_000_000_000_000 + start
        for i in range(10):
            writer.append(Frame(i * 0.1, 0, i, bytes([k, i])))
        writer.close()
        paths.append(writer.path)
    series.close()
    return paths


def prune(folder: Path) -> tuple[list[str], list[str]]:
    """A session that keeps nothing: what it deleted, and what it reported."""
    reported: list[str] = []
    series = Series(folder / "x.blf", NOTHING_KEPT, lambda what, says: reported.append(says))
    writer = series.open_next()
    deleted = [path.name for path in series.prune()]
    writer.close()
    series.close()
    return deleted, reported


def test_own_files_of_an_earlier_session_are_deleted(tmp_path: Path) -> None:
    """What the attacks below must not do is done where nothing is wrong."""
    paths = record(tmp_path)
    deleted, reported = prune(tmp_path)
    assert (deleted, reported) == ([path.name for path in paths], [])


def same_size(path: Path) -> None:
    size = path.stat().st_size
    path.unlink()
    path.write_bytes(b"?" * size)


def same_beginning(path: Path) -> None:
    data = path.read_bytes()
    path.unlink()
    path.write_bytes(data[:-1] + b"!")


def grown(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"more")


def in_place(path: Path) -> None:
    data = path.read_bytes()
    with path.open("r+b") as file:
        file.write(bytes(len(data)))


def copied(path: Path) -> None:
    shutil.copy2(path, path.with_name("aside"))
    # the inode of the old one must stay taken
    os.replace(path.with_name("aside"), path)


def a_link(path: Path) -> None:
    path.rename(path.with_name("victim.blf"))
    path.symlink_to("victim.blf")


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def a_fifo(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    "put", [same_size, same_beginning, grown, in_place, copied, a_link, a_folder, a_fifo]
)
def test_an_own_name_that_is_another_file_now_is_kept_and_reported_once(
    put: Callable[[Path], None], tmp_path: Path
) -> None:
    """Another file, a changed one, a link, a folder, a FIFO under the name of an own file: kept; the rest goes."""
    paths = record(tmp_path, 3)
    put(paths[1])
    held = {each.name: os.lstat(each) for each in tmp_path.iterdir() if each.name != "x.series"}
    deleted, reported = prune(tmp_path)
    assert deleted == [paths[0].name, paths[2].name]
    for name in held.keys() - deleted:
        assert os.path.samestat(os.lstat(tmp_path / name), held[name])
    assert len(reported) == 1
    assert paths[1].name in reported[0]
    assert prune(tmp_path)[1] == []


@pytest.mark.parametrize("kind", ["a name alone", "a wrong checksum", "another's identity"])
def test_a_foreign_file_in_the_list_is_kept_and_reported(kind: str, tmp_path: Path) -> None:
    """In the old format, with a wrong checksum, or with the identity of another file."""
    record(tmp_path, 1)
    foreign = tmp_path / "x_20200101T000000Z_000001.blf"
    foreign.write_bytes(b"LOGG, another program's")
    entry = Entry.decoded(first_line(tmp_path))
    assert entry is not None
    forged = entry._replace(name=foreign.name).line()
    line = {"a name alone": b"+%s\n" % foreign.name.encode(), "a wrong checksum": b"00000000" + forged[8:]}
    with (tmp_path / "x.series").open("ab") as file:
        file.write(line.get(kind, forged))
    _, reported = prune(tmp_path)
    assert foreign.exists()
    assert len(reported) == 1
    assert ("damaged" if kind == "a wrong checksum" else foreign.name) in reported[0]


def first_line(folder: Path) -> bytes:
    return (folder / "x.series").read_bytes().splitlines()[0]


def test_a_list_of_an_earlier_version_keeps_its_files_and_says_so_once(tmp_path: Path) -> None:
    """`+name` says nothing of what the file is."""
    old = tmp_path / "x_20200101T000000Z_000001.blf"
    old.write_bytes(b"LOGG")
    (tmp_path / "x.series").write_text(f"+{old.name}\n")
    first, second = prune(tmp_path), prune(tmp_path)
    assert old.exists()
    assert old.name in first[1][0]
    assert second[1] == []


def test_a_folder_that_was_copied_is_kept(tmp_path: Path) -> None:
    """Copies have other inodes."""
    (tmp_path / "here").mkdir()
    paths = record(tmp_path / "here")
    shutil.copytree(tmp_path / "here", tmp_path / "there")
    deleted, reported = prune(tmp_path / "there")
    assert deleted == []
    assert len(reported) == 1
    assert prune(tmp_path / "here")[0] == [path.name for path in paths]


@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_list_deletes_no_more(seed: int, tmp_path: Path) -> None:
    """Bits flipped, parts missing, lines doubled: what is deleted is some of what was recorded."""
    rng = random.Random(seed)
    paths = record(tmp_path, 3)
    foreign = tmp_path / "x_20200101T000000Z_000001.blf"
    foreign.write_bytes(paths[0].read_bytes())
    data = bytearray((tmp_path / "x.series").read_bytes())
    for _ in range(rng.randint(1, 30)):
        at = rng.randrange(len(data))
        match rng.randrange(3):
            case 0:
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                del data[at : at + rng.randrange(100)]
            case _:
                data[at:at] = data[at : at + 300] or rng.randbytes(20)
        data = data or bytearray(b"x")
    (tmp_path / "x.series").write_bytes(data)
    deleted, _ = prune(tmp_path)
    assert set(deleted) <= {path.name for path in paths}
    assert foreign.exists()
    assert [path.name for path in paths if not path.exists()] == deleted


def a_linked_list(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


def a_list_with_two_names(path: Path) -> None:
    os.link(path, path.with_name("elsewhere"))


def a_list_that_is_a_fifo(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    os.mkfifo(path)


def a_list_that_is_a_folder(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.mkdir()


@pytest.mark.parametrize(
    "put", [a_linked_list, a_list_with_two_names, a_list_that_is_a_fifo, a_list_that_is_a_folder]
)
def test_a_list_that_is_not_private_is_neither_read_nor_written(
    put: Callable[[Path], None], tmp_path: Path
) -> None:
    """The recording goes on under another name with a list of its own, and says why."""
    paths = record(tmp_path)
    put(tmp_path / "x.series")
    before = (tmp_path / "elsewhere").read_bytes()
    deleted, reported = prune(tmp_path)
    assert deleted == []
    assert all(path.exists() for path in paths)
    assert (tmp_path / "elsewhere").read_bytes() == before
    assert (tmp_path / "x-2.series").exists()
    assert "x.series" in reported[0]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
def test_a_list_of_another_user_is_not_used(tmp_path: Path) -> None:
    """Nobody makes a ring delete files for him."""
    record(tmp_path)
    try:
        os.chown(tmp_path / "x.series", 12345, -1)
    except OSError:
        pytest.skip("in a namespace of users root gives files to nobody else")
    deleted, reported = prune(tmp_path)
    assert deleted == []
    assert "another user" in reported[0]


def test_a_list_that_others_could_write_is_reported_and_closed_to_them(tmp_path: Path) -> None:
    """Its files are still recognised by what they are."""
    paths = record(tmp_path)
    (tmp_path / "x.series").chmod(0o666)
    deleted, reported = prune(tmp_path)
    assert deleted == [path.name for path in paths]
    assert "other users" in reported[0]
    assert (tmp_path / "x.series").stat().st_mode & 0o022 == 0


def test_a_list_that_is_deleted_is_written_anew(tmp_path: Path) -> None:
    """While it is used; the next session deletes what this one wrote."""
    reported: list[str] = []
    series = Series(tmp_path / "x.blf", LIMIT, lambda what, says: reported.append(says))
    paths = []
    for _ in range(3):
        writer = series.open_next()
        writer.append(Frame(0.0, 0, 1, b"a"))
        writer.close()
        paths.append(writer.path)
        (tmp_path / "x.series").unlink()
        series.prune()
    series.close()
    assert len(reported) == 3
    assert prune(tmp_path)[0] == [path.name for path in paths]


def test_files_taken_away_by_hand_do_not_stop_the_ring(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By age too: what is not there is passed over."""
    paths = record(tmp_path, 3)
    paths[0].unlink()
    series = Series(tmp_path / "x.blf", Rotation(time=1.0, keep_time=3600.0))
    monkeypatch.setattr(file_series, "read_clocks", lambda: later(3601.0))
    assert series.prune() == paths[1:]
    series.close()


def test_a_file_of_a_killed_session_is_known_by_its_beginning(tmp_path: Path) -> None:
    """It was never closed: what was noted once it held frames is enough; a new file of that name is kept."""
    for reused in (False, True):
        folder = tmp_path / str(reused)
        folder.mkdir()
        series = Series(folder / "x.blf", LIMIT)
        writer = series.open_next()
        writer.append(Frame(0.0, 0, 1, b"a"))
        writer.checkpoint()
        series.prune()
        writer.append(Frame(0.1, 0, 2, b"b"))
        writer.checkpoint()
        os.close(os.dup(writer.disk.fileno()))
        series._list.close()  # as a kill does
        if reused:
            other = writer.path.read_bytes()[:150] + bytes(200)
            writer.path.unlink()
            writer.path.write_bytes(other)
        assert prune(folder)[0] == ([] if reused else [writer.path.name])


def test_a_journal_goes_with_its_log_if_it_is_ours(tmp_path: Path) -> None:
    """One that was recorded as own is deleted; one that replaced it is kept, and reported."""
    for replaced in (False, True):
        folder = tmp_path / str(replaced)
        folder.mkdir()
        series = Series(folder / "x.blf", LIMIT)
        writer = series.open_next()
        journal = Journal(writer.path)
        journal.created = lambda _, name, fd, series=series: series.own(name, fd)
        journal.write(Event(0.0, "one", "first"), 0)
        journal.close()
        writer.close()
        series.close()
        path = journal_path(writer.path)
        if replaced:
            path.write_text("notes of the test drive\n")
        deleted, reported = prune(folder)
        assert deleted == [writer.path.name]
        assert path.exists() is replaced
        assert len(reported) == replaced


def test_nothing_is_deleted_through_a_folder_that_was_exchanged(tmp_path: Path) -> None:
    """The ring keeps to the folder that it opened, wherever that is now."""
    (tmp_path / "a").mkdir()
    paths = record(tmp_path / "a")
    series = Series(tmp_path / "a/x.blf", NOTHING_KEPT)
    series.open_next().close()
    (tmp_path / "a").rename(tmp_path / "b")
    (tmp_path / "a").mkdir()
    for path in paths:
        (tmp_path / "a" / path.name).write_bytes(b"new")
    assert [path.name for path in series.prune()] == [path.name for path in paths]
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [path.name for path in paths]
    assert series.open_next().path.parent == tmp_path / "b"
    series.close()


def test_an_exchange_at_the_last_moment_deletes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the last check and the deletion a name gets another file: it is there afterwards."""
    (path,) = record(tmp_path, 1)
    really = os.replace

    def rename(src: str, dst: str, **words: int) -> None:
        monkeypatch.setattr(os, "replace", really)
        path.unlink()
        path.write_bytes(b"another program was quick")
        really(src, dst, **words)

    monkeypatch.setattr(os, "replace", rename)
    deleted, reported = prune(tmp_path)
    assert deleted == []
    assert path.read_bytes() == b"another program was quick"
    assert "replaced" in reported[0]


def test_a_list_does_not_grow_without_end(tmp_path: Path) -> None:
    """What is deleted leaves the list when it has become large."""
    entry = Entry("x_20200101T000000Z_000001.blf", Entry.decoded(line_of(tmp_path)).identity)  # type: ignore[union-attr]
    listed = RingList(HeldFolder(tmp_path), "x")
    for _ in range(1500):
        listed.note(entry)
    listed.close()
    assert (tmp_path / "x.series").stat().st_size > 1 << 18
    again = RingList(HeldFolder(tmp_path), "x")
    assert entry.name in again.entries
    again.close()
    assert (tmp_path / "x.series").stat().st_size < 10_000


def line_of(folder: Path) -> bytes:
    record(folder, 1)
    return first_line(folder)


def test_an_impossible_name_is_one_line(tmp_path: Path) -> None:
    """A folder that is not there."""
    with pytest.raises(OutputError, match="cannot create"):
        Series(tmp_path / "nowhere/x.blf", LIMIT)


def wait_until(true: Callable[[], bool]) -> None:
    """Wait for another thread."""
    end = time.monotonic() + 60.0
    while not true() and time.monotonic() < end:
        time.sleep(0.002)
    assert true()


def test_a_journal_that_is_written_outlives_its_log_until_the_recording_has_left_it(tmp_path: Path) -> None:
    """A full disk takes the newest finished log while events still come: the journal goes once another one has begun."""
    series = Series(tmp_path / "x.blf", NOTHING_KEPT)
    writer = series.open_next()
    journal = Journal(writer.path)
    journal.created = lambda _, name, fd: series.own(name, fd)
    series.in_use = journal.in_use
    journal.write(Event(0.0, "one", "first"), 0)
    wait_until(lambda: "events" in (tmp_path / "x.series").read_text())
    writer.close()
    series.open_next().close()
    assert series.prune() == [writer.path]
    assert journal_path(writer.path).exists()
    journal.follow(tmp_path / "x_other.blf", 0.0)
    wait_until(lambda: journal.in_use() == {"x_other.events.jsonl"})
    series.prune()
    assert not journal_path(writer.path).exists()
    journal.close()
    assert [path.name for path in tmp_path.glob("*.events*")] == []
    series.close()
