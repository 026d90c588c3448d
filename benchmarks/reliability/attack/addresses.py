"""Attacks by addresses: lists of logs whose lines name schedulers, templates, caches and archives of a stranger's port."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import fsspec

from benchmarks.reliability.attack.overwriting import made
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.analysis.fleet.planning import address
from tests.fixtures.listening import listening

PROMISE = "a line of a list reaches storage or nothing: no other protocol, no chain; it costs that line alone"
LINES = 40  # in a round
LOGS = 2
# what may stand between a scheme and the next one, and what an address may end with
JOINTS = ("::", "://", "://a.blf::", "://*.blf::", "://[x]::", ":///::")
ENDS = ("a.blf", "*.blf", "**", "", "refs.json", "a.zip", "?x=1", "a::b.blf", "%2e%2e/a.blf", "x://y")


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A run over a drawn list: nothing connects, every drawn line is a failed row, every log of the list is analysed."""
    wrong: list[str] = []
    logs = [folder / name for name in rng.sample(("a::b.blf", "http:x.blf", "s3:y.blf", "plain.blf"), LOGS)]
    for log in logs:
        shutil.copy(made() / "simulated.blf", log)
    with listening() as port:
        drawn = list(dict.fromkeys(_line(f"127.0.0.1:{port.port}", rng) for _ in range(LINES)))
        lines = [*drawn, *(log.name for log in logs)]
        rng.shuffle(lines)
        (folder / "list.txt").write_text("\n".join(lines), encoding="utf-8")
        words = ["fleet", "@list.txt", "-o", "out", "--vehicle", "generic", "--no-diagnosis", "--no-windows"]
        done = subprocess.run(
            [sys.executable, "-m", "canid", *words, "--no-traffic", "--json", "out.json"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        wrong += [f"somebody connected: {heard!r}" for heard in port.connections]
    if done.returncode != 4 or "Traceback" in done.stderr:
        wrong.append(f"exit code {done.returncode}: {done.stderr[-300:]}")
    else:
        wrong += _judged(json.loads((folder / "out.json").read_text("utf-8")), drawn)
    yield Outcome(
        "lists with drawn schemes and chains of fsspec, to a port of loopback that listens",
        math.nan,
        0,
        "; ".join(wrong),
        tried=len(drawn),
    )


def _line(host: str, rng: random.Random) -> str:
    """An address that is not one of storage, with the port of a stranger in it."""
    others = sorted({*fsspec.available_protocols(), "ws", "tcp", "tls", "HTTP"} - {*address.SCHEMES})
    first = rng.choice(others)
    links = [first, *(rng.choice([*others, "http", "file", "s3"]) for _ in range(rng.randrange(3)))]
    text = "".join(f"{link}{rng.choice(JOINTS)}" for link in links[:-1]) + links[-1]
    return f"{text}://{host}/{rng.choice(ENDS)}"


def _judged(document: dict[str, object], drawn: list[str]) -> list[str]:
    counted = document["logs"]
    failed = document["not_ok"]
    assert isinstance(counted, dict)
    assert isinstance(failed, list)
    wrong = [f"{LOGS - counted['ok']} logs were not analysed"] if counted["ok"] != LOGS else []
    wrong += [f"{row['log']} has no reason" for row in failed if not row["reason"]]
    return wrong + ([f"{len(failed)} rows for {len(drawn)} lines"] if len(failed) != len(drawn) else [])
