"""canid as a user calls it: in this process where speed matters, and one short simulated log for all."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from canid.ui.cli import main

ROOT = Path(__file__).parents[2]


class Ran(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str

    @property
    def line(self) -> str:
        """The error message: exactly one line, and no traceback."""
        assert self.err.count("\n") == 1, self.err
        assert self.err.startswith("canid: "), self.err
        assert "Traceback" not in self.err
        return self.err


@pytest.fixture
def canid(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ran]:
    """Run `canid ...` in this process."""
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)

    def run(*words: object) -> Ran:
        capsys.readouterr()
        try:
            code = main([str(word) for word in words])
        except SystemExit as end:  # --help
            code = int(end.code or 0)
        return Ran(code, *capsys.readouterr())

    return run


@pytest.fixture
def shell() -> Callable[[str], Ran]:
    """Run a shell line in which `canid` is this canid."""

    def run(line: str) -> Ran:
        script = f'canid() {{ {shlex.quote(sys.executable)} -m canid "$@"; }}\n{line}'
        environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            ["bash", "-c", script], capture_output=True, text=True, timeout=600, env=environment, check=False
        )
        return Ran(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated drive of 45 s, some 10,000 frames; do not change it."""
    path = tmp_path_factory.mktemp("logs") / "drive.blf"
    assert main(["simulate", str(path), "--minutes", "0.75", "--seed", "1"]) == 0
    return path
