"""Every command in the README is one that canid takes, those that need no bus run, and its Python prints what it says."""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

from canid.cli import VERBS, main

REPO = Path(__file__).parents[1]
README = (REPO / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, flags=re.S)
COMMANDS = [
    line.split("#")[0].strip()
    for kind, text in BLOCKS
    if kind == "sh"
    for line in text.splitlines()
    if line.startswith("canid ")
]
# these wait for a bus or play for half a minute; `demo` has a test of its own
WAITING = ("live", "record", "demo", "--onto")


def test_every_verb_is_shown() -> None:
    assert {command.split()[1] for command in COMMANDS} == {name for name, _ in VERBS}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    _, verb, *words = shlex.split(command)
    parser = argparse.ArgumentParser()
    import_module(f"canid.cli.{verb}").arguments(parser)
    parser.parse_args(words)


def test_commands_that_need_no_bus_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the README's order: a later one may use what an earlier one wrote."""
    for folder in ("replay_logs", "dbc"):
        (tmp_path / folder).symlink_to(REPO / folder)
    monkeypatch.chdir(tmp_path)
    for command in COMMANDS:
        if any(word in command.split() for word in WAITING):
            continue
        words = [word.replace("/tmp/", f"{tmp_path}/") for word in shlex.split(command)[1:]]
        assert main(words) == 0, (command, capsys.readouterr().err)


def test_the_python_example_prints_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPO)
    kinds = [kind for kind, _ in BLOCKS]
    at = kinds.index("python")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(BLOCKS[at][1], "README.md", "exec"), {})  # it is our own text
    assert printed.getvalue() == BLOCKS[at + 1][1]
