"""Attacks on the names that canid gives its files itself: links to a recording, strays, a lock that is removed."""

from __future__ import annotations

import atexit
import json
import math
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from benchmarks.reliability.attack import overwriting
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT, until
from canid.values.shipped_files import shipped
from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, TABLES, table

PROMISE = (
    "nothing is written through a link that has a name of canid's own files; results are deleted only by a complete "
    "replacement, and a removed lock is noticed"
)
RECORDING = b"LOGG a drive that nobody can drive again\n" * 200
# in the folder of a fleet, those of earlier versions too
FLEET_NAMES = (
    *("fleet.lock", "fleet.json", ".fleet.json.new", "parts", "segments", ".duckdb.tmp"),
    *(f"{name}.parquet" for name in TABLES),
    *(f".{name}.{kind}.new" for name in TABLES for kind in ("parquet", "jsonl")),
    *(f"segments/{k:06d}.jsonl" for k in range(1, 4)),
    *(f"parts/{k:06d}" for k in range(1, 4)),
    *(f"parts/.{k:06d}.new" for k in range(1, 4)),
    *("parts/000001-000064", "parts/.000001-000064.new"),
)
STRAYS = ("000001-000064", "000001-000001", "1 copy", "1", "000003-000001", "0000001", "000001 (1)", "000000")
# command, and the names that it gives its files, with those of temporary files; x is what the user names
COMMANDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "record -i virtual -c links --duration 0.2 -o x.log --json x.json",
        ("x.log", ".x.log.new", "x.events.jsonl", ".x.events.jsonl.new", "x.json", ".x.json.new"),
    ),
    (
        "record -i virtual -c links --duration 0.2 --file-time 1s --keep-share 1% -o x.blf",
        ("x.blf", "x.series", "x-2.series", ".x.series.new", "x.events.jsonl"),
    ),
    (
        "replay simulated.blf --vehicle generic --stop 2 --state x.state --json x.json",
        ("x.state", ".x.state.new", ".x.state1.new", "x.json"),
    ),
    (
        "export simulated.blf --vehicle generic --stop 2 --force -o x --json x.json",
        ("x.samples.csv", ".x.samples.csv.new", "x.estimates.csv", "x.json"),
    ),
    ("export simulated.blf --vehicle generic --stop 2 -o x.parquet", ("x.samples.parquet", "x.parquet")),
    (
        "identify simulated.blf --vehicle generic --stop 2 --report x.html",
        ("x.html", ".x.html.new", "x.html~"),
    ),
    ("simulate x.blf --minutes 0.05 --force", ("x.blf", "x.truth.json", ".x.blf.new", ".x.new.blf")),
    ("recover simulated.blf -o x.asc", ("x.asc", ".x.asc.new", "x.recovered.asc")),
    (
        "study prints grover -o x",
        ("x/study.json", "x/study.html", "x/tables", "x/figures", "x/.study.json.new"),
    ),
    ("init generic.dbc -o x.toml", ("x.toml", ".x.toml.new")),
)
# commands in a round: they share a process, since imports take longer than they do
DRAWN = 4
LOGS = 4
_MAKING = threading.Lock()

# Runs commands one after the other, each in its folder, and says how each ended.
RUNNER = """
import contextlib, io, json, os, sys
from canid.ui.cli import main
results = []
for folder, words in json.load(open(sys.argv[1])):
    os.chdir(folder)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            code = main(words)
        except BaseException as error:
            code = f"{type(error).__name__}: {error}"
    results.append([code, said.getvalue()[-600:]])
json.dump(results, open(sys.argv[2], "w"))
"""


class Kept:
    """A folder with a recording, which must stay as it is."""

    def __init__(self, folder: Path):
        """Make it."""
        self.folder = folder
        self.recording = folder / "drive.blf"
        (folder / "000001").mkdir(parents=True)
        for name in ("drive.blf", "000001/outcomes.parquet", "000001.jsonl"):
            (folder / name).write_bytes(RECORDING)

    def plant(self, path: Path, rng: random.Random) -> str:
        """Make a name a link to it, instead of what has the name; returns which kind."""
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        kind = rng.choice(("symbolic", "hard", "folder", "chain"))
        if kind == "hard":
            os.link(self.recording, path)
        elif kind == "chain":
            between = self.folder.with_name(f"between{time.monotonic_ns()}")
            between.symlink_to(self.recording)
            path.symlink_to(between)
        else:
            path.symlink_to(self.recording if kind == "symbolic" else self.folder)
        return kind

    def harmed(self) -> list[str]:
        """What is not as it was; files that are new in its folder count."""
        found = {str(path.relative_to(self.folder)) for path in self.folder.rglob("*")}
        names = {"drive.blf", "000001", "000001/outcomes.parquet", "000001.jsonl"}
        wrong = [f"{name} was made or deleted through a link" for name in sorted(found ^ names)]
        wrong += [
            f"{path.name} of {len(RECORDING):,} bytes was written to: {path.stat().st_size:,}"
            for path in self.folder.rglob("*")
            if path.is_file() and path.read_bytes() != RECORDING
        ]
        return wrong


