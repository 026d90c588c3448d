"""Attacks by names that mean something: to DuckDB a column or a pattern, to a shell or an option something else."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from tests.fixtures.odd_names import MEANING, MEANT
from tests.fleet import short_logs

PROMISE = (
    "names of folders change no number: none is a column, a pattern or an option; no neighbour is touched"
)
PART = ("--vehicle", "generic", "--stop", "20")
DRIVES = "SELECT driver, right(log, 13), range_rate_K, status FROM drives ORDER BY log"
# in this order: later ones read what earlier ones have written
COMMANDS = (
    ("export", "drive.log", *PART, "--to", "parquet", "-o", "table"),
    ("identify", "table.samples.parquet", "--json", "of-parquet.json"),
    ("fleet", "drives", "-o", "res", *short_logs.QUICK, "--json", "fleet.json"),
    ("fleet", "query", "res", DRIVES, "--format", "csv"),
    ("fleet", "query", "res", "SELECT * FROM drivers ORDER BY driver", "--format", "csv"),
)  # fmt: skip
# what differs between two runs in one folder as well
UNLIKE = {"wall_s", "cpu_s", "peak_bytes", "analysed_utc", "modified_ns", "command", "seconds"}


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """The same commands in a folder of a drawn name, next to one that a pattern of it would find."""
    name = rng.choice(MEANT) if rng.random() < 0.5 else _drawn(rng)
    place, neighbour = folder / os.fsdecode(name), folder / _found_by(name)
    shutil.copytree(_inputs(), place)
    if neighbour != place:
        shutil.copytree(_plain()[0], neighbour, dirs_exist_ok=True)
    before = _held(neighbour)
    wrong = []
    for words, expected in zip(COMMANDS, _plain()[1], strict=True):
        got = _did(words, place)
        # bytes that are no text may be refused in one line
        refused = not _is_text(name) and got[0] in (2, 5)
        if got != expected and not refused:
            wrong.append(f"{' '.join(words[:2])} in {name!r}: {str(got)[:200]} for {str(expected)[:200]}")
            break
    if neighbour != place and _held(neighbour) != before:
        wrong.append(f"the neighbour of {name!r} was changed")
    yield Outcome(
        "drawn names of folders, with a neighbour", math.nan, 0, "; ".join(wrong), tried=len(COMMANDS)
    )


def _drawn(rng: random.Random) -> bytes:
    while True:
        name = bytes(rng.choice(MEANING) for _ in range(rng.randint(1, 40)))
        if name not in (b".", b".."):
            return name


def _found_by(name: bytes) -> str:
    """The name of a neighbour: what a pattern would find, or some other name."""
    text = os.fsdecode(name).replace("[1]", "1").replace("*", "x").replace("?", "x")
    return text if text != os.fsdecode(name) and text not in ("", ".", "..") else "res1"


def _is_text(name: bytes) -> bool:
    try:
        name.decode()
    except UnicodeDecodeError:
        return False
    return True


@cache
def _inputs() -> Path:
    folder = Path(mkdtemp(prefix="canid-meanings-"))
    (folder / "drive.log").write_bytes(short_logs.log(3, 40.0))
    short_logs.write(folder / "drives", 2, 20.0)
    return folder


@cache
def _plain() -> tuple[Path, list[tuple[int, Any]]]:
    """A folder of a plain name in which everything was done, and what came of it."""
    folder = Path(mkdtemp(prefix="canid-plain-")) / "plain"
    shutil.copytree(_inputs(), folder)
    return folder, [_did(words, folder) for words in COMMANDS]


def _did(words: tuple[str, ...], folder: Path) -> tuple[int, Any]:
    """Exit code, and the numbers of a command."""
    ran = subprocess.run(
        [sys.executable, "-m", "canid", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    out, err = (text.decode("utf-8", "replace") for text in (ran.stdout, ran.stderr))
    if "Traceback" in err:
        return ran.returncode, err[-300:]
    if words[:2] == ("fleet", "query"):
        return ran.returncode, out.splitlines()[1:]
    of_table = folder / "of-parquet.json"
    if words[0] == "identify" and of_table.exists():
        return ran.returncode, _without(json.loads(of_table.read_text("utf-8")))
    return ran.returncode, None


def _without(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without(each) for key, each in value.items() if key not in UNLIKE}
    return [_without(each) for each in value] if isinstance(value, list) else value


def _held(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
