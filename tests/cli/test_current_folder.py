"""No code from the current folder or from the folder of a log runs in canid or its children, in any verb."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from canid.ui.cli.verbs import VERBS
from canid.values.errors import DONE, NO_BUS
from canid.values.shipped_files import shipped

ROOT = Path(__file__).parents[2]
CANID = Path(sys.executable).with_name("canid")
# standard modules that canid or its packages import late, packages it may use, canid itself, and start-up hooks
MODULES = (
    "queue", "pickle", "calendar", "json", "typing", "random", "tempfile", "hashlib", "csv", "gzip", "socket", "select",
    "numpy", "scipy", "can", "cantools", "asammdf", "msgpack", "rich", "duckdb", "plotly", "deflate", "jinja2",
    "canid", "sitecustomize", "usercustomize", "conftest", "textparser", "bitstruct", "diskcache", "pandas", "lxml",
)  # fmt: skip


@pytest.fixture
def hostile(log: Path, tmp_path: Path) -> Path:
    """A folder with a log, a database and modules of all these names, each of which leaves a mark when it is imported."""
    folder = tmp_path / "hostile"
    folder.mkdir()
    shutil.copy(log, folder / "drive.blf")
    (folder / "demo_out").mkdir()
    shutil.copy(log, folder / "demo_out/demo.blf")
    shutil.copy(shipped() / "generic.dbc", folder / "car.dbc")
    for name in MODULES:
        mark = tmp_path / f"imported.{name}"
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'w').close()\nraise SystemExit(77)\n")
    (folder / "evil.pth").write_text(f"import os; open({str(tmp_path / 'imported.pth')!r}, 'w').close()\n")
    (folder / "can.conf").write_text("[default]\ninterface = virtual\nchannel = hostile\n")
    return folder


PART = ("--vehicle", "generic", "--stop", "2")
WORDS = {
    "demo": ("--help",),  # its parts are those of live, simulate and diagnose
    "live": ("-i", "virtual", "-c", "x", "--vehicle", "generic", "--record", "new.blf", "--duration", "3"),
    "record": ("-i", "virtual", "-c", "x", "-o", "recorded.asc", "--duration", "0.5"),
    "replay": ("drive.blf", *PART, "--json", "r.json"),
    "identify": ("drive.blf", *PART),
    "diagnose": ("drive.blf", *PART, "--report"),
    "compare": ("drive.blf@0:2", "drive.blf@2:4", "--vehicle", "generic", "--report", "c.html"),
    "fleet": ("drive.blf", "-o", "results", "--vehicle", "generic", "--no-diagnosis", "--no-traffic"),
    "study": ("prints", "grover", "-o", "out"),
    "simulate": ("simulated.blf", "--minutes", "0.1"),
    "look": ("drive.blf", "--dbc", "car.dbc"),
    "decode": ("drive.blf", "--dbc", "car.dbc", "--stop", "1"),
    "check": ("drive.blf", "--vehicle", "generic"),
    "init": ("car.dbc",),
    "recover": ("drive.blf",),
    "export": ("drive.blf", *PART, "--to", "parquet"),
    "schema": ("identify",),
}


# of a verb that is not among them, its row of the README
TRIED = {verb.name: WORDS.get(verb.name) or shlex.split(verb.shown[0].command)[2:] for verb in VERBS}


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("verb", TRIED)
def test_no_module_of_the_current_folder_is_imported(verb: str, hostile: Path, tmp_path: Path) -> None:
    """The installed command, started in a folder full of modules: none of them leaves its mark, in no process."""
    assert CANID.exists(), "canid is not installed with this Python"
    done = subprocess.run(
        [CANID, verb, *TRIED[verb]],
        cwd=hostile,
        env={k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "CAN_INTERFACE", "CAN_CONFIG")},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    # on a bus that nobody sends on a session ends with 3
    assert done.returncode == (NO_BUS if verb in ("live", "record") else DONE), done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("imported.*"))


@pytest.mark.slow("whole commands, one after the other")
def test_the_child_that_reads_mf4_is_isolated(hostile: Path, tmp_path: Path) -> None:
    """A file that pretends to be .mf4, next to an asammdf.py: refused, and that module is not imported."""
    (hostile / "drive.mf4").write_bytes(b"MDF     4.10    " + bytes(200))
    done = subprocess.run(
        [CANID, "check", "drive.mf4"], cwd=hostile, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode in (2, 4)
    assert not list(tmp_path.glob("imported.*"))


@pytest.mark.slow("whole commands, one after the other")
def test_python_m_canid_takes_no_module_of_the_current_folder_once_it_runs(
    hostile: Path, tmp_path: Path
) -> None:
    """`python -m` itself imports some modules from there, as for any program; canid imports no more, and neither do its
    children."""
    for name in ("typing", "canid"):  # before canid's first line, and canid itself
        (hostile / f"{name}.py").unlink()
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "canid", "live", *WORDS["live"]],
        cwd=hostile,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == NO_BUS, done.stderr
    assert not list(tmp_path.glob("imported.*"))
