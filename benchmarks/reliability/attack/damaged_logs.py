"""Attacks on logs: bits flipped anywhere; every frame is read, or the damage is reported."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.io.logs import open_log
from canid.values.errors import LogError
from canid.values.frame_columns import frames_of
from tests.damaged_logs.bases import Base, bases

PROMISE = (
    "damage is always reported: every line or object is a frame, known to be none, or counted as damaged"
)
MUTANTS = 60  # in a round, read in this process; one more by `canid recover` and `canid check`
_MAKING = threading.Lock()


@cache
def _bases() -> tuple[Base, ...]:
    with TemporaryDirectory() as folder:
        return tuple(bases(Path(folder)))


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Mutants of logs in all formats."""
    with _MAKING:
        originals = _bases()
    wrong: list[str] = []
    for k in range(MUTANTS):
        base = rng.choice(originals)
        data, said = _mutant(base, rng)
        path = folder / f"x{base.suffix}"
        path.write_bytes(data)
        wrong += [f"{base.name}, {said}: {text}" for text in _judged(base, data, path, exact="bits" in said)]
        if k == 0:
            wrong += [f"{base.name}, {said}: {text}" for text in _by_command(path, folder)]
    yield Outcome(
        "bits flipped, bytes overwritten, cut: .blf of three writers, .asc, .log, .csv",
        math.nan,
        0,
        "; ".join(wrong),
        tried=MUTANTS,
    )


def _mutant(base: Base, rng: random.Random) -> tuple[bytes, str]:
    data = bytearray(base.data)
    kind = rng.random()
    if kind < 0.8:
        at = [rng.randrange(len(data)) for _ in range(rng.choice((1, 1, 1, 2, 5)))]
        bits = [rng.randrange(8) for _ in at]
        for byte, bit in zip(at, bits, strict=True):
            data[byte] ^= 1 << bit
        return bytes(data), f"bits {list(zip(at, bits, strict=True))}"
    at0 = rng.randrange(len(data))
    if kind < 0.9:
        count = rng.randrange(1, 40)
        data[at0 : at0 + count] = rng.randbytes(len(data[at0 : at0 + count]))
        return bytes(data), f"{count} random bytes at {at0}"
    return bytes(data[:at0]), f"cut at {at0}"


def _judged(base: Base, data: bytes, path: Path, *, exact: bool) -> list[str]:
    try:
        log = open_log(path)
        got = [frame for chunk in log.columns() for frame in frames_of(chunk)]
    except LogError as error:
        return [] if "\n" not in str(error) else [f"more than one line: {error}"]
    wrong = []
    if log.frames_read != len(got):
        wrong.append(f"{log.frames_read} frames counted, {len(got)} given")
    if (log.damage is None) != (log.damaged == 0):
        wrong.append(f"{log.damaged} damaged, and it says {log.damage}")
    if path.suffix != ".blf":
        counted = log.frames_read + log.events_read + log.others + log.damaged
        there = sum(1 for line in data.split(b"\n") if line.decode("latin-1").strip())
        if counted != there:
            wrong.append(f"{counted} lines accounted for, of {there}")
    # a text that is cut at the end of a line is a whole text; what replaced bytes may be another frame
    if exact and log.damage is None and len(got) != len(base.frames):
        wrong.append(f"{len(got)} frames of {len(base.frames)}, and nothing is damaged")
    return wrong


def _by_command(path: Path, folder: Path) -> list[str]:
    copy = folder / f"copy{'.blf' if path.suffix == '.csv' else path.suffix}"
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "canid", "recover", str(path), "-o", str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    try:
        log = open_log(path)
        got = [(f.id, f.data) for f in log]
    except LogError:
        return [] if done.returncode == 4 else [f"exit code {done.returncode} of recover: {done.stderr}"]
    code = 4 if log.damage else 0
    wrong = [] if done.returncode == code else [f"exit code {done.returncode} of recover, not {code}"]
    if copy.exists() and [(f.id, f.data) for f in open_log(copy)] != got:
        wrong.append("the copy is another")
    copy.unlink(missing_ok=True)
    return wrong
