"""A child process imports no more than it needs: each start of the parser delays a command by what its imports take."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {"numpy", "scipy", "can", "cantools", "pydantic", "rich"}


@pytest.mark.parametrize(
    "module",
    ["canid.signals.dbc_text.parsing", "canid.values.processes.child", "canid.values.processes.serve"],
)
def test_no_heavy_library_is_imported(module: str) -> None:
    """By the module itself, or by the package that it stands in."""
    code = f"import sys, {module}; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not HEAVY & {name.partition(".")[0] for name in ran.stdout.split()}
