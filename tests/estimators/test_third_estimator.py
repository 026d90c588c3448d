"""A third estimator is a file and a line: nothing else in canid is touched, and it is everywhere.

A copy of canid gets the file (tests/estimators/third/moving.py) and the line; the verbs are run in that copy.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

REPO = Path(__file__).parents[2]
LOG = REPO / "replay_logs" / "following_urban.blf"


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """canid with a file more, and a line."""
    root = tmp_path_factory.mktemp("third")
    shutil.copytree(REPO / "canid", root / "canid", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("dbc", "replay_logs"):
        (root / name).symlink_to(REPO / name)
    shutil.copy(Path(__file__).parent / "third" / "moving.py", root / "canid" / "mathematics" / "estimators")
    registry = root / "canid" / "mathematics" / "estimators" / "__init__.py"
    text = registry.read_text(encoding="utf-8")
    text = text.replace("    FOPDT,\n", "    FOPDT,\n    MOVING,\n")
    text = text.replace("FOPDT\n", "FOPDT\nfrom canid.mathematics.estimators.moving import MOVING\n", 1)
    registry.write_text(text, encoding="utf-8")
    return root


def python(tree: Path, *words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run Python with that canid."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done


def rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


@pytest.mark.slow("estimates over whole drives")
def test_identify_has_its_windows_and_its_whole_drive(tree: Path, tmp_path: Path) -> None:
    """In text and in JSON, with the details that the estimator gives; the other two are still there."""
    out = tmp_path / "out.json"
    done = python(tree, "-m", "canid", "identify", LOG, "--vehicle", "generic", "--stop", 80, "--json", out)
    assert "whole drive, MOVING, fit " in done.stdout
    found = json.loads(out.read_text(encoding="utf-8"))
    assert {e["estimator"] for e in found["windows"]} == {"armax", "fopdt", "moving"}
    assert set(found) >= {"whole", "armax", "moving"}
    assert set(found["moving"]) == {"channels", "fit_percent", "fit_kind", "delay_max"}
    assert found["moving"]["channels"]["range_rate"]["K"]["value"] > 0.0
    assert any(e["status"] == "ok" for e in found["windows"] if e["estimator"] == "moving")


@pytest.mark.slow("estimates over whole drives")
def test_replay_saves_and_restores_it(tree: Path, tmp_path: Path) -> None:
    """It is `ok` within two seconds of a restart, and its settings come from its section of the vehicle file."""
    state, out = tmp_path / "state.json", tmp_path / "out.jsonl"
    vehicle = tmp_path / "car.toml"
    generic = (REPO / "dbc" / "generic.toml").read_text(encoding="utf-8")
    for dbc in (REPO / "dbc").glob("*.dbc"):
        (tmp_path / dbc.name).symlink_to(dbc)
    vehicle.write_text(f"{generic}\n[moving]\nwindow = 40\n", encoding="utf-8")
    words = ("-m", "canid", "replay", LOG, "--vehicle", vehicle, "--speed", "max", "--state", state)
    done = python(tree, *words, "--stop", 45, "--json", out)
    assert any(e.get("estimator") == "moving" and e["status"] == "ok" for e in rows(out))
    done = python(tree, *words, "--start", 45, "--stop", 47, "--json", out)
    assert "continue from the state" in done.stderr
    assert any(e.get("estimator") == "moving" and e["status"] == "ok" for e in rows(out))
    done = python(tree, *words, "--start", 45, "--stop", 47)
    assert "moving" in done.stdout
    vehicle.write_text(f"{generic}\n[movng]\nwindow = 40\n", encoding="utf-8")
    assert 'did you mean "moving"?' in python(tree, *words, code=2).stderr
    vehicle.write_text(f"{generic}\n[moving]\nwindow = 1\n", encoding="utf-8")
    assert "moving.window: must be greater than or equal to 5" in python(tree, *words, code=2).stderr


LIVE = """
import math, sys, threading
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.analysis.session.session import Result, SessionSettings, session
from canid.values.types import Estimate
from canid.ui.views.terminal_view import picture, state

config = {"interface": "virtual", "channel": "third"}
buses = open_buses([config])
frames = [frame for frame in open_log(sys.argv[1]) if frame.t <= 30.0]
sender = threading.Thread(target=onto, args=(config, iter(frames), math.inf))
sender.start()
view = state.View("third")
# an installed canid would go before this copy in a child of its own making (canid.values.processes.child_process)
child = [sys.executable, "-m", "canid.analysis.session.estimator_process", "generic"]
ended = lambda: not sender.is_alive()
for item in session(buses, SessionSettings("generic", finish=120.0, command=child), stopped=ended):
    if isinstance(item, Result) and isinstance(item.item, Estimate):
        view = state.update(view, item.item)
print("\\n".join("".join(span.text for span in line) for line in picture.render(view, 100, 40)))
print({e.estimator: e.status.value for e in view.estimates})
"""


@pytest.mark.slow("estimates over whole drives")
def test_live_and_the_display_show_it(tree: Path) -> None:
    """Half a minute on a virtual bus, through the estimators' own process, onto the display."""
    done = python(tree, "-c", LIVE, LOG)
    shown, estimates = done.stdout.rsplit("\n", 2)[:2]
    assert "moving" in shown
    assert "'moving': 'ok'" in estimates


@pytest.mark.slow("estimates over whole drives")
def test_the_contract_test_runs_over_it(tree: Path) -> None:
    """All tests of tests/estimators/test_contract.py, for this estimator alone."""
    tests = tree / "tests"
    tests.mkdir()
    for name in ("conftest.py", "test_contract.py"):
        shutil.copy(REPO / "tests" / "estimators" / name, tests)
    for name in ("__init__.py", "exact.py"):
        shutil.copy(REPO / "tests" / name, tests)
    shutil.copy(REPO / "pyproject.toml", tree)
    done = python(
        tree, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-k", "moving", tests
    )
    assert " passed" in done.stdout
    assert "moving" in (tree / "canid" / "mathematics" / "estimators" / "__init__.py").read_text(
        encoding="utf-8"
    )
