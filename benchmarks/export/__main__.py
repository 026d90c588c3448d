"""Wall time, CPU and memory of `canid export`, and ratios against other ways to the same file.

    python -m benchmarks.export [--data ../shared/data] [--rounds 3] [--rows 1000000]
    python -m benchmarks.export --memory [--minutes 120] [--log LOG]

First table: whole processes, start included, for a drive of three minutes with estimates and (where the data are) for a
minute of a real car with 135,000 frames and every DBC signal. Second table, in this process: CSV of a million rows against
pandas, and every DBC signal against python-can with cantools and against asammdf.
--memory: the largest memory of a process that exports every signal of a log of two hours with 2,000 frames/s; with --log
the log is kept there for the next time.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
import asammdf
import cantools
import numpy as np
import pandas as pd

from benchmarks.reading import peers, synthetic
from benchmarks.reading.cost import Child, child, cpu
from canid.analysis.drive.signal_columns import frames_by_message
from canid.analysis.export import csv_table, signal_tables
from canid.analysis.export.table import Field, Origin, of_columns
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle.database import load

ROOT = Path(__file__).parents[2]
FORMATS = ("csv", "parquet", "mat", "mf4", "mcap")
# s, start included: what is asked for of a log of 222 s. By processor time: other programs only add to wall time
WANTED_S = 2.0
# frames of the log for asammdf, which reads .mf4 alone
SECONDS = 60


def processes(words: list[object], folder: Path, rounds: int, wanted: float = WANTED_S) -> None:
    """One line for each format: the best of some processes."""
    print("| format | wall, s | CPU, s | memory, MB | size, MB |\n|---|---|---|---|---|")
    for to in FORMATS:
        best: tuple[float, Child] | None = None
        for _ in range(rounds):
            for old in folder.glob("x*"):
                old.unlink()
            begin = time.perf_counter()
            ran = child("canid", "export", *map(str, words), "--to", to, "-o", folder / "x")
            wall = time.perf_counter() - begin
            best = (wall, ran) if best is None or wall < best[0] else best
        assert best is not None
        wall, ran = best
        size = sum(path.stat().st_size for path in folder.glob("x*")) / 1e6
        over = "" if ran.cpu <= wanted else f" (asked: {wanted:g})"
        print(f"| {to} | {wall:.2f} | {ran.cpu:.2f}{over} | {ran.peak:.0f} | {size:.1f} |", flush=True)


def ratio(what: str, own: float, other: float) -> None:
    print(f"| {what} | {own:.3f} | {other:.3f} | {other / own:.1f} |", flush=True)


def in_process(folder: Path, rows: int, rounds: int) -> None:
    print("\n| CPU, s | canid | peer | peer / canid |\n|---|---|---|---|")
    random = np.random.default_rng(1)
    t = np.arange(rows) * 0.01
    columns = {f"c{k}": random.standard_normal(rows).round(3 + k) for k in range(10)}
    table = of_columns("samples", "", t, [(Field(name, "m"), values) for name, values in columns.items()])

    def own_csv() -> int:
        with (folder / "own.csv").open("wb") as file:
            return sum(file.write(piece) for piece in csv_table.lines(table, Origin("x", None)))

    frame = pd.DataFrame({"t": t} | columns)
    own, _ = cpu(own_csv, rounds)
    other, _ = cpu(lambda: frame.to_csv(folder / "pandas.csv", index=False) or 1, 1)
    ratio(f"CSV, {rows:,} rows of 11 columns: pandas.to_csv", own, other)

    log, dbc = folder / "drive.blf", synthetic.HERE / "drive.dbc"
    write_log(log, synthetic.frames(SECONDS), synthetic.START)
    own, n = cpu(every_signal(log, dbc), rounds)
    messages = {(0, m.frame_id): m for m in cantools.database.load_file(dbc, strict=False).messages}
    other, (_, decoded) = cpu(peers.python_can_and_cantools(log, messages), 1)
    ratio(f"every signal of {decoded:,} frames decoded: python-can + cantools", own, other)
    mf4 = folder / "drive.mf4"
    synthetic.write(mf4, synthetic.frames(SECONDS))
    other, m = cpu(asammdf_values(mf4, dbc), 1)
    assert m == n, (m, n)
    ratio(f"the same, {n:,} values: asammdf {asammdf.__version__}, from .mf4", own, other)


def every_signal(log: Path, dbc: Path) -> Callable[[], int]:
    """Read a log and decode every signal of a DBC; returns how many values."""

    def run() -> int:
        with Parser() as parser:
            database, _, _ = load(dbc, None, parser)
        found = signal_tables.received(frames_by_message(open_log(log)), [database])
        tables = signal_tables.signal_tables(found)
        return sum(
            len(values)
            for table in tables
            for field, values in zip(table.fields, table.values(slice(None)), strict=True)
            if field.kind != "text"
        )

    return run


def asammdf_values(log: Path, dbc: Path) -> Callable[[], int]:
    """The same by asammdf, each channel once; returns how many values."""

    def run() -> int:
        with asammdf.MDF(log) as file:
            signals = file.extract_bus_logging({"CAN": [(dbc, 0)]}, ignore_value2text_conversion=True)
            n = sum(
                len(signals.get(group=k, index=i, raw=True))
                for k, group in enumerate(signals.groups)
                for i in range(1, len(group.channels))
            )
            signals.close()
        return n

    return run


def memory(folder: Path, minutes: float, log: Path | None) -> None:
    path = folder / "long.blf" if log is None else log
    if not path.exists():
        write_log(path, synthetic.frames(int(60 * minutes)), synthetic.START)
    size = path.stat().st_size / 1e6
    print(f"{minutes:g} min, {2000 * 60 * minutes:,.0f} frames, {size:.0f} MB; every signal of its DBC\n")
    processes([path, "--dbc", synthetic.HERE / "drive.dbc"], folder, 1, float("inf"))


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.export")
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--log", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if args.memory:
            memory(folder, args.minutes, args.log)
            return 0
        drives: list[tuple[str, list[object]]] = [
            (
                "178 s, samples and estimates",
                [ROOT / "replay_logs/following_urban.blf", "--vehicle", "generic"],
            )
        ]
        follower = args.data / "openacc/human_h22_v5.blf"
        if follower.exists():
            drives.append(
                ("221 s of a real drive, samples and estimates", [follower, "--vehicle", "openacc"])
            )
        car = args.data / "rav4"
        if car.is_dir():
            dbc = sorted(car.glob("*.dbc"))
            drives.append(("60 s of a real car, every DBC signal", [car / "rav4_highway.blf", "--dbc", *dbc]))
        for title, words in drives:
            print(f"\n{title}\n")
            processes(words, folder, args.rounds)
        in_process(folder, args.rows, args.rounds)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
