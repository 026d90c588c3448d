"""Memory of the client of `canid fleet`: a run that finds nothing new, and the tables of drives with much to say.

    python -m benchmarks fleet_memory [--logs 200000 1000000] [--drives 20000 60000]

The folder's results are synthetic; each measurement is a process of its own, whose peak counts.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.fleet.fleet_runs import machine

LOGS_OF_DRIVER = 100
# bytes of JSON of a drive, as a diagnosis of 20 min has them
JSON_BYTES = 20_000
DRIVES_OF_PART = 4_000
# logs that end in one second
LOGS_PER_S = 20


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks fleet_memory",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--logs", nargs="*", type=int, default=[200_000, 1_000_000], metavar="N")
    parser.add_argument("--drives", nargs="*", type=int, default=[20_000, 60_000], metavar="N")
    args = parser.parse_args(argv)
    print("| what | memory | CPU |\n|---|---|---|")
    for number in args.logs:
        _apart(_nothing_new, number)
    for number in args.drives:
        _apart(_tables, number)
    print(f"| machine | {machine()} | |")
    return 0


def _apart(measure: Callable[[int, Path], None], number: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        child = multiprocessing.get_context("fork").Process(target=measure, args=(number, Path(folder)))
        child.start()
        child.join()


def _resident() -> float:
    """MB."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def _peak() -> float:
    """MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def _nothing_new(number: int, folder: Path) -> None:
    from canid.analysis.fleet.job import Settings
    from canid.analysis.fleet.planning.plan import Plan, PlannedLog
    from canid.analysis.fleet.running import run
    from canid.analysis.fleet.storage import outcome_rows, store

    settings = Settings(diagnosis=False)
    computed, before = outcome_rows.computed(settings), _resident()
    logs = [
        PlannedLog(f"/fleet/driver {k // LOGS_OF_DRIVER:05d}/drive {k:07d}.blf", "/fleet", 1000 + k, k + 1,
                   sys.intern(f"driver {k // LOGS_OF_DRIVER:05d}"), "car", "", "vehicle")
        for k in range(number)
    ]  # fmt: skip
    planned = _resident() - before
    identities = folder / "identities.csv"
    with identities.open("w") as file:
        for log in logs:
            file.write(f"{outcome_rows.identity(log, computed).hex()},{log.size}\n")
    results = folder / "results"
    _apart_written(results / "parts/000001", identities)
    store.note(results, lambda: None)
    begin, cpu = _resident(), time.process_time()
    with store.opened(results) as opened:
        run.run(Plan(logs, {}, ()), opened, settings, lambda _: iter(()))
    print(
        f"| a run of {number:,} logs that finds nothing new: its plan; beyond that at its end; at its peak | "
        f"{planned:.0f}, {_resident() - begin:.0f}, {_peak() - begin:.0f} MB | {time.process_time() - cpu:.0f} s |",
        flush=True,
    )


def _apart_written(part: Path, identities: Path) -> None:
    """In a process of its own: DuckDB's memory is not the client's."""
    child = multiprocessing.get_context("fork").Process(target=_write_outcomes, args=(part, identities))
    child.start()
    child.join()


def _write_outcomes(part: Path, identities: Path) -> None:
    of_log = {
        "identity": "identity",
        "key": "sha256(identity)",
        "bytes": "bytes",
        "status": "'ok'",
        "attempts": "1",
        "analysed_utc": f"strftime(TIMESTAMP '2026-01-01' + to_seconds(bytes // {LOGS_PER_S}), '%Y-%m-%dT%H:%M:%SZ')",
    }
    columns = "{'identity': 'VARCHAR', 'bytes': 'BIGINT'}"
    _write(part, of_log, f"read_csv('{identities}', header = false, columns = {columns})")


def _tables(number: int, folder: Path) -> None:
    from canid.analysis.fleet.storage import consolidated

    parts = -(-number // DRIVES_OF_PART)
    of_drive = {
        "key": "md5(n::VARCHAR)",
        "identify_json": f"repeat(md5(n::VARCHAR) || md5((n + 7)::VARCHAR), {JSON_BYTES // 64})",
    }
    for k in range(parts):
        rows = f"range({k * DRIVES_OF_PART}, {min((k + 1) * DRIVES_OF_PART, number)}) AS of(n)"
        child = multiprocessing.get_context("fork").Process(
            target=_write, args=(folder / f"parts/{k + 1:06d}", of_drive, rows)
        )
        child.start()
        child.join()
    cpu = time.process_time()
    consolidated.written(folder, _logs(number), lambda: None)
    print(
        f"| tables of {number:,} drives with {JSON_BYTES // 1000} kB of results each: peak of the process | "
        f"{_peak():.0f} MB | {time.process_time() - cpu:.1f} s |",
        flush=True,
    )


def _logs(number: int) -> Iterator[dict[str, Any]]:
    from hashlib import md5

    for k in range(number):
        yield {"log": f"/logs/{k}.blf", "driver": "anna", "key": md5(b"%d" % k).hexdigest(), "status": "ok"}


def _write(part: Path, values: dict[str, str], rows: str) -> None:
    """A part with some columns known."""
    import duckdb

    from canid.analysis.fleet.storage import parquet_files
    from canid.analysis.fleet.storage.columns import DRIVES
    from canid.analysis.fleet.storage.outcome_rows import OUTCOMES

    part.mkdir(parents=True)
    with duckdb.connect(config={"threads": 1, "preserve_insertion_order": False}) as db:
        for name, columns in (("drives", DRIVES), ("outcomes", OUTCOMES)):
            chosen = ", ".join(
                f'{values.get(column.name, f"NULL::{column.type}")} AS "{column.name}"' for column in columns
            )
            parquet_files.write(db, f"SELECT {chosen} FROM {rows}", part / f"{name}.parquet")


if __name__ == "__main__":
    sys.exit(main())
