"""A child of canid imports canid from where its parent has it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from canid.values.processes import child_process

ROOT = Path(__file__).parents[2]


def test_a_source_tree_that_is_not_installed_starts_its_children() -> None:
    """`python -m canid` in such a tree has canid from the current folder alone; the child gets that folder by name."""
    assert child_process.module_path([], child_process._ROOT) == [str(ROOT)]
    code = (
        "import subprocess, sys; from canid.values.processes import child_process\n"
        "sys.exit(subprocess.run(child_process.command('canid.values.processes.child_process')).returncode)"
    )
    # the interpreter that the virtual environment was made of: no canid is installed there
    base = getattr(sys, "_base_executable", sys.executable)
    done = subprocess.run([base, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
