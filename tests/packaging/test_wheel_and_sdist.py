"""The wheel works outside the repository, the sdist is complete, and the metadata are those that an index takes."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from canid.ui.cli.commands.demo import next_steps
from tests.packaging.conftest import run

ROOT = Path(__file__).parents[2]
# folders and files that belong to one machine
RUBBISH = re.compile(
    r"(^|/)(\.venv|\.vm|build|dist|out|__pycache__|\.[a-z]+_cache|\.hypothesis)/|\.pyc$|\.diagnosis\.html$"
)


@pytest.mark.slow("builds a wheel")
def test_an_index_takes_both(built: Path) -> None:
    """Metadata, classifiers and the README, which is rendered."""
    files = sorted(built.iterdir())
    assert [file.suffix for file in files] == [".whl", ".gz"]
    run([sys.executable, "-m", "twine", "check", "--strict", *files], built)


@pytest.mark.slow("builds a wheel")
def test_the_wheel_works_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    """With the log and the vehicle that it brings, and the steps that the demo names."""

    def canid(*words: str) -> str:
        return run([sys.executable, "-m", "canid", *words], tmp_path, {"PYTHONPATH": str(installed)}).stdout

    where = run(
        [sys.executable, "-c", "import canid; print(canid.__file__)"],
        tmp_path,
        {"PYTHONPATH": str(installed)},
    )
    assert where.stdout.strip() == str(installed / "canid/__init__.py")
    log = installed / "canid/_data/replay_logs/following_urban.blf"
    (tmp_path / "demo_out").mkdir()
    shutil.copy(log, tmp_path / "demo_out/demo.blf")  # what the demo records, frame for frame
    printed = ""
    for line in next_steps("demo_out/demo.blf"):
        command, _, more = line.partition("canid ")[2].partition("  ")
        if not more and not command.startswith("replay"):
            printed += canid(*shlex.split(command))
    assert (tmp_path / "drive.html").stat().st_size > 10_000
    canid("replay", "demo_out/demo.blf", "--vehicle", "generic", "--stop", "3", "--speed", "max")
    assert "the vehicle file fits" in printed
    assert "6 unstable poles" in canid("study", "prints", "grover")
    assert "_shtab_canid" in canid("--print-completion", "bash")
    assert ".TH CANID 1" in (installed / "share/man/man1/canid.1").read_text("utf-8")


@pytest.mark.slow("builds a wheel")
def test_the_sdist_is_complete_and_nothing_else_is_in_it(built: Path, tmp_path: Path) -> None:
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        archive.extractall(tmp_path, filter="data")
    (root,) = tmp_path.iterdir()
    inside = {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
    assert [name for name in inside if RUBBISH.search(name)] == []
    # of a checkout; an unpacked sdist has no list of its files
    if shutil.which("git") is not None:
        tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, text=True, capture_output=True, check=False)
        here = {name for name in tracked.stdout.splitlines() if (ROOT / name).is_file()}
        assert here - inside == set()
    done = run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "tests/test_readme.py",
            "-k",
            "understood",
        ],
        root,
    )
    assert " passed" in done.stdout
