"""Error frames in every format that canid writes: class, data and flags, as far as the format has a place for them."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from canid.io.buses import python_can
from canid.io.logs import open_log, write_log
from canid.values.types import Flag, Frame

_KEPT = {
    ".blf": int(Flag.ERROR | Flag.EXTENDED),
    ".asc": int(Flag.ERROR | Flag.EXTENDED),
    ".log": int(Flag.ERROR),
}


def _frames(rng: random.Random, n: int) -> list[Frame]:
    """Error frames among data frames, of all lengths of data."""
    out = []
    for k in range(n):
        bus = k if k < 3 else rng.randrange(3)  # a candump log's interfaces are numbered as they come
        if rng.random() < 0.5:
            out.append(Frame(0.001 * k, bus, rng.randrange(0x800), rng.randbytes(rng.randrange(9))))
            continue
        flags = int(Flag.ERROR) | rng.choice((0, int(Flag.EXTENDED)))
        id_ = rng.choice((0, rng.randrange(0x800), rng.randrange(0x20000000)))
        out.append(Frame(0.001 * k, bus, id_, rng.randbytes(rng.choice((0, 1, 8))), flags))
    return out


@pytest.mark.parametrize("suffix", _KEPT)
def test_error_frames_come_back(suffix: str, tmp_path: Path, seed: int) -> None:
    """Id, data and the flags that the format has come back, in their order; python-can reads as many, of each kind."""
    # a .log numbers its interfaces as they come
    frames = [Frame(0.0, bus, 1, b"") for bus in range(3)] + _frames(random.Random(seed), 500)
    path = tmp_path / f"x{suffix}"
    write_log(path, frames, start_utc=1533224087.0)
    log = open_log(path)
    got = [(f.bus, f.id, f.data, f.flags) for f in log]
    assert got == [(f.bus, f.id, f.data, f.flags & _KEPT[suffix]) for f in frames]
    assert (log.damage, log.damaged) == (None, 0)
    can = python_can.load()
    with can.LogReader(str(path)) as reader:
        theirs = [bool(message.is_error_frame) for message in reader]
    assert len(theirs) == len(frames)
    if suffix != ".log":  # python-can takes a candump line for an error frame only if it is a bus error
        assert theirs == [bool(f.flags & Flag.ERROR) for f in frames]


def test_an_error_frame_without_the_comment_of_its_data_is_one(tmp_path: Path) -> None:
    """Other programs drop comments: what is left is Vector's line, with the id."""
    path = tmp_path / "x.asc"
    write_log(
        path, [Frame(0.0, 0, 0x88, bytes(8), int(Flag.ERROR)), Frame(0.1, 0, 1, b"a")], start_utc=1533224087.0
    )
    text = "".join(
        line for line in path.read_text().splitlines(keepends=True) if "data of the error" not in line
    )
    assert (
        " 1  ErrorFrame Flags = 0x0 CodeExt = 0x0 Code = 0x0 ID = 136 DLC = 8 Position = 0 Length = 0\n"
        in text
    )
    path.write_text(text)
    assert [(f.id, f.data) for f in open_log(path)] == [(0x88, b""), (1, b"a")]
