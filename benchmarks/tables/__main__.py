"""Time to read a table of a million rows, against numpy, pandas, polars and duckdb, and what the pipeline takes after it.

    python -m benchmarks.tables [--rows 1000000]

CPU seconds of this process, the best of three; of `canid` six of eight columns become roles, the others skip theirs too.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import polars as pl

from canid.analysis.drive import drive_reader
from canid.analysis.tables.table import open_table

NAMES = ["time", "pedal", "speed", "gap", "range_rate", "accel", "east", "north"]
USED = NAMES[:6]
# s of CPU for a million rows: what is asked for
WANTED_S = 2.0


def best(work: Callable[[], object]) -> float:
    """CPU seconds, the best of three."""
    taken = []
    for _ in range(3):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return min(taken)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=1_000_000)
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(args.rows)
    values = np.column_stack([t, *(rng.normal(20, 3, args.rows) for _ in NAMES[1:])]).round(3)
    with tempfile.TemporaryDirectory() as name:
        plain, holes, quoted, parquet = (
            Path(name) / x for x in ("a.csv", "holes.csv", "quoted.csv", "a.parquet")
        )
        frame = pd.DataFrame(values, columns=NAMES)
        frame.to_csv(plain, index=False)
        frame.assign(gap=frame["gap"].where(np.arange(args.rows) % 5 == 0)).to_csv(holes, index=False)
        frame.assign(note="a, b").to_csv(quoted, index=False)
        duckdb.sql(f"COPY frame TO '{parquet}' (FORMAT parquet)")
        rows: list[tuple[str, Callable[[], object]]] = [
            ("canid, CSV", lambda: open_table(plain)),
            ("canid, CSV of several rates (empty cells)", lambda: open_table(holes)),
            ("canid, CSV with quoted texts", lambda: open_table(quoted)),
            ("canid, Parquet", lambda: open_table(parquet)),
            ("numpy.loadtxt", lambda: np.loadtxt(plain, delimiter=",", skiprows=1, usecols=range(6))),
            ("pandas.read_csv", lambda: pd.read_csv(plain, usecols=USED)),
            ("polars.read_csv", lambda: pl.read_csv(plain, columns=USED)),
            ("duckdb", lambda: duckdb.sql(f"SELECT {', '.join(USED)} FROM '{plain}'").fetchnumpy()),
        ]
        print(f"{args.rows:,} rows of {len(NAMES)} columns\n\n| | CPU, s |\n|---|---|")
        for what, work in rows:
            taken = best(work)
            over = (
                f" (asked: {WANTED_S:g})"
                if what == "canid, CSV" and taken > WANTED_S * args.rows / 1e6
                else ""
            )
            print(f"| {what} | {taken:.2f}{over} |")
        short = Path(name) / "short.csv"
        frame[:60_000].to_csv(short, index=False)
        table = open_table(short)
        begin = time.process_time()
        drive_reader.read_drive(short, table.vehicle, log=table.log, estimating=False)
        print(f"\nthe pipeline, 10 min at 100 Hz: {time.process_time() - begin:.1f} s")


if __name__ == "__main__":
    main()
