"""Attacks by numbers: logs whose numbers no column can hold, and files that unpack, or count, beyond all measure."""

from __future__ import annotations

import gzip
import math
import os
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.io.logs import open_log, write_log
from canid.values.errors import LogError
from canid.values.types import Flag, Frame
from tests.damaged_logs.numbers import EDGES, MAX_STANDARD, SUFFIXES, Numbers, log

PROMISE = "a number that its column cannot hold is damage, and no file costs more than 512 MB or hangs a verb"
LOGS = 120  # in a round, read in this process
_BUSES = 70_000
# bytes of address space of a verb, libraries included, and s of CPU: far beyond what it needs, far below the bombs
_MAX_BYTES, _MAX_CPU_S = 2 << 30, 60
_MAX_MB = 512


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Logs with random numbers, and one bomb by a verb."""
    wrong: list[str] = []
    for _ in range(LOGS):
        suffix, relative = rng.choice(SUFFIXES), rng.random() < 0.5
        lines = [
            Numbers(
                _any(rng, 10_000), _any(rng, 900), _any(rng, MAX_STANDARD), rng.random() < 0.5, _any(rng, 8)
            )
            for _ in range(rng.randint(1, 60))
        ]
        data, expected = log(suffix, lines, relative)
        path = folder / f"x{suffix}"
        path.write_bytes(data)
        wrong += [f"{suffix}: {text}" for text in _judged(path, expected)]
    yield Outcome(
        "times, ids, buses and lengths of any size: all text formats and .blf",
        math.nan,
        0,
        "; ".join(wrong),
        LOGS,
    )
    name = rng.choice(sorted(_BOMBS))
    path = folder / name
    _BOMBS[name](path, rng)
    verb = rng.choice((("look",), ("check",), ("recover",))) if path.suffix != ".parquet" else ("check",)
    yield Outcome(
        "a bomb by a verb, with limits of memory and time", math.nan, 0, _run(verb[0], path, folder)
    )


def _any(rng: random.Random, limit: int) -> int:
    kind = rng.randrange(8)
    return rng.choice(EDGES) if kind == 0 else rng.getrandbits(70) if kind == 1 else rng.randint(0, limit)


def _judged(path: Path, expected: list[Numbers | None]) -> list[str]:
    wanted = [(one.bus, one.id, one.extended, one.length) for one in expected if one is not None]
    try:
        opened = open_log(path)
        high = int(Flag.EXTENDED | Flag.ERROR)
        got = [(f.bus, f.id, bool(f.flags & high), len(f.data)) for f in opened]
        damaged = opened.damaged
    except LogError:
        got, damaged = [], len(expected)
    if got != wanted:
        return [f"{len(got)} frames are not the {len(wanted)} that can be"]
    if damaged != len(expected) - len(wanted):
        return [f"{damaged} damaged, of {len(expected) - len(wanted)}"]
    return []


def _interfaces(path: Path, rng: random.Random) -> None:
    path.write_text(
        "".join(f"({1.7e9 + k:.6f}) c{k} 123#{k % 256:02X}\n" for k in range(_BUSES)), encoding="utf-8"
    )


def _buses(path: Path, rng: random.Random) -> None:
    write_log(path, [Frame(0.001 * k, k, 0x110, bytes([k % 256])) for k in range(0xFFFF)], start_utc=1.7e9)


def _blanks(path: Path, rng: random.Random) -> None:
    blank = rng.choice((b"\n", b" \n", b"\r\n", b"\t\t\n"))
    path.write_bytes(
        gzip.compress(b"(1700000000.000000) can0 123#00\n" + blank * ((256 << 20) // len(blank)), 9)
    )


def _texts(path: Path, rng: random.Random) -> None:
    import duckdb

    size, rows = rng.randint(500_000, 900_000), rng.randint(1000, 4000)
    columns = "i * 0.1 AS time, 20.0 AS speed, 30.0 AS gap, 0.0 AS range_rate, 0.1 AS accel"
    text = f"repeat('x', {size}) AS note, repeat('y', {size}) AS lead_id"
    query = f"COPY (SELECT {columns}, {text} FROM range({rows}) t(i)) TO '{path}' (FORMAT PARQUET, COMPRESSION ZSTD)"
    duckdb.connect().execute(query)


_BOMBS: dict[str, Callable[[Path, random.Random], None]] = {
    "interfaces.log": _interfaces,
    "buses.blf": _buses,
    "blanks.log.gz": _blanks,
    "texts.parquet": _texts,
}
# what a verb's process says of itself at its end, besides what canid says
_MEASURED = """
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_CPU, ({cpu}, {cpu}))
resource.setrlimit(resource.RLIMIT_AS, ({bytes}, {bytes}))
try:
    runpy.run_module("canid", run_name="__main__", alter_sys=True)
finally:
    # not ru_maxrss, which counts what the parent had before exec
    with open("/proc/self/status") as status:
        print(next(line for line in status if line.startswith("VmHWM")), file=sys.__stderr__, flush=True)
"""


def _run(verb: str, path: Path, folder: Path) -> str:
    more = ["-o", str(folder / "copy.blf")] if verb == "recover" else []
    script = _MEASURED.format(cpu=_MAX_CPU_S, bytes=_MAX_BYTES)
    command = [sys.executable, "-c", script, verb, str(path), *more]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600, check=False)
    peak = [int(line.split()[1]) / 1024 for line in done.stderr.splitlines() if line.startswith("VmHWM")]
    if "Traceback" in done.stderr or done.returncode not in (0, 1, 2, 4):
        return f"{verb} {path.name}: exit code {done.returncode}: {done.stderr[-300:]}"
    return "" if peak and peak[0] <= _MAX_MB else f"{verb} {path.name}: {peak} MB"
