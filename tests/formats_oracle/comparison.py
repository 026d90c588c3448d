"""What canid reads of a written file, against what was written: an empty list, or what differs."""

from __future__ import annotations

from pathlib import Path

from canid.io.logs import open_log
from canid.io.logs.log import Log
from canid.values.errors import CanidError
from canid.values.frame_columns import frames_of
from canid.values.types import Flag, Frame
from tests.formats_oracle.written import MARKS, Written, WrittenFrame

_MOST = 3  # differences of frames that are listed


def differences(written: Written, path: Path) -> list[str]:
    """Write the file at `path`, which has the right suffix, and read it.

    Args:
        written: from a generator.
        path: of a file that is replaced.
    """
    path.write_bytes(written.content)
    try:
        log = open_log(path, time_zone=written.zone)
        found = [read(frame) for chunk in log.columns() for frame in frames_of(chunk)]
    except CanidError as error:
        return [f"refused: {error}"] if written.frames else []
    says = _frames(written.frames, found)
    counts = (log.events_read, log.others, log.damaged)
    if counts != written.counts:
        said = f"; {log.damage.says}" if log.damage else ""
        says.append(f"events, of no interest, damaged: {counts}, written {tuple(written.counts)}{said}")
    if found and log.start_ns != written.start_ns:
        says.append(f"start {log.start_ns}, written {written.start_ns}")
    return says


def opened(written: Written, path: Path) -> Log:
    """The file, written and opened."""
    path.write_bytes(written.content)
    return open_log(path, time_zone=written.zone)


def _frames(written: tuple[WrittenFrame, ...], found: list[WrittenFrame]) -> list[str]:
    pairs = zip(written, found, strict=False)
    says = [f"frame {k}: {got}, written {one}" for k, (one, got) in enumerate(pairs) if one != got][:_MOST]
    if len(written) != len(found):
        says.append(f"{len(found)} frames, written {len(written)}")
    return says


def read(frame: Frame) -> WrittenFrame:
    """A frame of canid in the words of the generators."""
    flags = Flag(frame.flags)
    marks = frozenset(mark for mark in MARKS if Flag[mark.upper()] & flags)
    return WrittenFrame(
        round(frame.t * 1e9),
        frame.bus,
        frame.id,
        bool(flags & Flag.EXTENDED),
        frame.data,
        marks,
        bool(flags & Flag.TX),
        frame.length if flags & Flag.REMOTE else -1,
    )
