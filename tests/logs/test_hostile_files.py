"""Files made to stop a reader: work grows with the file, no faster, and it is always seen to get on.

Counted are calls, of Python and of C, because seconds on a busy machine say nothing; seconds and memory, and larger
files: `python -m benchmarks.damaged_logs --hostile 4`.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from canid.io.logs import log, open_log
from canid.io.logs.blf.blf_containers import (
    MAX_BREAKS,
    MAX_WASTED_BYTES,
    PIECE_BYTES,
    SEARCH_BYTES,
    Payload,
    containers,
)
from canid.io.logs.blf.blf_layout import MAX_INFLATED_BYTES
from canid.io.logs.reader_state import ReadState
from canid.values.errors import LogError
from tests.damaged_logs.hostile import FAMILIES, write

SIZE = 128 * 1024
# Calls between two advances: some 0.2 s. A block of text lines takes 1,024 lines of up to 60 calls; a payload with
# signatures within its objects 20,000 jumps of ten.
STANDSTILL = 250_000
# Calls per byte of file or of what it holds unpacked, opening it and reading it: a line of two bytes takes some 30.
PER_BYTE = 40
# What is the same for each file, however short
ANY = 50_000
# asammdf has a process of its own, and limits of its own
READ = [name for name in FAMILIES if not name.endswith(".mf4")]


class Counted:
    """How many calls a reading took, in all and at most between two advances."""

    def __init__(self) -> None:
        self.states: list[ReadState] = []
        self.calls = self.longest = self._since = 0
        self._seen = (0, 0, 0)

    def new_state(self, *args: Any, **kwargs: Any) -> ReadState:
        self.states.append(ReadState(*args, **kwargs))
        return self.states[-1]

    def check(self, _frame: FrameType, event: str, _arg: object) -> None:
        if event not in ("call", "c_call"):
            return
        self.calls += 1
        at = (len(self.states), self.states[-1].done, self.states[-1].unpacked) if self.states else self._seen
        if at != self._seen:
            self._seen, self._since = at, self.calls
        self.longest = max(self.longest, self.calls - self._since)


# a guard against hangs, not a promise of speed
@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("name", READ)
def test_a_reader_always_gets_on(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two advances are no more than so many calls, and in all so many for each byte."""
    path = write(name, tmp_path, SIZE)
    counted = Counted()
    monkeypatch.setattr(log, "ReadState", counted.new_state)
    before = sys.getprofile()
    sys.setprofile(counted.check)
    try:
        for _ in open_log(path).columns():
            pass
    except LogError as error:
        assert "\n" not in str(error)  # noqa: PT017
    finally:
        sys.setprofile(before)
    assert counted.longest <= STANDSTILL
    assert counted.calls <= PER_BYTE * SIZE + ANY


class Reads(io.BytesIO):
    """A file that counts the bytes that were read."""

    took = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.took += len(data)
        return data


@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("name", [name for name in READ if name.endswith(".blf")])
def test_no_byte_is_read_without_end(name: str, tmp_path: Path) -> None:
    """Each piece of the file costs no more than what may be spent in vain on it; the reader ends where the file does."""
    data = write(name, tmp_path, 1024 * 1024).read_bytes()
    file = Reads(data)
    end = 0
    for item in containers(file, 144, len(data)):
        assert end <= item.at < item.end
        if isinstance(item, Payload):
            assert len(item.data) <= MAX_INFLATED_BYTES
        else:
            assert item.end - item.at <= SEARCH_BYTES + PIECE_BYTES
        end = item.end
    # each attempt reads a window, searches in another, and ends in a third; what is unpacked has a bound of its own
    assert file.took <= (len(data) // PIECE_BYTES + 2) * (
        MAX_WASTED_BYTES + MAX_INFLATED_BYTES + 3 * MAX_BREAKS * PIECE_BYTES
    )


@pytest.mark.slow("many logs, written and read")
def test_a_gzip_bomb_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What unpacks to so many times its size is no log: what came before is kept, and it is reported."""
    from canid.io.logs import text_lines

    monkeypatch.setattr(text_lines, "MIN_BOMB_BYTES", 8 * text_lines.BLOCK_BYTES)
    path = write("empty.asc.gz", tmp_path, 64 * text_lines.BLOCK_BYTES)
    reading = open_log(path)
    assert sum(len(chunk.t) for chunk in reading.columns()) == 1
    assert reading.damage is not None
    assert f"more than {text_lines.MAX_UNPACKED_RATIO} times its size" in reading.damage.says


@pytest.mark.parametrize(
    "line",
    [
        "1" * 5000 + ".5 1 123 Rx d 1 00",
        "// start, epoch ns: " + "1" * 5000,
        "// " + "1" * 5000 + ".5 canid bus_lost: x",
        "0.5 1 123 Rx d " + "1" * 5000 + " 00",
    ],
)
def test_numbers_without_end(line: str, tmp_path: Path) -> None:
    """Digits that no integer is made of cost their line only."""
    path = tmp_path / "x.asc"
    path.write_text(f"base hex  timestamps absolute\n0.1 1 123 Rx d 1 00\n{line}\n0.2 1 124 Rx d 1 00\n")
    notes: list[Any] = []
    assert [int(k) for chunk in open_log(path).columns(notes=notes) for k in chunk.id] == [0x123, 0x124]
