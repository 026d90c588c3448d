"""What is asked of a checkout: verbs with --json on planted drives, shipped logs and measured drives.

Only the command line is used, so that an older or newer checkout can be asked with the same words.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.hidden_effects.drives import SIMULATORS, drive
from tests.fixtures.measured_logs import LOGS, LONG_LOGS
from tests.plants.measurement import LEAN, write

HERE = Path(__file__).resolve().parents[2]
# beginning of a shipped log's name -> its shipped vehicle
VEHICLES = {
    "following": "generic",
    "lane": "generic_lane",
    "openacc_asta": "openacc_asta",
    "openacc_simulated": "openacc",
    "toyota": "toyota_rav4_2017",
}
# s; the longest drive takes three minutes of an idle core
LIMIT_S = 3600.0


class Task(NamedTuple):
    """One command."""

    name: str  # of the result's file
    words: tuple[str, ...]  # verb and its arguments
    folder: Path  # in which it runs: texts name the log as it was given


def planted(folder: Path, number: int, first_seed: int) -> Iterator[Task]:
    """Plant drives of the table of `hidden_effects` as logs; strengths are drawn, and a log that is there is kept.

    Args:
        folder: for logs, vehicle file and DBC; made.
        number: of drives.
        first_seed: of the first drive; each is a function of its seed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dbc = HERE / "dbc" / "generic.dbc"
    (folder / dbc.name).write_bytes(dbc.read_bytes())
    (folder / LEAN.name).write_text(LEAN.read_text("utf-8").replace("../../dbc/", ""), "utf-8")
    for seed in range(first_seed, first_seed + number):
        log = folder / f"{seed}.blf"
        if not log.with_suffix(".truth.json").exists():
            row = drive(seed)
            effects: dict[str, dict[str, float]] = {name: {} for name in row.effects}
            plant = SIMULATORS[row.simulator]
            write(
                plant(effects, seed=seed, minutes=row.minutes, noise=row.noise, profile=row.profile),
                log,
            )
        for verb in ("identify", "diagnose"):
            yield _task(str(seed), (verb, log.name, "--vehicle", LEAN.name), folder)


def shipped() -> Iterator[Task]:
    """The logs of replay_logs/: what they contain, whether they fit their vehicle, driver and diagnosis."""
    for log in sorted(path for path in (HERE / "replay_logs").iterdir() if path.suffix in {".blf", ".asc"}):
        vehicle = next(name for start, name in VEHICLES.items() if log.name.startswith(start))
        yield from _all(log.stem, log.name, vehicle, log.parent)


def measured(data: Path) -> Iterator[Task]:
    """Measured drives, where they are: OpenACC, RAV4, AstaZero, OpenLKA; diagnosis of all but the last."""
    for name, vehicle in (*LOGS, *LONG_LOGS):
        log = data / name
        # in the log's folder: the one above holds a folder with the name of a vehicle
        if log.exists():
            yield from _all(log.stem, log.name, vehicle, log.parent)
    for log in sorted((data / "openlka").glob("*.blf")):
        yield from list(_all(log.stem, log.name, "openlka.toml", log.parent))[:3]
    for log in sorted(path for path in (data / "reports").rglob("*") if _is_log(path)):
        name = str(log.relative_to(data)).replace("/", "_")
        yield _task(name, ("look", log.name), log.parent)


def _is_log(path: Path) -> bool:
    return path.suffix in {".blf", ".asc", ".log", ".trc", ".mf4"} or path.name.endswith(".log.gz")


def _task(stem: str, words: tuple[str, ...], folder: Path) -> Task:
    return Task(f"{stem}.{words[0]}", words, folder)


def _all(stem: str, log: str, vehicle: str, folder: Path) -> Iterator[Task]:
    yield _task(stem, ("look", log), folder)
    for verb in ("check", "identify", "diagnose"):
        yield _task(stem, (verb, log, "--vehicle", vehicle), folder)


def run(canid: Path, task: Task, out: Path) -> None:
    """Run a task and write `NAME.json`: exit code, texts, and what --json gave.

    The path of the checkout is taken out of all texts.

    Args:
        canid: the executable.
        task: what to ask.
        out: the folder for results.
    """
    target = out / f"{task.name}.json"
    raw = out / f"{task.name}.raw"
    raw.unlink(missing_ok=True)
    done = subprocess.run(
        [str(canid), *task.words, "--json", str(raw)],
        cwd=task.folder,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    written = raw.read_text("utf-8") if raw.exists() else ""
    texts = [
        text.replace(str(raw), "OUT").replace(str(canid.parents[2]), "CHECKOUT")
        for text in (done.stdout, done.stderr, written)
    ]
    result = {
        "exit": done.returncode,
        "stdout": texts[0].splitlines(),
        "stderr": texts[1].splitlines(),
        "json": json.loads(texts[2]) if texts[2] else None,
    }
    raw.unlink(missing_ok=True)
    part = target.with_suffix(".part")
    part.write_text(json.dumps(result, ensure_ascii=False, indent=1), "utf-8")
    part.replace(target)
