"""A command of canid, with its time and memory measured."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.reliability.recording import ROOT

# A small process in between: ru_maxrss of a child begins with what the process that started it had, and that may be
# a test session of 400 MB. It tells status, CPU s and kB through the file that is its first argument.
MEASURE = """
import os, sys
child = os.posix_spawn(sys.executable, [sys.executable, *sys.argv[2:]], os.environ)
_, status, used = os.wait4(child, 0)
with open(sys.argv[1], "w") as file:
    file.write(f"{os.waitstatus_to_exitcode(status)} {used.ru_utime + used.ru_stime} {used.ru_maxrss}")
"""


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
    out, err, used = (folder / f"measured.{what}" for what in ("out", "err", "used"))
    began = time.monotonic()
    with out.open("wb") as said, err.open("wb") as complained:
        subprocess.run(
            [sys.executable, "-I", "-S", "-c", MEASURE, str(used), "-m", "canid", *map(str, words)],
            stdout=said,
            stderr=complained,
            stdin=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"} | environment,
            check=True,
        )
    wall = time.monotonic() - began
    code, cpu, kilobytes = used.read_text().split()
    return Ran(
        int(code),
        out.read_text(errors="replace"),
        err.read_text(errors="replace"),
        float(cpu),
        wall,
        float(kilobytes) * 1024.0,
    )