@cache
def _calm() -> Path:
    """Logs, and the results of an undisturbed run, in a folder that lasts as long as this process."""
    folder = Path(mkdtemp(prefix="attack_fleet"))
    atexit.register(shutil.rmtree, folder, True)
    short_logs.write(folder / "logs", LOGS)
    _, code, said = _ended(_fleet(folder, folder / "calm"))
    if code:
        raise RuntimeError(said)
    return folder


def calm() -> Path:
    """The folder with `logs` and `calm`."""
    with _MAKING:
        return _calm()


def _fleet(folder: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    """Start `canid fleet` over the logs of a folder."""
    return subprocess.Popen(
        short_logs.command(folder / "logs", "-o", out, *QUICK, *words),
        cwd=ROOT,
        env=short_logs.environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )


def _ended(run: subprocess.Popen[str]) -> tuple[list[str], int, str]:
    """Wait for a run; what was wrong with its end, its exit code, and what it said."""
    _, said = run.communicate(timeout=600)
    code = run.returncode
    wrong = [] if code in (0, 5) and "Traceback" not in said else [f"exit code {code}: {said[-300:]}"]
    return wrong, code, said


def _rows(out: Path) -> dict[str, Any]:
    """The tables that users read, without what differs between runs."""
    return {
        "logs": sorted(table(out, "logs", "* EXCLUDE (analysed_utc, attempts)"), key=repr),
        "drives": sorted(table(out, "drives", "* EXCLUDE (cpu_s, wall_s, peak_bytes)"), key=repr),
    }


def _right(out: Path) -> list[str]:
    """Why the tables are not those of an undisturbed run."""
    try:
        found = _rows(out)
    except Exception as error:  # DuckDB's, of any kind
        return [f"tables cannot be read: {error}"]
    return [f"{name} has other rows" for name, rows in _rows(calm() / "calm").items() if rows != found[name]]


def _of_fleet(folder: Path, rng: random.Random) -> Outcome:
    """A fixed name in a fleet's folder is a link, before a first or a later run, or a report."""
    kept, out = Kept(folder / "elsewhere"), folder / "out"
    later, report = rng.random() < 0.7, rng.random() < 0.3
    if later:
        shutil.copytree(calm() / "calm", out)
    name = rng.choice(FLEET_NAMES)
    kind = kept.plant(out / name, rng)
    if later and report:
        run = subprocess.Popen(
            short_logs.command("report", out, "-o", folder / "page.html"),
            cwd=ROOT,
            env=short_logs.environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        _, said = run.communicate(timeout=600)
        bad = run.returncode not in range(6) or "Traceback" in said
        wrong = [f"exit code {run.returncode}: {said[-300:]}"] if bad else []
    else:
        wrong, code, _ = _ended(_fleet(calm(), out))
        wrong += _right(out) if code == 0 else []
    wrong += kept.harmed()
    about = f" ({name} {kind}, later {later}, report {report})" if wrong else ""
    return Outcome(
        "a fixed name in a fleet's folder is a link to a recording or to a folder of recordings",
        math.nan,
        0,
        "; ".join(wrong) + about,
    )


def _of_parts(folder: Path, rng: random.Random) -> Outcome:
    """Strays among the parts, empty, damaged or whole; no result is lost."""
    out = folder / "out"
    shutil.copytree(calm() / "calm", out)
    (part,) = (out / "parts").iterdir()
    before = {path.name: path.read_bytes() for path in part.iterdir()}
    planted = rng.sample(STRAYS, rng.randrange(1, 4))
    kinds = []
    for name in planted:
        stray, kind = out / "parts" / name, rng.choice(("empty", "file", "cut", "some", "whole"))
        kinds.append(kind)
        if kind == "file":
            stray.write_bytes(RECORDING)
            continue
        stray.mkdir()
        for path in part.iterdir():
            if kind in ("cut", "whole") or (kind == "some" and rng.random() < 0.5):
                content = path.read_bytes()
                (stray / path.name).write_bytes(content[: len(content) // 2] if kind == "cut" else content)
    wrong, code, said = _ended(_fleet(calm(), out))
    if code == 0:
        wrong += _right(out)
        if "0 analysed now" not in said and not {path.name for path in (out / "parts").iterdir()}:
            wrong.append("results are gone")
    whole = dict(zip(planted, kinds, strict=True)).get("000001-000064") == "whole"
    left = {path.name: path.read_bytes() for path in part.iterdir()} if part.is_dir() else {}
    if left != before and not whole:
        wrong.append("the part was deleted or changed")
    for name in planted:
        stray = out / "parts" / name
        shutil.rmtree(stray) if stray.is_dir() else stray.unlink(missing_ok=True)
    if not whole:
        again, code, said = _ended(_fleet(calm(), out))
        wrong += again + _right(out) + ([f"without them: {said[-300:]}"] if code else [])
    about = f" ({planted}, {kinds})" if wrong else ""
    return Outcome("strays among a fleet's parts", math.nan, 0, "; ".join(wrong) + about, tried=len(planted))


def _of_lock(folder: Path, rng: random.Random) -> Outcome:
    """`rm fleet.lock` while a run works, and a second run."""
    out = folder / "out"
    first = _fleet(calm(), out, "--workers", "1")
    until(lambda: (out / "segments").is_dir() or first.poll() is not None)
    time.sleep(rng.uniform(0.0, 1.0))
    working = first.poll() is None
    (out / "fleet.lock").unlink(missing_ok=True)
    second = _fleet(calm(), out, "--workers", "1")
    wrong: list[str] = []
    for run in (first, second):
        bad, code, said = _ended(run)
        wrong += bad
        if code == 5 and not any(words in said for words in ("fleet.lock was removed", "another run")):
            wrong.append(f"a wrong reason: {said[-300:]}")
        if code == 5 and not working:
            wrong.append("refused, although no run worked")
    bad, code, said = _ended(_fleet(calm(), out))
    wrong += bad + _right(out) + ([f"a run alone: {said[-300:]}"] if code else [])
    return Outcome(
        "fleet.lock removed during a run, and a second run", math.nan, 0, "; ".join(wrong), tried=3
    )


def _of_commands(folder: Path, rng: random.Random) -> Outcome:
    """Names that other commands give their files are links."""
    kept = Kept(folder / "elsewhere")
    made = overwriting.made()
    commands, about = [], []
    drawn = rng.sample(COMMANDS, DRAWN)
    # a study computes for some seconds: it is a round of its own
    drawn = [each for each in drawn if each[0].startswith("study")] or drawn
    for k, (words, names) in enumerate(drawn):
        work = folder / f"work {k}"
        work.mkdir()
        for name in ("simulated.blf", "simulated.truth.json"):
            shutil.copy(made / name, work / name)
        shutil.copy(shipped() / "generic.dbc", work)
        planted = rng.sample(names, rng.randrange(1, 3))
        kinds = [kept.plant(work / name, rng) for name in planted]
        commands.append((str(work), words.split()))
        about.append(f"`canid {words}` with {dict(zip(planted, kinds, strict=True))}")
    listed, results = folder / "commands.json", folder / "results.json"
    listed.write_text(json.dumps(commands))
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", RUNNER, str(listed), str(results)],
        env=short_logs.environment() | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    if not results.exists():
        raise RuntimeError(done.stderr[-500:])
    wrong = [
        f"{which} ended with {code}: {said}"
        for which, (code, said) in zip(about, json.loads(results.read_text()), strict=True)
        if code not in range(6) or "Traceback" in said
    ]
    if harm := kept.harmed():
        wrong += [*harm, *about]
    return Outcome(
        "names that 8 verbs give their files are links to a recording",
        math.nan,
        0,
        "; ".join(wrong),
        tried=len(drawn),
    )


# how often each is drawn
ATTACKS = (_of_fleet, _of_fleet, _of_fleet, _of_parts, _of_parts, _of_lock, _of_commands, _of_commands)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One attack on a fleet's folder, or on some other commands."""
    yield rng.choice(ATTACKS)(folder, rng)
