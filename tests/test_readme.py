"""Every command in the README is one that canid takes, those that need no bus run, and its Python prints what it says."""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from canid.ui.cli import main
from canid.ui.cli.verbs import VERBS
from tests.fixtures.demo_folder import made_by_demo

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, flags=re.S)
# in blocks, and in the first column of the table of commands; a command that stands in both is run once
COMMANDS = [
    *dict.fromkeys(
        [
            line.split("#")[0].strip()
            for kind, text in BLOCKS
            if kind == "sh"
            for line in text.splitlines()
            if line.startswith("canid ")
        ]
        + re.findall(r"^\| `(canid .*?)` \|", README, flags=re.M)
    )
]
# these wait for a bus or play for half a minute; `demo` has a test of its own
WAITING = ("live", "record", "demo", "--onto")


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what `canid demo` leaves, made without its waiting, and the logs and vehicles of the repository."""
    folder = tmp_path_factory.mktemp("readme")
    for name in ("replay_logs", "dbc"):
        (folder / name).symlink_to(ROOT / name)
    made_by_demo(folder / "demo_out")
    return folder


def test_every_verb_is_shown() -> None:
    """In the table are the rows that the verbs themselves bring."""
    assert {command.split()[1] for command in COMMANDS} == {verb.name for verb in VERBS}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    _, name, *words = shlex.split(command)
    parser = argparse.ArgumentParser()
    next(verb for verb in VERBS if verb.name == name).module().arguments(parser)
    parser.parse_args(words)


@pytest.mark.slow("whole drives through the pipeline")
def test_commands_that_need_no_bus_run(
    demo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the README's order: a later one may use what an earlier one wrote."""
    monkeypatch.chdir(demo)
    for command in COMMANDS:
        if any(word in command.split() for word in WAITING):
            continue
        assert main(shlex.split(command)[1:]) == 0, (command, capsys.readouterr().err)


def test_every_picture_and_page_is_there() -> None:
    missing = [path for path in re.findall(r"\]\(([^)#:]+)", README) if not (ROOT / path).is_file()]
    assert not missing


@pytest.mark.slow("whole drives through the pipeline")
def test_the_python_example_prints_what_it_says(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(demo)
    kinds = [kind for kind, _ in BLOCKS]
    at = kinds.index("python")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(BLOCKS[at][1], "README.md", "exec"), {})  # it is our own text
    assert printed.getvalue() == BLOCKS[at + 1][1]
