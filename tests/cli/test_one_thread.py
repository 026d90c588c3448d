"""Linear algebra uses one thread in every verb: more of them double the CPU time of a diagnosis."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COUNTED = """
import os
from canid.ui.cli import main
main(["--version"])
import numpy as np
a = np.random.default_rng(0).normal(size=(600, 600))
a @ a
print("threads", len(os.listdir("/proc/self/task")))
"""


def threads(**said: str) -> int:
    """Threads of a process that has run a verb and multiplied two matrices."""
    environment = {name: x for name, x in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment |= {"PYTHONPATH": str(ROOT)} | said
    done = subprocess.run(
        [sys.executable, "-c", COUNTED], env=environment, capture_output=True, text=True, check=True
    )
    return int(done.stdout.rsplit(maxsplit=1)[-1])


@pytest.mark.skipif(
    not Path("/proc/self/task").is_dir(), reason="no /proc: the threads of a process cannot be counted"
)
def test_one_thread_unless_the_environment_says_otherwise() -> None:
    assert threads() == 1
    if (os.cpu_count() or 1) > 1:
        assert threads(OMP_NUM_THREADS="2", OPENBLAS_NUM_THREADS="2") == 2
