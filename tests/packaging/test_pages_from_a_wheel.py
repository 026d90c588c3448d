"""README and five-minute pages from an installed wheel, in a folder that was empty before `canid demo`."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from canid.values.errors import DONE, NO_BUS
from tests.docs.test_pages_run import PHYSICAL, assert_printed, blocks, commands, on_virtual
from tests.test_readme import BLOCKS, COMMANDS

# interfaces of rows that need one: python-can's virtual bus stands for it, and nobody sends there
_PHYSICAL = re.compile(r"-i (socketcan|pcan|vector|kvaser)\b")
FIVE_MINUTES = ("i_have_a_log", "my_own_car", "ci_on_a_virtual_bus", "bus_in_five_minutes")


def python(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python that sees the wheel, and nothing of the checkout."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "CAN_"))}
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=clean | {"PYTHONPATH": str(installed)},
        text=True,
        capture_output=True,
        check=False,
        timeout=1800,
    )


@pytest.fixture(scope="module")
def folder(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty folder in which `canid demo` has run; and a user's own log and database."""
    folder = tmp_path_factory.mktemp("user")
    done = python(installed, folder, "-m", "canid", "demo")
    assert done.returncode == DONE, done.stderr
    where = python(installed, folder, "-c", "import canid; print(canid.__file__)").stdout.strip()
    assert where == str(installed / "canid/__init__.py")
    return folder


@pytest.mark.slow("builds a wheel, and runs every command of the README")
@pytest.mark.timeout(3600)
def test_every_command_of_the_readme_runs(installed: Path, folder: Path) -> None:
    """In blocks and in tables, in their order; those of a bus on the virtual one."""
    for command in COMMANDS:
        words = shlex.split(command)[1:]
        if words == ["demo"]:
            continue
        needs_bus = _PHYSICAL.search(command) is not None
        if needs_bus:
            words = [re.sub(r"socketcan|pcan", "virtual", word) for word in words]
            words += ["--speed", "max"] if words[0] == "replay" else ["--duration", "0.5"]
        if "--web" in words:
            words.remove("--web")  # it serves until it is ended; tests/web holds the page
        done = python(installed, folder, "-m", "canid", *words)
        expected = NO_BUS if needs_bus and words[0] != "replay" else DONE
        assert done.returncode == expected, (command, done.stdout, done.stderr)


@pytest.mark.slow("builds a wheel")
def test_the_python_of_the_readme_prints_what_it_says(installed: Path, folder: Path) -> None:
    at = [kind for kind, _ in BLOCKS].index("python")
    done = python(installed, folder, "-c", BLOCKS[at][1])
    assert done.stdout == BLOCKS[at + 1][1], done.stderr


@pytest.mark.slow("builds a wheel, and runs the commands of a page")
@pytest.mark.parametrize("page", FIVE_MINUTES)
def test_a_five_minute_page_runs(page: str, installed: Path, folder: Path, tmp_path: Path) -> None:
    """Its commands and its Python, in its order; what it shows is printed."""
    (tmp_path / "demo_out").symlink_to(folder / "demo_out")
    data = installed / "canid/_data"
    shutil.copy(data / "replay_logs/following_mixed.blf", tmp_path / "my_drive.blf")
    shutil.copy(data / "dbc/generic.dbc", tmp_path / "my_car.dbc")
    printed = ""
    for block in blocks(page):
        if block.language == "text":
            assert_printed(block.text, printed)
        elif block.language == "python":
            done = python(installed, tmp_path, "-c", block.text)
            assert done.returncode == 0, done.stderr
        elif block.language == "sh" and not block.mark.startswith("not run"):
            for words in commands(block):
                virtual = block.mark.startswith(PHYSICAL)
                done = python(installed, tmp_path, "-m", "canid", *(on_virtual(words) if virtual else words))
                assert done.returncode == (NO_BUS if virtual else DONE), (words, done.stderr)
                printed = done.stdout + done.stderr
