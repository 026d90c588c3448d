"""The wheel works outside the repository, the sdist is complete, and the metadata are those that an index takes."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest

from canid.cli.demo import next_steps

ROOT = Path(__file__).parents[2]
# folders and files that belong to one machine
RUBBISH = re.compile(
    r"(^|/)(\.venv|\.vm|build|dist|out|__pycache__|\.[a-z]+_cache|\.hypothesis)/|\.pyc$|\.diagnosis\.html$"
)


def run(
    words: Sequence[str | Path], cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program; a failure shows what it said."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHONPATH", "CAN_"))}
    done = subprocess.run(
        words,
        cwd=cwd,
        env=clean | (environment or {}),
        text=True,
        capture_output=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of wheel and sdist, by `python -m build`, without a network."""
    for module in ("build", "hatchling", "twine"):
        if find_spec(module) is None:
            pytest.skip(f"{module} is not installed: pip install -e '.[dev]'")
    folder = tmp_path_factory.mktemp("built")
    # of hatchling in a folder of PYTHONPATH, too
    path = {"PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    run([sys.executable, "-m", "build", "--no-isolation", "-o", folder, ROOT], folder, path)
    return folder


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel in a folder of its own; its dependencies are those of this Python."""
    folder = tmp_path_factory.mktemp("installed")
    options = ["--no-index", "--no-deps", "--no-compile", "--target", str(folder)]
    run([sys.executable, "-m", "pip", "install", *options, next(built.glob("*.whl"))], folder)
    return folder


def test_an_index_takes_both(built: Path) -> None:
    """Metadata, classifiers and the README, which is rendered."""
    files = sorted(built.iterdir())
    assert [file.suffix for file in files] == [".whl", ".gz"]
    run([sys.executable, "-m", "twine", "check", "--strict", *files], built)


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
    assert "_shtab_canid" in canid("--print-completion", "bash")
    assert ".TH CANID 1" in (installed / "share/man/man1/canid.1").read_text("utf-8")


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
