"""User code as the documentation has it: three scripts that run and are typed, and the notebook."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
EXAMPLES = REPO / "examples"
LOG = REPO / "replay_logs/following_urban.blf"


def run(*words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """A script, as a user starts it."""
    return subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(REPO), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def run_here(monkeypatch: pytest.MonkeyPatch, *words: object) -> str | int | None:
    """A script in this process, which has imported canid already; what it ends with."""
    monkeypatch.setattr(sys, "argv", list(map(str, words)))
    try:
        runpy.run_path(str(words[0]), run_name="__main__")
    except SystemExit as end:
        return end.code
    return 0


@pytest.mark.slow("whole commands, one after the other")
def test_identify_log(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The first script prints K of range rate with an interval that holds the truth; a wrong file is one line."""
    assert run_here(monkeypatch, EXAMPLES / "identify_log.py", LOG, "generic") == 0
    out = capsys.readouterr().out
    found = re.search(r"range_rate: K = ([\d.]+) \[([\d.]+), ([\d.]+)\] \(sum_only\)", out)
    assert found, out
    assert float(found[2]) < 5.62 < float(found[3])  # its truth
    wrong = run_here(monkeypatch, EXAMPLES / "identify_log.py", __file__, "generic")
    assert isinstance(wrong, str)  # sys.exit prints it, and ends with 1
    assert Path(__file__).name in wrong
    assert "\n" not in wrong


@pytest.mark.slow("whole commands, one after the other")
def test_listen(tmp_path: Path) -> None:
    """The second one has live estimates of K from a Notifier on a virtual bus, and loses nothing."""
    ran = run(EXAMPLES / "listen.py", LOG, 35, folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    assert re.search(r"K of range rate \d\.\d \[\d\.\d, \d\.\d\]", ran.stdout), ran.stdout
    assert ", 0 dropped>" in ran.stdout


@pytest.mark.slow("whole commands, one after the other")
def test_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The third one makes a table of a folder, passes over a file that is no log, and takes arrays as a drive."""
    shutil.copy(REPO / "replay_logs/following_lost_lead.blf", tmp_path)
    (tmp_path / "a note.blf").write_text("not a log")
    assert run_here(monkeypatch, EXAMPLES / "batch.py", tmp_path, "generic") == 0
    out, err = capsys.readouterr()
    assert "a note.blf" in err
    assert out.count("following_lost_lead.blf") == 3
    # the driver in the script: K 6, dead time 0.5 s, lag 0.4 s
    assert re.search(r"range_rate: Channel\(K=6\.\d\d \[5\.\d\d, 6\.\d\d\], tau=", out), out


@pytest.mark.slow("whole commands, one after the other")
def test_the_scripts_are_typed() -> None:
    """`mypy --strict` on them, against the types that canid ships."""
    scripts = sorted(EXAMPLES.glob("*.py"))
    # the cache of `make types`: canid itself is read in seconds
    ran = run("-m", "mypy", "--strict", *scripts, folder=REPO)
    assert ran.returncode == 0, ran.stdout
    assert f"in {len(scripts)} source files" in ran.stdout
    revealed = REPO / "canid/py.typed"
    assert revealed.exists()


@pytest.mark.slow("whole commands, one after the other")
def test_the_notebook_runs(tmp_path: Path) -> None:
    """Every cell of the notebook in docs, from top to bottom; it is kept without outputs."""
    nbformat = pytest.importorskip("nbformat")
    from nbclient import NotebookClient

    path = REPO / "docs/notebooks/first_drive.ipynb"
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in code)
    # sockets in a folder instead of TCP, so that it also runs without a network
    NotebookClient(
        notebook,
        timeout=120,
        resources={"metadata": {"path": str(path.parent)}},
        kernel_name="python3",
    ).execute()
    shown = [out for cell in code for out in cell.outputs if "text/html" in out.get("data", {})]
    assert len(shown) >= 3
    assert all("<script" not in out["data"]["text/html"] for out in shown)
