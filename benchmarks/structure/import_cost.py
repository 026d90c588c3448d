"""What a command imports before it does anything: modules, and CPU s above an empty interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

# commands that end at once: what they cost is what they import
COMMANDS = (("--version",), ("record", "--help"), ("live", "--help"))
TRIES = 5
# runs a command of canid and prints the number of loaded modules
COUNT = """
import runpy, sys
try:
    runpy.run_module("canid", run_name="__main__", alter_sys=True)
except SystemExit:
    pass
print(len(sys.modules), file=sys.stderr)
"""


class Cost(NamedTuple):
    """Import cost of a command."""

    modules: int  # loaded at its end, an empty interpreter's left out
    seconds: float  # CPU, least of `TRIES`, an empty interpreter's left out


def import_cost(tree: Path, command: tuple[str, ...]) -> Cost:
    """Measure a command of a checkout."""
    modules, seconds = _least(tree, "-c", COUNT, *command)
    empty_modules, empty_seconds = _least(
        tree, "-c", "import runpy, sys; print(len(sys.modules), file=sys.stderr)"
    )
    return Cost(modules - empty_modules, seconds - empty_seconds)


def _least(tree: Path, *words: str) -> tuple[int, float]:
    env = {**os.environ, "PYTHONPATH": str(tree)}
    seconds = []
    for _ in range(TRIES):
        before = os.times()
        done = subprocess.run(
            [sys.executable, *words], check=True, cwd=tree, env=env, capture_output=True, text=True
        )
        after = os.times()
        seconds.append(
            after.children_user + after.children_system - before.children_user - before.children_system
        )
    return int(done.stderr.split()[-1]), min(seconds)
