"""Files that canid ships are found by their names, and a name that is misspelt costs no imports."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import canid
from canid.values.shipped_files import located, shipped

LOG = "following_mixed.blf"


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "canid", *words], cwd=folder, capture_output=True, text=True, check=False
    )


def test_only_a_bare_name_that_the_folder_does_not_have_is_a_shipped_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user's own file wins, a link to nothing as well; a path is never replaced."""
    monkeypatch.chdir(tmp_path)
    for name in ("generic.dbc", LOG, "following_motorway.asc"):
        assert located(name).is_file(), name
        assert located(tmp_path / name) == tmp_path / name
    (tmp_path / "generic.dbc").write_text("mine")
    (tmp_path / LOG).symlink_to("nothing")
    assert located("generic.dbc") == Path("generic.dbc")
    assert located(LOG) == Path(LOG)
    assert located("no.dbc") == Path("no.dbc")


@pytest.mark.slow("five commands in processes of their own")
def test_commands_in_an_empty_folder_find_what_is_shipped(tmp_path: Path) -> None:
    """Logs, DBC files, and the DBC file of a vehicle file that names it; nothing is written in their folder."""
    before = {path.name for path in (shipped().parent / "replay_logs").iterdir()}
    assert run(tmp_path, "look", LOG, "--dbc", "generic.dbc").returncode == 0
    assert run(tmp_path, "init", "generic.dbc", "--log", LOG, "-o", "mine.toml", "--yes").returncode == 0
    assert 'dbc = ["shipped:generic.dbc"]' in (tmp_path / "mine.toml").read_text()
    assert run(tmp_path, "check", "--vehicle", "mine.toml").returncode == 0
    assert run(tmp_path, "decode", LOG, "--dbc", "generic.dbc", "--stop", "0.2").returncode == 0
    got = run(tmp_path, "recover", LOG)
    assert got.returncode == 2
    assert {path.name for path in (shipped().parent / "replay_logs").iterdir()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml"]


def test_the_users_own_log_of_a_shipped_name_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through Python as well."""
    monkeypatch.chdir(tmp_path)
    shipped_signals = canid.read_signals(LOG, "generic")
    shutil.copy(shipped().parent / "replay_logs" / "following_urban.blf", tmp_path / LOG)
    own = canid.read_signals(LOG, "generic")
    assert (
        len(own["speed"].t) != len(shipped_signals["speed"].t)
        or (own["speed"].value != shipped_signals["speed"].value).any()
    )


@pytest.mark.parametrize("verb", ["identify", "diagnose", "check", "compare", "look", "export"])
def test_a_misspelt_log_is_an_error_before_anything_is_computed_with(verb: str, tmp_path: Path) -> None:
    """scipy, pydantic and the DBC reader are not imported: they take most of the time to the message."""
    words = [verb, "nosuch.blf", *(["--to", "csv"] if verb == "export" else [])]
    words += [] if verb == "look" else ["--vehicle", "generic"]
    program = (
        "import sys; from canid.ui.cli import main; code = main(sys.argv[1:]); "
        "heavy = {'scipy', 'pydantic', 'cantools', 'control'} & set(sys.modules); "
        "print(code, sorted(heavy))"
    )
    got = subprocess.run(
        [sys.executable, "-c", program, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert got.stderr == "canid: no such log: nosuch.blf\n"
    assert got.stdout == "2 []\n"


@pytest.mark.long("verbs on whole logs")
def test_what_is_written_beside_a_log_is_not_written_into_the_package(tmp_path: Path) -> None:
    """`export` without -o names its files after the log: a shipped one needs -o."""
    words = ("export", "lane_keeping.blf", "--dbc", "generic.dbc")
    before = sorted(shipped().parent.glob("replay_logs/*"))
    ran = run(tmp_path, *words)
    assert (ran.returncode, ran.stderr.count("\n")) == (2, 1)
    assert sorted(shipped().parent.glob("replay_logs/*")) == before
    assert run(tmp_path, *words, "-o", "x").returncode == 0
    assert list(tmp_path.glob("x.*"))
