"""A verb with JSON is a new module and its line in `canid/ui/cli/verbs.py`; all else follows, or is made by one command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs/following_urban.blf"
MODULE = '''
"""`canid gates LOG`: how often frames of each bus come."""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple

from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, outputs
from canid.ui.terminal.messages import line_printer
from canid.values.errors import DONE
from canid.io.logs import open_log
from canid.values.types import Interval
from canid.values.text import json_values


class Gate(NamedTuple):
    """One bus."""

    bus: int
    rate: Interval  # 1/s


class Gates(NamedTuple):
    """The object of --json."""

    log: str
    gates: tuple[Gate, ...]


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"gates": Gates}


def run(args: argparse.Namespace) -> int:
    """Count."""
    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    buses = sorted({frame.bus for frame in open_log(args.log)})
    gates = Gates(args.log, tuple(Gate(bus, Interval(1.0)) for bus in buses))
    for gate in gates.gates:
        line_printer(args.json)(f"bus {gate.bus}")
    with complete_files.opened(json) as sink:
        if sink is not None:
            sink.write(json_values.document("gates", gates) + "\\n")
    return DONE
'''
LINE = """    Verb(
        "gates", "list how often frames come", (Shown("canid gates demo_out/demo.blf", "how often frames come"),)
    ),
)
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the repository in which both edits were made."""
    root = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__", "evidence")
    for name in ("canid", "docs"):
        shutil.copytree(ROOT / name, root / name, ignore=ignored)
    shutil.copy(ROOT / "README.md", root)
    (root / "canid/ui/cli/commands/gates.py").write_text(MODULE.lstrip(), encoding="utf-8")
    verbs = root / "canid/ui/cli/verbs.py"
    text = verbs.read_text(encoding="utf-8")
    assert text.endswith("\n)\n")
    verbs.write_text(text.removesuffix(")\n") + LINE, encoding="utf-8")
    return root


def run(copy: Path, *words: str | Path) -> str:
    """Standard output of Python in the copy."""
    environment = os.environ | {"PYTHONPATH": str(copy)}
    done = subprocess.run(
        [sys.executable, *words], cwd=copy, env=environment, text=True, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.slow("whole commands, one after the other")
def test_help_json_and_schema_follow(copy: Path) -> None:
    canid = ("-m", "canid")
    assert "gates     list how often frames come" in run(copy, *canid, "--help")
    assert "--json FILE" in run(copy, *canid, "gates", "--help")
    schema = json.loads(run(copy, *canid, "schema", "gates"))
    assert schema["$defs"]["Gate"]["required"] == ["bus", "rate"]
    assert "canid/gates/1" in run(copy, *canid, "schema")
    run(copy, *canid, "gates", LOG, "--json", "gates.json")
    written = json.loads((copy / "gates.json").read_text("utf-8"))
    Draft202012Validator(schema).validate(written)
    assert written["gates"][0]["rate"] == {"value": 1.0, "low": None, "high": None}
    assert "gates" in run(copy, *canid, "--print-completion", "bash")


@pytest.mark.slow("whole commands, one after the other")
def test_one_command_writes_the_pages(copy: Path) -> None:
    """README, reference of commands, man page and the keys in docs/json.md; nothing else of them changes."""
    pages = ("README.md", "docs/commands.md", "docs/man/canid.1", "docs/json.md")
    before = {name: (copy / name).read_text("utf-8").splitlines() for name in pages}
    run(copy, "docs/reference_of_commands.py")
    for name in pages:
        after = (copy / name).read_text("utf-8").splitlines()
        assert any("gates" in line for line in after), name
        remaining = iter(after)
        assert all(line in remaining for line in before[name]), name
