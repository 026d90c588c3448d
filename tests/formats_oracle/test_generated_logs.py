"""Every log that a format's description allows is read as it was written: frames, times, start, and the account of lines.

The generators know the frames before they write them, and share no code with canid or python-can.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.formats_oracle.comparison import differences, opened, read
from tests.formats_oracle.generators import GENERATORS

FILES = 200


@pytest.mark.slow("200 files of each format")
@pytest.mark.parametrize("name", GENERATORS)
def test_200_files_are_read_as_written(name: str, tmp_path: Path, seed: int) -> None:
    """`python -m benchmarks formats --files 10000` reads more of them."""
    for k in range(FILES):
        written = GENERATORS[name](random.Random(f"{seed} {k}"))
        assert differences(written, tmp_path / f"drive{written.suffix}") == [], (seed, k, written.properties)


@pytest.mark.parametrize("name", GENERATORS)
def test_some_files_are_read_as_written(name: str, tmp_path: Path) -> None:
    for k in range(20):
        written = GENERATORS[name](random.Random(f"some {k}"))
        assert differences(written, tmp_path / f"drive{written.suffix}") == [], (k, written.properties)


@pytest.mark.parametrize("name", GENERATORS)
def test_frames_one_by_one_are_those_of_the_columns(name: str, tmp_path: Path) -> None:
    for k in range(5):
        written = GENERATORS[name](random.Random(f"singly {k}"))
        log = opened(written, tmp_path / f"drive{written.suffix}")
        assert tuple(read(frame) for frame in log) == written.frames, (k, written.properties)


@pytest.mark.parametrize("name", GENERATORS)
def test_wanted_ids_have_the_same_times(name: str, tmp_path: Path) -> None:
    """Where a log is joined, times of the second do not depend on the frames that are asked for."""
    for k in range(20):
        written = GENERATORS[name](random.Random(f"wanted {k}"))
        log = opened(written, tmp_path / f"drive{written.suffix}")
        wanted = written.frames[-1].id
        times = [
            round(float(t) * 1e9)
            for chunk in log.columns([wanted])
            for t, number in zip(chunk.t, chunk.id, strict=True)
            if number == wanted
        ]
        assert times == [frame.ns for frame in written.frames if frame.id == wanted], (k, written.properties)


def test_a_comparison_finds_what_differs(tmp_path: Path) -> None:
    """Each field of a frame, a count and the start: a generator that says otherwise is found."""
    written = GENERATORS["trc"](random.Random("other"))
    path = tmp_path / f"drive{written.suffix}"
    first, *rest = written.frames
    others = (
        first._replace(bus=7), first._replace(id=first.id ^ 1), first._replace(extended=not first.extended),
        first._replace(data=first.data + b"x"), first._replace(marks=frozenset({"error"})),
        first._replace(sent=not first.sent), first._replace(ns=1),
    )  # fmt: skip
    for other in others:
        assert differences(written._replace(frames=(other, *rest)), path)
    assert differences(written._replace(frames=written.frames[:-1]), path)
    assert differences(written._replace(counts=written.counts._replace(others=0)), path)
    assert differences(written._replace(start_ns=5), path)
    assert not differences(written, path)
