"""A command of canid, with its time and memory measured."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.reliability.recording import ROOT


class Ran(NamedTuple):
    """What it said and took."""

    code: int
    out: str
    err: str
    cpu: float  # s, of the process and its children
    wall: float  # s
    memory: float  # bytes, of the largest of them


def canid(*words: object, folder: Path, **environment: str) -> Ran:
    """Run `canid ...` in a process of its own; what it says goes to files in `folder`."""
    out, err = folder / "measured.out", folder / "measured.err"
    began = time.monotonic()
    with out.open("wb") as said, err.open("wb") as complained:
        process = subprocess.Popen(
            [sys.executable, "-m", "canid", *map(str, words)],
            stdout=said,
            stderr=complained,
            stdin=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"} | environment,
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Ran(
        process.returncode,
        out.read_text(errors="replace"),
        err.read_text(errors="replace"),
        used.ru_utime + used.ru_stime,
        time.monotonic() - began,
        used.ru_maxrss * 1024.0,
    )
