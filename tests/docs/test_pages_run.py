"""The pages for users do what they say: their commands and their Python run in order, and print what stands below them."""

from __future__ import annotations

import argparse
import re
import shlex
import shutil
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import pytest

from canid.ui.cli import completion, main
from canid.ui.cli.verbs import VERBS
from canid.values.errors import DONE, NO_BUS
from tests.fixtures.demo_folder import made_by_demo

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = (
    "install", "bus_in_five_minutes", "i_have_a_log", "my_own_car", "ci_on_a_virtual_bus", "reading_a_report",
    "recording_reliably", "python", "fleet",
)  # fmt: skip
# what may follow the language of a block, each with its reason
PHYSICAL, NOT_RUN = "needs a physical bus: ", "not run: "


class Block(NamedTuple):
    """A fenced block."""

    language: str
    mark: str  # what follows the language
    text: str


def blocks(page: str) -> list[Block]:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    return [Block(*found) for found in re.findall(r"^```(\w+) ?(.*)\n((?:.*\n)*?)```$", text, flags=re.M)]


def commands(block: Block) -> list[list[str]]:
    """The words of each line that is a command of canid, without a comment, a redirection and the program itself."""
    lines = [
        shlex.split(line, comments=True) for line in block.text.splitlines() if line.startswith("canid ")
    ]
    return [list(takewhile(lambda word: word not in (">", "|", "&"), words[1:])) for words in lines]


def on_virtual(words: list[str]) -> list[str]:
    """The same on python-can's virtual bus, for half a second."""
    if "--duration" in words:
        at = words.index("--duration")
        del words[at : at + 2]
    return [word.replace("socketcan", "virtual") for word in words] + ["--duration", "0.5"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `canid demo` leaves, made without its waiting; and a user's own log and database."""
    folder = tmp_path_factory.mktemp("demo")
    made_by_demo(folder / "demo_out")
    shutil.copy(ROOT / "replay_logs/following_mixed.blf", folder / "my_drive.blf")
    shutil.copy(ROOT / "dbc/generic.dbc", folder / "my_car.dbc")
    return folder


@pytest.mark.slow("the commands of a page")
@pytest.mark.parametrize("page", PAGES)
def test_a_page_runs(
    page: str, demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(demo, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    printed = ""
    for block in blocks(page):
        assert not block.mark or block.mark.startswith((PHYSICAL, NOT_RUN)), block.mark
        if block.language == "text":
            assert_printed(block.text, printed)
        elif block.language == "python":
            exec(compile(block.text, f"{page}.md", "exec"), {"__name__": page})  # it is our own text
        elif block.language == "sh" and not block.mark.startswith(NOT_RUN):
            others = [
                line for line in block.text.splitlines() if line and not line.startswith(("canid ", "#"))
            ]
            assert not others, f"only canid is run: {others}"
            for words in commands(block):
                code = main(on_virtual(words) if block.mark else words)
                out, err = capsys.readouterr()
                # nobody sends on the virtual bus that stands for a physical one
                assert code == (NO_BUS if block.mark else DONE), (page, words, err)
                printed = out + err


def assert_printed(shown: str, printed: str) -> None:
    """Every line that a page shows is among those that were printed, in whatever width."""
    lines = {" ".join(line.split()) for line in printed.splitlines()}
    missing = [line for line in shown.splitlines() if line != "…" and " ".join(line.split()) not in lines]
    assert not missing, f"not printed: {missing}; printed:\n{printed}"


@pytest.mark.parametrize("page", sorted(path.stem for path in DOCS.glob("*.md")))
def test_every_command_of_the_tutorials_is_understood(page: str) -> None:
    """Also of those that are not run; and no page names a verb that does not exist."""
    parser = completion.full_parser()
    verbs = {verb.name for verb in VERBS} | {"VERB", "--version", "--help", "--print-completion"}
    for block in blocks(page):
        for words in commands(block) if block.language == "sh" else ():
            assert words[0] in verbs, words
            if page in PAGES:
                _parser_of(words, parser).parse_args(words)


def _parser_of(words: list[str], full: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """That of a verb, or of what follows one, such as `fleet query`."""
    if words[0].startswith("-") or len(words) < 2:
        return full
    verb = next(verb for verb in VERBS if verb.name == words[0])
    if words[1] not in verb.parts:
        return full
    parser = argparse.ArgumentParser(f"canid {words[0]}")
    part = parser.add_subparsers().add_parser(words[0]).add_subparsers().add_parser(words[1])
    verb.module(words[1]).arguments(part)
    return parser
