"""A million logs: listing and planning them, and questions to their tables.

    python -m benchmarks fleet_million [--logs 100000 1000000] [--folder /dev/shm]

The logs are files of some bytes in folders of 100, made first; the table of drives is synthetic, with all its columns. Times
are of the CPU and of the clock; memory is that of the process.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.fleet.fleet_runs import machine

LOGS_OF_DRIVER = 100
CARS = 10
QUESTIONS = (
    "SELECT driver, count(*) AS n, avg(range_rate_K) AS K FROM drives GROUP BY driver ORDER BY K DESC LIMIT 20",
    "SELECT car, status, count(*) AS n FROM drives GROUP BY ALL",
    "SELECT corr(range_rate_K, fit_percent) FROM drives WHERE usable > 300 AND fit_percent > 50",
)
_PLAN = """
import resource, sys, time
from canid.analysis.fleet.planning.plan import planned
before, began, cpu = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter(), time.process_time()
plan = planned([sys.argv[1]], vehicle="generic")
took = time.perf_counter() - began, time.process_time() - cpu
print(len(plan.logs), *took, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024)
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks fleet_million",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--logs", nargs="+", type=int, default=[100_000, 1_000_000], metavar="N")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where the files are made")
    args = parser.parse_args(argv)
    print("| what | clock | CPU | memory |\n|---|---|---|---|")
    for number in args.logs:
        with tempfile.TemporaryDirectory(dir=args.folder) as made:
            logs, tables = Path(made) / "logs", Path(made) / "tables"
            _make_logs(logs, number)
            done = subprocess.run(
                [sys.executable, "-c", _PLAN, str(logs)], capture_output=True, text=True, check=True
            )
            found, clock, cpu, grown = map(float, done.stdout.split())
            each = f"{cpu / found * 1e6:.0f} µs, {grown / found:.0f} B a log"
            print(
                f"| listing and planning {found:,.0f} logs ({each}) | {clock:.1f} s | {cpu:.1f} s | {grown / 1e6:.0f} MB |"
            )
            shutil.rmtree(logs)
            tables.mkdir()
            _make_tables(tables, number)
            for sql in QUESTIONS:
                clock, cpu = _asked(tables, sql)
                print(f"| {sql[:60]}… of {number:,} drives | {clock:.2f} s | {cpu:.2f} s | |")
    print(
        f"| machine | {machine()} | peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB | |"
    )
    return 0


def _make_logs(folder: Path, number: int) -> None:
    for driver in range(-(-number // LOGS_OF_DRIVER)):
        of = folder / f"car {driver % CARS}" / f"driver {driver:05d}"
        of.mkdir(parents=True)
        for k in range(min(LOGS_OF_DRIVER, number - driver * LOGS_OF_DRIVER)):
            fd = os.open(of / f"drive {k:03d}.blf", os.O_CREAT | os.O_WRONLY)
            os.write(fd, b"%d %d" % (driver, k))
            os.close(fd)


def _make_tables(folder: Path, number: int) -> None:
    """`logs.parquet` and `drives.parquet` with every column that `canid fleet` writes."""
    import duckdb

    from canid.analysis.fleet.storage.columns import DRIVES, LOGS
    from canid.analysis.fleet.storage.consolidated import OF_THE_LOG
    from canid.analysis.fleet.storage.generations import NOTE

    of_log = tuple(column for column in LOGS if column.name in OF_THE_LOG)
    for name, columns in (("logs", LOGS), ("drives", (*of_log, *DRIVES))):
        chosen = ", ".join(f'{_value(column.name, column.type)} AS "{column.name}"' for column in columns)
        with duckdb.connect() as db:
            db.execute(
                f"COPY (SELECT {chosen} FROM range({number}) AS of(n)) TO '{folder / name}.parquet' "
                # of one generation, as a run writes them: those without are compared by their bytes
                f"(FORMAT parquet, COMPRESSION zstd, KV_METADATA {{{NOTE}: 'synthetic'}})"
            )


def _value(name: str, kind: str) -> str:
    named = {
        "key": "md5(n::VARCHAR)",
        "driver": f"'driver ' || (n // {LOGS_OF_DRIVER})",
        "car": f"'car ' || (n % {CARS})",
        "status": "CASE WHEN n % 50 = 0 THEN 'failed' ELSE 'ok' END",
        "duplicate_of": "NULL::VARCHAR",
        "log": "'/logs/' || n || '.blf'",
    }
    if name in named:
        return named[name]
    return f"(random() * 100)::{kind}" if kind in ("DOUBLE", "BIGINT", "INTEGER") else f"NULL::{kind}"


def _asked(folder: Path, sql: str) -> tuple[float, float]:
    from canid.analysis.fleet.storage.database import opened, rows

    clock, cpu = time.perf_counter(), time.process_time()
    with opened(folder) as db:
        rows(db, sql)
    return time.perf_counter() - clock, time.process_time() - cpu


if __name__ == "__main__":
    sys.exit(main())
