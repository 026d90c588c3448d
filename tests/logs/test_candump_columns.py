"""Lines of candump parsed as arrays are those parsed one by one, whatever stands in them."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from canid.io.logs import candump_columns, open_log
from canid.io.logs.candump_reader import read_candump
from canid.io.logs.frame_lines import MAX_WAITING
from canid.io.logs.line_columns import none_found
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Block
from canid.values.frame_columns import frames_of
from canid.values.types import Frame

# what may stand in a line in the place of another character, and mean something else there
ODD = "0123456789 .,#()RTrtaFgG_-\t\r\x00\x80é"
START = 1_700_000_000


def written(rng: random.Random, k: int) -> str:
    """A line as candump writes it, or with what it seldom has."""
    t = f"({START + k // 100}.{rng.randrange(10**6):06d})" if rng.random() < 0.97 else "(0.000000)"
    bus = rng.choice(("can0", "can1", "vcan12"))
    id_ = f"{rng.randrange(2048):03X}" if rng.random() < 0.6 else f"{rng.randrange(1 << 29):08X}"
    kind, n = rng.random(), rng.choice((8, 8, 8, 3, 0))
    data = rng.randbytes(n).hex().upper()
    if kind < 0.2:
        rest = f"#{rng.randrange(16):X}{rng.randbytes(rng.choice((8, 12, 64))).hex()}"
    elif kind < 0.25:
        rest = f"R{rng.randrange(9)}"
    elif kind < 0.3:
        id_, rest = f"{0x20000000 | rng.randrange(512):08X}", data
    else:
        rest = data
    return f"{t} {bus} {id_}#{rest}{rng.choice(('', '', '', ' R', ' T'))}"


def everything(path: Path) -> tuple[list[Frame], object]:
    """Frames, and what the reading says besides."""
    state = ReadState(path.stat().st_size)
    frames = [frame for chunk in read_candump(path, state) for frame in frames_of(chunk)]
    return frames, (state.damage, state.frames, dict(state.other_kinds), state.start_ns, state.buses)


def check(path: Path, patch: pytest.MonkeyPatch) -> list[Frame]:
    usual = everything(path)
    with patch.context() as slow:
        slow.setattr(candump_columns, "read", lambda block, buses: none_found(len(block.ends)))
        assert everything(path) == usual
    return usual[0]


def test_usual_and_unusual_lines_are_as_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """All kinds of frames, three interfaces, times of 0 between them; the same with characters changed."""
    rng = random.Random(seed)
    lines = [written(rng, k) for k in range(600)]
    path = tmp_path / "drive.log"
    path.write_bytes("\n".join(lines).encode("latin-1"))
    assert len(check(path, monkeypatch)) == 600 - (not lines[-1].endswith((" R", " T")))
    for _ in range(150):
        k = rng.randrange(len(lines))
        at = rng.randrange(len(lines[k]))
        lines[k] = lines[k][:at] + rng.choice(ODD) + lines[k][at + rng.randrange(2) :]
    path.write_bytes(rng.choice(("\n", "\r\n")).join(lines).encode("latin-1"))
    assert 300 < len(check(path, monkeypatch)) < 600


def test_most_usual_lines_are_read_as_arrays(seed: int) -> None:
    """Of a log of two interfaces and all lengths of data every line that is no remote or error frame."""
    rng = random.Random(seed)
    lines = [
        f"({START}.{k:06d}) can{k % 2} {k % 7:03X}#{rng.randbytes(k % 9).hex().upper()}\n" for k in range(900)
    ]
    ends = np.cumsum([len(line) for line in lines])
    block = Block("".join(lines).encode(), ends, 1)
    assert candump_columns.read(block, {"can0": 0, "can1": 1}).found.all()


@pytest.mark.parametrize("zeros", [0, 1, 5, MAX_WAITING, MAX_WAITING + 1])
@pytest.mark.parametrize("then", ["(1700000000.5)", "(0.25)", ""])
def test_frames_without_a_time_at_the_beginning(tmp_path: Path, zeros: int, then: str) -> None:
    """They have the time of the first frame that has one; more than an adapter sends itself: the log counts from 0."""
    lines = ["(0.000000) can0 123#11"] * zeros
    lines += [f"{then} can0 124#22", "(0.000000) can0 125#33", f"{then} can0 126#44"] if then else []
    path = tmp_path / "drive.log"
    path.write_text("".join(line + "\n" for line in lines))
    if not lines:
        return
    log = open_log(path)
    times = [frame.t for frame in log]
    stamped = then.startswith("(17")
    if zeros > MAX_WAITING:
        assert times[:zeros] == [0.0] * zeros
    elif stamped:
        assert times == [0.0] * (zeros + 3)
        assert log.start_ns == 1_700_000_000_500_000_000
    elif then:
        # an own zero: what is stamped 0 was then
        assert times == ([0.0] * zeros + [0.25, 0.0, 0.25] if zeros else [0.0, -0.25, 0.0])
    else:
        assert times == [0.0] * zeros
