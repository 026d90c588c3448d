"""A file with a name as long as a system allows gets its journal, its copies and its temporary files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from canid.io.files.derived_name import MAX_NAME_BYTES, derived, short_stem
from canid.io.logs import open_log, write_log
from canid.io.logs.log_writer import open_new
from canid.io.logs.recovery import recover
from canid.io.recording.file_series import Series
from canid.io.recording.journal import journal_path
from canid.io.recording.log_restoration import restore
from canid.io.recording.rotation import Rotation
from canid.ui.cli import main
from canid.values.types import Frame

_FRAMES = [Frame(0.0, 0, 1, b"a"), Frame(0.5, 0, 1, b"b")]


def _name(size: int, letter: str) -> str:
    stem = letter * ((size - 4) // len(letter.encode()))
    return stem + "y" * (size - 4 - len(stem.encode())) + ".blf"


@pytest.mark.parametrize("size", [200, 230, 240, 250, 255])
@pytest.mark.parametrize("letter", ["x", "ä", "漢", "🚗"])
def test_names_that_are_derived_can_be_created(size: int, letter: str, tmp_path: Path) -> None:
    """Log, second log, journal, restored and recovered copy, the files of a ring and its list."""
    path = tmp_path / _name(size, letter)
    assert len(os.fsencode(path.name)) == size
    for _ in range(3):
        writer = open_new(path)
        writer.append(_FRAMES[0])
        writer.close()
    journal_path(path).touch(exist_ok=False)
    restored = restore(open_new(path).disk, path, [])
    assert restored.path is not None
    found = recover(path)
    assert [frame.data for frame in open_log(found.path)] == [b"a"]
    series = Series(path, Rotation(size=100_000, keep_time=100.0))
    for _ in range(2):
        writer = series.open_next()
        journal_path(writer.path).touch(exist_ok=False)
        writer.close()
    assert series.prune() == []
    series.close()
    again = Series(path, Rotation(size=100_000, keep_time=100.0))
    assert len(again._list.entries) == 2  # found again by the next session
    again.close()


def test_names_of_reports_and_exports_can_be_created(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What verbs call a file after a log with a long name."""
    path = tmp_path / _name(255, "ü")
    write_log(path, _FRAMES)
    assert main(["recover", str(path)]) == 0
    assert main(["simulate", str(tmp_path / _name(255, "z")), "--minutes", "0.1"]) == 0
    assert "too long" not in capsys.readouterr().err


def test_a_short_name_is_as_it_was_and_two_long_ones_differ() -> None:
    """The end of a long stem decides as well."""
    assert derived("drive", ".events.jsonl") == "drive.events.jsonl"
    a, b = (derived("x" * 250 + last, ".events.jsonl") for last in "ab")
    assert a != b
    assert len(a) == len(b) == MAX_NAME_BYTES
    assert short_stem("x" * 207, 48) == "x" * 207
