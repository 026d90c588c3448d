"""The reading benchmark runs, and its synthetic log is what its page says."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections import Counter
from pathlib import Path

from benchmarks.reading import drives, synthetic
from canid.io.logs import open_log, write_log

ROOT = Path(__file__).parents[2]


def test_the_synthetic_log_is_as_described() -> None:
    """2,000 frames/s of 12 ids; the four wanted ones at 100 Hz carry 23 signals."""
    frames = list(itertools.islice(synthetic.frames(2), 4_000))
    counts = Counter(frame.id for frame in frames)
    assert len(counts) == 12
    assert [counts[id_] for id_ in synthetic.WANTED] == [200] * 4
    assert frames[-1].t < 2.0 <= frames[-1].t + 0.001
    assert len(synthetic.vehicle().roles) == 23


def test_it_prints_its_tables() -> None:
    """A small log through python-can with cantools, through canid, and through zlib and libdeflate alone."""
    command = [sys.executable, "-m", "benchmarks.reading", "--frames", "8000", "--rounds", "1", "--mf4", "0"]
    done = subprocess.run(
        [*command, "--data", "nowhere"], cwd=ROOT, capture_output=True, text=True, check=True, timeout=600
    )
    files = "synthetic.blf", "synthetic.asc", "synthetic, base dec.asc"
    for line in (*files, "columns and signals", "zlib inflate alone", "libdeflate inflate alone"):
        assert line in done.stdout
    assert done.stdout.count("9,200 values") == len(files)


def test_decimal_numbers_are_the_same_log(tmp_path: Path) -> None:
    """The .asc with decimal numbers holds the frames that the other one holds."""
    plain, decimal = tmp_path / "plain.asc", tmp_path / "decimal.asc"
    synthetic.write(plain, synthetic.frames(1))
    synthetic.write_decimal(decimal, synthetic.frames(1))
    assert list(open_log(decimal)) == list(open_log(plain))


def test_a_busy_bus_holds_the_drive(tmp_path: Path) -> None:
    """The hour's log is the drive's frames among others, in the order of their times, at the stated rate."""
    drive, busy = tmp_path / "drive.blf", tmp_path / "busy.blf"
    known = [frame for frame in open_log(ROOT / "replay_logs" / "following_urban.blf") if frame.t < 10]
    write_log(drive, known, 1.7e9)
    n = drives.busy(busy, drive)
    frames = list(open_log(busy))
    assert n == len(frames)
    assert abs(n / frames[-1].t - 2_000) < 5
    assert [frame for frame in frames if frame.id not in drives.OTHERS] == known
    assert all(a.t <= b.t for a, b in itertools.pairwise(frames))
