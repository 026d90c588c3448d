"""What programs write behind the last frame or row is no damage; a piece of one is, and so are words between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.table import open_table
from canid.io.logs.log import open_log
from canid.io.logs.log_writer import write_log
from canid.values.types import Frame

FOOTERS = (
    "End of file", "EOF", "-- 1234 records", "(600 rows affected)", "267 packets captured", "Total: 267 frames",
    "*** END ***", "**********", "\x1a", "Samples: 600", "Exported by Logger 1.2, 2026-01-01", "Broken pipe",
    "Dateiende, 12 Zeilen",
)  # fmt: skip
SUMMARIES = (
    "Average,20.1,22.0,35.1,0.0",
    "Min,17,19,30,-1\nMax,23,25,40,1",
    "Total;;600",
    "Statistics\nMean,20,22,35,0",
    "END,,,,",
)
SUFFIXES = (".log", ".asc", ".csv", ".trc")


def written(path: Path, seed: int, n: int = 300) -> str:
    rng = np.random.default_rng(seed)
    frames = [Frame(0.01 * k, 0, int(rng.integers(0x700)), rng.bytes(8)) for k in range(n)]
    if path.suffix == ".csv":
        lines = [f"{round(f.t * 1e6)},{f.id:08X},false,Rx,0,8,{f.data.hex(',').upper()}," for f in frames]
        return "\n".join(["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8", *lines, ""])
    if path.suffix == ".trc":
        lines = [
            f"{k:6d}) {1e3 * f.t:10.1f}  Rx  {f.id:04X}  8  {f.data.hex(' ').upper()} "
            for k, f in enumerate(frames, 1)
        ]
        return "\n".join([";$FILEVERSION=1.1", ";$STARTTIME=46239.4", *lines, ""])
    write_log(path, frames, start_utc=1.7e9)
    return path.read_text()


def table(seed: int, n: int = 300) -> str:
    rng = np.random.default_rng(seed)
    rows = [
        f"{0.1 * k:.1f},{','.join(f'{x:.3f}' for x in np.array([20, 25, 30, 0]) + rng.normal(0, 0.1, 4))}"
        for k in range(n)
    ]
    return "\n".join(["time,pedal,speed [m/s],gap,range_rate", *rows, ""])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_footer_of_a_log_is_no_damage(tmp_path: Path, suffix: str, seed: int) -> None:
    """It is counted as what it is; without its line feed too."""
    text = written(tmp_path / f"a{suffix}", seed)
    for footer in FOOTERS:
        for end in ("\n", ""):
            path = tmp_path / f"b{suffix}"
            path.write_text(text + footer + end)
            log = open_log(path)
            assert sum(len(chunk.t) for chunk in log.columns()) == 300
            assert (log.damage, log.other_kinds.get("footer lines")) == (None, 1), footer


def test_a_footer_of_a_table_is_no_damage(tmp_path: Path, seed: int) -> None:
    """Lines of words, and rows that begin with what they sum up."""
    path = tmp_path / "x.csv"
    for footer in (*FOOTERS, *SUMMARIES):
        path.write_text(table(seed) + footer + "\n")
        opened = open_table(path)
        assert opened.damaged == 0, footer
        assert opened.log.span == (0.0, pytest.approx(29.9))
        assert opened.log.count.others["footer lines"] == len(footer.splitlines() or [footer]), footer


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_piece_of_a_frame_and_words_between_frames_are_damage(
    tmp_path: Path, suffix: str, seed: int
) -> None:
    """A line that is cut anywhere is no footer, nor are words that frames follow, nor is a file of words a log."""
    rng = np.random.default_rng(seed)
    whole = written(tmp_path / f"a{suffix}", seed)
    text = whole.replace("End TriggerBlock\n", "")
    last = text.splitlines()[-1]
    path = tmp_path / f"b{suffix}"
    for cut in rng.integers(4, len(last) - 4, 8).tolist():
        path.write_text(text + last[:cut] + "\n")
        log = open_log(path)
        n = sum(len(chunk.t) for chunk in log.columns())
        assert log.damaged == 1 or n == 301, last[:cut]
        assert "footer lines" not in log.other_kinds
    middle = len(text) // 2
    at = text.index("\n", middle) + 1
    path.write_text(text[:at] + "End of file\n" + text[at:] + "End of file\n")
    log = open_log(path)
    assert sum(len(chunk.t) for chunk in log.columns()) == 300
    assert (log.damaged, log.other_kinds.get("footer lines")) == (1, 1)


def test_a_cut_row_is_damage(tmp_path: Path, seed: int) -> None:
    """At the end, and a word in the place of a time between rows."""
    path, text = tmp_path / "x.csv", table(seed)
    for wrong in ("30.0,20.1,2", "30.0", "3#.0,20.1,22.0,35.1,0.0", "Mean,1,2,3,4\n30.0,20.1,22.0,35.1,0.0"):
        path.write_text(text + wrong + "\n")
        assert open_table(path).damaged == 1, wrong
