"""A ring deletes nothing on the word of one clock: ages count between clocks that confirm each other."""

from __future__ import annotations

import json
import random
import time
import zlib
from pathlib import Path

import pytest

from canid.io.files.held_folder import HeldFolder
from canid.io.recording import file_series
from canid.io.recording.file_age import UNKNOWN, Clocks, elapsed, read_clocks
from canid.io.recording.file_series import Series
from canid.io.recording.ring_list import RingList
from canid.io.recording.rotation import Rotation
from canid.values.types import Frame
from tests.fixtures.clocks import later

DAY = 86_400.0
WEEK = Rotation(time=60.0, keep_time=7 * DAY)
YEARS = 6 * 365 * DAY
REBOOTED = Clocks("another boot", 0.0, 30.0, 30.0)


def session(folder: Path, count: int = 2) -> list[str]:
    """Record `count` files; returns their names."""
    series = Series(folder / "x.blf", WEEK)
    names = []
    for k in range(count):
        writer = series.open_next()
        writer.start_ns = 1_700_000_000_000_000_000
        writer.append(Frame(0.0, 0, k, b"a"))
        writer.close()
        names.append(writer.path.name)
    series.close()
    return names


def pruned(folder: Path, rotation: Rotation = WEEK) -> tuple[list[str], list[str]]:
    """A later session: what it deleted, and which events it reported."""
    events: list[str] = []
    series = Series(folder / "x.blf", rotation, lambda what, says: events.append(what))
    series.open_next().close()
    deleted = [path.name for path in series.prune()]
    series.close()
    return deleted, events


@pytest.mark.parametrize(
    ("case", "then", "now", "old"),
    [
        ("a week has passed by all clocks", 0.0, (8 * DAY, 8 * DAY), True),
        ("six days have passed by all clocks", 0.0, (6 * DAY, 6 * DAY), False),
        ("the wall clock is ahead by 8 days", 0.0, (30.0, 8 * DAY), False),
        ("the wall clock stood at 2020", -YEARS, (30.0, YEARS), False),
        ("the wall clock was set back", 0.0, (8 * DAY, -DAY), False),
        ("the clocks of a time namespace are ahead", 0.0, (8 * DAY, 30.0), False),
        ("the wall clock was corrected by minutes", 0.0, (8 * DAY, 8 * DAY + 600.0), True),
    ],
)
def test_files_age_within_a_boot_only_where_all_clocks_agree(
    case: str,
    then: float,
    now: tuple[float, float],
    old: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else they are kept, and an event says so; the share of the disk still counts."""
    first = read_clocks()
    monkeypatch.setattr(file_series, "read_clocks", lambda: later(0.0, then, first))
    names = session(tmp_path)
    monkeypatch.setattr(file_series, "read_clocks", lambda: later(now[0], now[1] + then, first))
    deleted, events = pruned(tmp_path)
    assert deleted == (names if old else []), case
    assert events == ([] if old or now == (6 * DAY, 6 * DAY) else ["ages_not_known"])
    by_share = pruned(tmp_path, WEEK._replace(keep_share=1e-12))[0]
    assert [name for name in by_share if name in names] == ([] if old else names)


@pytest.mark.parametrize("then", [True, False])
@pytest.mark.parametrize("now", [True, False])
def test_files_age_across_boots_only_by_a_synchronised_clock(
    then: bool, now: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At both ends: neither a clock that was wrong then nor one that is now deletes a file."""
    first = read_clocks()._replace(synchronised=then)
    monkeypatch.setattr(file_series, "read_clocks", lambda: first)
    names = session(tmp_path)
    again = REBOOTED._replace(wall=first.wall + 8 * DAY, synchronised=now)
    monkeypatch.setattr(file_series, "read_clocks", lambda: again)
    assert pruned(tmp_path)[0] == (names if then and now else [])


def test_the_last_file_of_a_session_makes_no_other_one_old(tmp_path: Path) -> None:
    """It is closed like those before it, and no time has passed since: a ring by age keeps what is young at the end."""
    series = Series(tmp_path / "x.blf", Rotation(time=1.0, keep_time=0.5))
    old, *young = [series.open_next() for _ in range(2)]
    time.sleep(0.6)
    young += [series.open_next() for _ in range(3)]
    for each in (old, *young):
        each.close()
    assert series.prune() == [old.path]
    series.close()


def test_what_was_recorded_since_has_passed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Boots later, with no clock that confirms anything: a file before 7 days of recordings is 7 days old."""
    names = session(tmp_path, 12)
    series_list = RingList(HeldFolder(tmp_path), "x")
    for name in names:
        series_list.note(series_list.entries[name]._replace(clocks=UNKNOWN, recorded=DAY - 1.0))
    series_list.close()
    monkeypatch.setattr(file_series, "read_clocks", lambda: REBOOTED)
    assert pruned(tmp_path) == (names[:4], ["ages_not_known"])


def test_lists_of_earlier_versions_hold_files_of_unknown_age(tmp_path: Path) -> None:
    """Their lines have no clocks: they are read, their files are kept by age and deleted by size."""
    names = session(tmp_path)
    path = tmp_path / "x.series"
    entries = [RingListLine(line).without("clocks", "recorded") for line in path.read_bytes().splitlines()]
    path.write_bytes(b"".join(entries))
    assert pruned(tmp_path) == ([], ["ages_not_known"])
    assert pruned(tmp_path, WEEK._replace(keep_share=1e-12))[0][:2] == names


class RingListLine:
    """A line of a list, taken apart."""

    def __init__(self, line: bytes):
        self.fields = json.loads(line.partition(b" ")[2])

    def without(self, *names: str) -> bytes:
        """The line without some fields, with its checksum."""
        text = json.dumps({k: v for k, v in self.fields.items() if k not in names}).encode()
        return b"%08x %s\n" % (zlib.crc32(text), text)


def test_the_least_of_what_clocks_agree_on_is_the_age(seed: int) -> None:
    """Never more than any clock says; None as soon as one contradicts."""
    rng = random.Random(seed)
    start = read_clocks()
    for _ in range(200):
        passed = rng.uniform(0.0, 30 * DAY)
        drift = rng.uniform(-1e-4, 1e-4) * passed
        step = rng.choice((0.0, 0.0, rng.uniform(0.02, 10.0) * (passed + 1e4)))
        found = elapsed(start, later(passed, passed + drift + step, start))
        if step:
            assert found is None
        else:
            assert found == pytest.approx(min(passed, passed + drift), abs=1e-3)
