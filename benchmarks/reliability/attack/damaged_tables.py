"""Attacks on tables: quotes, NULs, cells and delimiters damaged anywhere; every line is a row, known, or damaged."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.analysis.tables.sources.text_source import TextSource
from canid.values.errors import CanidError

PROMISE = (
    "tables too: every line is a row, known to be none, or counted as damaged; damage costs its own line"
)
TABLES = 25  # in a round, read in this process; one of them by `canid identify` as well
_NAMES = ("time", "speed", "gap", "range_rate", "accel")
_LINES = (300, 3000)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Tables of many shapes, some lines of each damaged."""
    wrong: list[str] = []
    for k in range(TABLES):
        delimiter = rng.choice((",", ";", "\t", "|"))
        lines, rows, known, damaged = _table(rng, delimiter)
        path = folder / f"x{k}.csv"
        ends = (rng.choice(("\n", "\r\n")), "\n")
        path.write_bytes("".join(line + rng.choice(ends) for line in lines).encode("latin-1"))
        wrong += [f"table {k}: {text}" for text in _judged(path, rows, known, damaged)]
        if k == 0:
            wrong += _by_command(path, damaged)
    yield Outcome(
        "open quotes, NULs, missing and further cells, other delimiters, joined lines: .csv", math.nan, 0,
        "; ".join(wrong), tried=TABLES,
    )  # fmt: skip


def _table(rng: random.Random, delimiter: str) -> tuple[list[str], list[list[float]], int, int]:
    """Lines; the rows that are whole; how many lines are of no interest, and how many damaged."""
    lines = [f"# table {k}" for k in range(rng.randrange(3))] + [delimiter.join(_NAMES)]
    known, damaged, rows = len(lines), 0, []
    share = rng.choice((0.001, 0.01, 0.2))
    gap, rate, speed = 30.0, 0.0, 20.0
    for k in range(rng.randint(*_LINES)):
        accel = 0.2 * (gap - 1.5 * speed) + 0.5 * rate + rng.gauss(0, 0.1)
        rate += 0.1 * (rng.gauss(0, 1.0) - accel)
        speed, gap = speed + 0.1 * accel, gap + 0.1 * rate
        cells = [f"{0.1 * k:.1f}", *(f"{x:.4f}" for x in (speed, gap, rate, accel))]
        line = delimiter.join(f'"{cell}"' for cell in cells) if rng.random() < 0.1 else delimiter.join(cells)
        if k > 200 and rng.random() < share:
            lines.append(_damaged(line, delimiter, rng))
            damaged += 1
        else:
            lines.append(line)
            rows.append([float(cell) for cell in cells])
        if rng.random() < 0.01:
            lines.append(rng.choice(("", " ", "# a remark", delimiter.join(_NAMES))))
            known += bool(lines[-1].strip())
    return lines, rows, known, damaged


def _damaged(line: str, delimiter: str, rng: random.Random) -> str:
    """A line that can be no row."""
    cells = line.split(delimiter)
    kind = rng.randrange(6)
    if kind == 0:
        k = rng.randrange(len(cells))
        cells[k] = '"' + cells[k].strip('"')
        return delimiter.join(cells)
    if kind == 1:
        at = rng.randrange(len(line) + 1)
        return line[:at] + "\0" + line[at:]
    if kind == 2:
        return delimiter.join(cells[: rng.randint(1, len(cells) - 1)])
    if kind == 3:
        return delimiter.join([*cells, *("7" * rng.randint(1, 9))])
    if kind == 4:
        return line.replace(delimiter, rng.choice("~ %"))
    return line + line


def _judged(path: Path, rows: list[list[float]], known: int, damaged: int) -> list[str]:
    try:
        source = TextSource(path)
        got = np.concatenate([block.numbers for block in source.blocks(range(len(_NAMES)), [])])
    except CanidError as error:
        return [f"refused: {error}"]
    count = source.count
    wrong = []
    if (count.read, count.others.total(), count.bad) != (len(rows), known, damaged):
        found = f"{count.read} rows, {count.others.total()} known, {count.bad} damaged"
        wrong.append(f"{found}, but there are {len(rows)}, {known} and {damaged}")
    elif not np.array_equal(got, np.array(rows)):
        wrong.append("a row on an undamaged line is another")
    return wrong


def _by_command(path: Path, damaged: int) -> list[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "canid", "check", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    said = "damaged: line" in done.stdout + done.stderr
    if "Traceback" in done.stderr or said != bool(damaged) or (damaged and done.returncode not in (1, 4)):
        return [f"check: exit code {done.returncode} with {damaged} damaged lines: {done.stderr[-300:]}"]
    return []
