"""The wheel, built and installed in a folder of its own without a network."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(
    words: Sequence[str | Path], cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program; a failure shows what it said."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHONPATH", "CAN_"))}
    done = subprocess.run(
        words,
        cwd=cwd,
        env=clean | (environment or {}),
        text=True,
        capture_output=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of wheel and sdist, by `python -m build`, without a network."""
    for module in ("build", "hatchling", "twine"):
        if find_spec(module) is None:
            pytest.skip(f"{module} is not installed: pip install -e '.[dev]'")
    folder = tmp_path_factory.mktemp("built")
    # of hatchling in a folder of PYTHONPATH, too
    path = {"PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    run([sys.executable, "-m", "build", "--no-isolation", "-o", folder, ROOT], folder, path)
    return folder


@pytest.fixture(scope="session")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel in a folder of its own; its dependencies are those of this Python."""
    folder = tmp_path_factory.mktemp("installed")
    options = ["--no-index", "--no-deps", "--no-compile", "--target", str(folder)]
    run([sys.executable, "-m", "pip", "install", *options, next(built.glob("*.whl"))], folder)
    return folder
