"""Running a benchmark again in a network namespace that has loopback alone, so that no packet leaves the machine."""

from __future__ import annotations

import os
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
_INSIDE = "CANID_ALONE"


def enter(module: str) -> None:
    """Become `python -m module`, with the same arguments, in there; return where that has happened already."""
    if os.environ.get(_INSIDE) is not None:
        return
    os.environ[_INSIDE] = "1"
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["PYTHONPATH"] = str(ROOT)
    alone = str(ROOT / "tests/bus/alone")
    os.execv(alone, [alone, sys.executable, "-m", module, *sys.argv[1:]])
