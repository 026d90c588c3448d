"""What must hold of every damaged log: nothing hangs, nothing is invented, at most the bad part is lost, and reported."""

from __future__ import annotations

import io
from pathlib import Path
from typing import NamedTuple

from canid.io.logs import open_log
from canid.io.logs.blf.blf_containers import PIECE_BYTES, containers
from canid.values.errors import LogError
from canid.values.frame_columns import frames_of
from canid.values.types import Frame
from tests.damaged_logs.bases import Base
from tests.damaged_logs.mutants import Mutant

# s; two floats of today's epoch, and times that count from a damaged first one 73 years away
_SAME_TIME = 5e-6
Key = tuple[int, int, bytes, int, int]


class Outcome(NamedTuple):
    """What came of one damaged log."""

    kept: int  # frames of parts that are not damaged: all of them were read
    lost: int  # frames of the whole log that were not read
    reported: bool


def check(base: Base, mutant: Mutant, path: Path, *, one_by_one: bool = False) -> Outcome:
    """Write the mutant to `path` and read it. Raises AssertionError where a claim does not hold.

    `one_by_one`: read frames too, and hold them against the columns.
    """
    path.write_bytes(mutant.data)
    intact = _intact(base, mutant)
    try:
        log = open_log(path)
        got = [frame for chunk in log.columns() for frame in frames_of(chunk)]
    except LogError as error:
        said = str(error)
        # a base line that cannot be read is an error for the file: with another base all numbers would be others
        if intact and not ("the base line" in said and mutant.hit[0] < base.header):
            raise AssertionError(f"{len(intact)} frames are whole, and yet: {said}") from error
        if "\n" in said:
            raise AssertionError("an error of more than one line") from error
        return Outcome(0, len(base.frames), True)
    damage = log.damage
    assert log.frames_read == len(got), f"{log.frames_read} frames counted, {len(got)} given"
    assert (damage is None) == (log.damaged == 0), f"{log.damaged} damaged, and yet {damage}"
    if base.suffix != ".blf":
        counted = log.frames_read + log.events_read + log.others + log.damaged
        there = sum(1 for line in mutant.data.split(b"\n") if line.decode("latin-1").strip())
        assert counted == there, f"{there} lines, {counted} counted"
    known = {key(base, frame) for frame in base.frames}
    foreign = sum(key(base, frame) not in known for frame in got)
    assert foreign <= _alterable(base, mutant), f"{foreign} frames that are not in the whole log"
    _in_order(base, mutant, log.start_ns, got, intact)
    lost = len(known) - len({key(base, frame) for frame in got} & known)
    if base.suffix == ".blf" and lost:
        assert damage is not None or len(got) >= len(base.frames) or foreign, (
            f"{lost} frames lost, nothing said"
        )
        assert damage is not None or not base.checked, f"{lost} frames lost, nothing said"
    if damage is not None:
        assert damage.total == -1 or damage.read <= damage.total, damage
        assert damage.says.startswith(f"read {damage.read}"), damage
        ends = [0, *(end for span in damage.spans for end in span)]
        assert ends == sorted(ends), damage
        assert not damage.spans or f"bytes {damage.spans[0][0]}–{damage.spans[0][1]}" in damage.says, damage
    if one_by_one:
        assert list(log) == got, "frame by frame the log is another"
        assert log.damage == damage
    if base.suffix == ".blf":
        _goes_on(mutant.data)
    return Outcome(len(intact), lost, damage is not None)


def key(base: Base, frame: Frame) -> Key:
    """What makes a frame that frame, but for its time."""
    # a candump log names its buses: where a name is damaged, buses have other numbers
    return (0 if base.suffix == ".log" else frame.bus, frame.id, frame.data, frame.flags, frame.length)


def _hit(base: Base, mutant: Mutant) -> list[int]:
    """Which parts are damaged."""
    a, b = mutant.hit
    if base.suffix == ".blf":
        return [k for k, part in enumerate(base.parts) if part.begin < b and part.end > a]
    # with the end of a line goes the next one
    return [k for k, part in enumerate(base.parts) if part.begin <= b and part.end > a]


def _intact(base: Base, mutant: Mutant) -> list[int]:
    """Frames that stand in parts without damage only."""
    bad = {k for part in _hit(base, mutant) for k in base.parts[part].frames}
    bad |= {k for crossing in _torn(base, mutant) for k in crossing}
    return [k for k in range(len(base.frames)) if k not in bad]


def _torn(base: Base, mutant: Mutant) -> list[set[int]]:
    """Frames that begin in one container and end in the next, of each border between containers that was hit."""
    a, b = mutant.hit
    pairs = zip(base.parts[:-1], base.parts[1:], strict=True)
    torn = [
        {*before.frames} & {*behind.frames}
        for before, behind in pairs
        if a <= behind.begin and b >= before.end
    ]
    return [frames for frames in torn if frames]


def _alterable(base: Base, mutant: Mutant) -> int:
    """How many frames may have become others: none where there are checksums.

    But a container that is missing as a whole leaves no trace. The beginning of an object and the end of another
    that fits it then are a frame, which no reader can distinguish from a true one.
    """
    if base.checked:
        return int(bool(_torn(base, mutant)))
    # of a line that is cut there are two pieces
    return sum(len(base.parts[k].frames) for k in _hit(base, mutant)) + 2


def _in_order(base: Base, mutant: Mutant, start_ns: int | None, got: list[Frame], intact: list[int]) -> None:
    """All intact frames are there, in order, at their times."""
    keys = [key(base, frame) for frame in got]
    at, zero = 0, None
    header = mutant.hit[0] < base.header
    for k in intact:
        frame = base.frames[k]
        try:
            at = keys.index(key(base, frame), at)
        except ValueError:
            raise AssertionError(f"frame {k}, which is whole, is not there or not in its place") from None
        if header or start_ns is None:
            # the log's start is damaged: the times between frames are not
            off = got[at].t - frame.t
            zero = off if zero is None else zero
            off -= zero
        else:
            off = (start_ns - base.start_ns) * 1e-9 + got[at].t - frame.t
        assert abs(off) <= _SAME_TIME, f"frame {k} is {off} s off"
        at += 1


class _Counting(io.BytesIO):
    """A file that counts how often it was read."""

    reads = 0

    def read(self, size: int | None = -1, /) -> bytes:
        self.reads += 1
        return super().read(size)


def _goes_on(data: bytes) -> None:
    """The reader of containers gets on with each step, and reads no byte often."""
    file, end, items = _Counting(data), 0, 0
    for item in containers(file, 144, len(data)):
        assert end <= item.at < item.end, f"at byte {item.at} again, after {end}"
        end, items = item.end, items + 1
    assert file.reads <= 8 * (items + 1) + 4 * (len(data) // PIECE_BYTES + 1), f"{file.reads} reads"
