"""TAB in a real bash completes verbs, options, files and shipped vehicles; the scripts of all shells name every verb."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator

import pytest

from canid.ui.cli.completion import SHELLS, script
from canid.ui.cli.verbs import VERBS
from canid.values.errors import ConfigError
from tests.fixtures import terminal
from tests.fixtures.terminal import Terminal

# what is typed before TAB, and the line after it
TYPED = (
    ("canid ide", "canid identify"),
    ("canid identify --veh", "canid identify --vehicle"),
    ("canid identify dri", "canid identify drive.blf"),
    ("canid identify fol", "canid identify folder/"),
    ("canid identify drive.blf other", "canid identify drive.blf other.asc"),
    ("canid identify drive.blf --vehicle toy", "canid identify drive.blf --vehicle toyota_rav4_2017"),
    ("canid identify drive.blf --vehicle min", "canid identify drive.blf --vehicle mine.toml"),
    ("canid identify drive.blf --vehicle mine.toml --rep", "canid identify drive.blf --vehicle mine.toml --report"),
    ("canid study gro", "canid study grover"),
)  # fmt: skip


@pytest.fixture(scope="module")
def bash(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Terminal]:
    """A bash that has read the script, in a folder with a few files."""
    if why := terminal.missing():
        pytest.skip(why)
    folder = tmp_path_factory.mktemp("bash")
    (folder / "completion").write_text(script("bash"))
    for name in ("drive.blf", "other.asc", "mine.toml"):
        (folder / name).touch()
    (folder / "folder").mkdir()
    window = Terminal(folder, 120, 20)
    window.type(". ./completion; clear; echo ready")
    window.wait(lambda screen: screen.startswith("ready"))
    yield window
    window.close()


@pytest.mark.parametrize(("typed", "completed"), TYPED)
def test_tab_completes(bash: Terminal, typed: str, completed: str) -> None:
    bash.press(typed)
    bash.key("Tab")
    bash.wait(lambda screen: any(line.strip() == f"$ {completed}" for line in screen.splitlines()))
    bash.key("C-u")


@pytest.mark.parametrize("shell", SHELLS)
def test_every_verb_is_in_every_script(shell: str) -> None:
    text = script(shell)
    assert [verb.name for verb in VERBS if verb.name not in text] == []
    program = shutil.which(shell)
    if program is not None:
        checked = subprocess.run([program, "-n"], input=text, text=True, capture_output=True, check=False)
        assert (checked.returncode, checked.stderr) == (0, "")


def test_an_unknown_shell_is_refused() -> None:
    with pytest.raises(ConfigError, match="known are bash, zsh, fish"):
        script("nu")
