"""Logs that hold frames twice are read as those that hold them once, and it is said; chance makes no copies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.io.logs import copies as module
from canid.io.logs.copies import Copies
from canid.io.logs.log import open_log
from canid.io.logs.log_writer import write_log
from canid.values.frame_columns import columns_of, frames_of
from canid.values.types import Frame

START = 1_785_924_000.0


def drive(seed: int, n: int = 3000, *, static: bool = False, grid: float = 1e-6) -> list[Frame]:
    """Frames of some ids with periods of their own, in order; some data change from frame to frame."""
    rng = np.random.default_rng(seed)
    ids = rng.choice(0x700, 6, replace=False).tolist()
    t = np.sort(
        np.concatenate(
            [rng.uniform(0, 0.1) + period * np.arange(n // 6) for period in rng.uniform(0.01, 0.02, 6)]
        )
    )
    first = {id_: rng.bytes(8) for id_ in ids}
    out = []
    for at in np.unique(np.round(t / 1e-6) * 1e-6).round(6).tolist():
        id_ = ids[int(rng.integers(6))]
        data = first[id_] if static or rng.random() < 0.3 else rng.bytes(int(rng.integers(1, 9)))
        out.append(Frame(round(round(at / grid) * grid, 6), 0, id_, data))
    return out


def lines(path: Path, frames: list[Frame]) -> list[str]:
    write_log(path, frames, start_utc=START)
    return path.read_text().splitlines(keepends=True)


def twice(kind: str, one: list[str], rng: np.random.Generator) -> list[str]:
    n = len(one)
    a = int(rng.integers(200, n - 600))
    b = int(rng.integers(a + 300, n - 200))
    return {
        "appended": one + one,
        "three times": one * 3,
        "each line": [line for line in one for _ in (0, 1)],
        "merged for a part": one[:a] + [line for line in one[a:b] for _ in (0, 1)] + one[b:],
        "files that overlap": one[:b] + one[a - 150 :],
    }[kind]


@pytest.mark.parametrize(
    "kind", ["appended", "three times", "each line", "merged for a part", "files that overlap"]
)
@pytest.mark.parametrize("block", [0, 3000])
def test_a_log_that_holds_frames_twice(
    tmp_path: Path, kind: str, block: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its frames are those of the log that holds them once, whatever its chunks are; the copies are counted and said."""
    if block:
        monkeypatch.setattr("canid.io.logs.text_lines.BLOCK_BYTES", block)
    frames = drive(seed)
    one = lines(tmp_path / "one.log", frames)
    path = tmp_path / "two.log"
    many = twice(kind, one, np.random.default_rng(seed))
    path.write_text("".join(many))
    log = open_log(path)
    expected = list(open_log(tmp_path / "one.log"))
    got = list(log)
    if block:  # pairs that begin within a short chunk are too few to be shown
        assert len(got) <= len(expected) + 50
        got = list(dict.fromkeys(got))
    assert got == expected
    more = len(many) - log.frames_read
    assert log.frames_read <= len(one) + (50 if block else 0)
    assert log.other_kinds == {"copies of frames": more}
    assert [says for says in log.remarks if says.startswith(f"{more:,} frames are copies")]
    assert log.damage is None


@pytest.mark.parametrize("kind", ["static data", "stamps of 10 ms", "another drive", "one clock set back"])
def test_chance_makes_no_copies(tmp_path: Path, kind: str, seed: int) -> None:
    """Static data, coarse stamps, bursts with one stamp, a second drive at the same times: every frame is kept."""
    frames = drive(seed, static=kind == "static data", grid=0.01 if kind == "stamps of 10 ms" else 1e-6)
    one = lines(tmp_path / "one.log", frames)
    if kind == "static data":
        one = [line for line in one for _ in (0, 1)]
    if kind == "another drive":
        one += lines(
            tmp_path / "b.log", [frame._replace(data=bytes([k % 251])) for k, frame in enumerate(frames)]
        )
    if kind == "one clock set back":
        one += lines(tmp_path / "b.log", [frame._replace(t=frame.t + 3.0) for frame in drive(seed + 1)])
    path = tmp_path / "two.log"
    path.write_text("".join(one))
    log = open_log(path)
    assert sum(len(chunk.t) for chunk in log.columns()) == len(one)
    assert not log.remarks


def test_marks_of_a_long_log_are_bounded(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Where only some frames are remembered, a log that is appended to itself is still read once."""
    monkeypatch.setattr(module, "_MAX_MARKS", 4000)
    frames = drive(seed, 30_000)
    copies = Copies()
    parts = [copies.step(columns_of(frames[k : k + 700])) for _ in (0, 1) for k in range(0, len(frames), 700)]
    parts += copies.end()
    assert sum(len(part.marks) for part in copies._parts) <= 4000
    assert [frame for part in parts for frame in frames_of(part)] == frames


def test_events_stand_where_they_stood(tmp_path: Path, seed: int) -> None:
    """The events of a recording that was appended to itself come before the same frames as in the recording."""
    from canid.io.logs.reader_state import Note
    from canid.values.types import Event

    frames = drive(seed, 600)
    path = tmp_path / "a.asc"
    write_log(path, frames, start_utc=START)
    text = path.read_text().splitlines(keepends=True)
    at = len(text) // 2
    text.insert(at, f"// {frames[300].t:.6f} canid marker: here\n")
    path.write_text("".join(text))
    notes: list[Note] = []
    first = sum(len(chunk.t) for chunk in open_log(path).columns(notes=notes))
    path.write_text("".join(text + text))
    again: list[Note] = []
    assert sum(len(chunk.t) for chunk in open_log(path).columns(notes=again)) == first
    assert again[0] == notes[0]
    assert again[0].event == Event(again[0].event.t, "marker", "here")
