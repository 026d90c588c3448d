"""On a disk that is full no document is left behind in part: exit code 5, and what was there before stays."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.values.errors import NOT_WRITTEN
from tests.cli.conftest import ROOT

VERBS: dict[str, tuple[str, ...]] = {
    "identify --report": ("identify", "LOG", "--vehicle", "generic", "--report", "OUT.html"),
    "identify --json": ("identify", "LOG", "--vehicle", "generic", "--json", "OUT.json"),
    "check --report": ("check", "LOG", "--vehicle", "generic", "--report", "OUT.html"),
    "look --json": ("look", "LOG", "--json", "OUT.json"),
    "compare": ("compare", "LOG", "LOG", "--vehicle", "generic", "--report", "OUT.html"),
    "export": ("export", "LOG", "--vehicle", "generic", "-o", "OUT"),
    "study": ("study", "prints", "-o", "OUT"),
    "init": ("init", "DBC", "-o", "OUT.toml"),
    "identify --plot": ("identify", "LOG", "--vehicle", "generic", "--plot", "OUT.svg"),
}


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A file system of 64 kB."""
    folder = tmp_path_factory.mktemp("disk")
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"cannot mount: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("verb", VERBS)
def test_nothing_is_left_in_part(verb: str, disk: Path, log: Path) -> None:
    """With 4 kB left, or none: exit 5, one line, and no file but the one that fills the disk."""
    for path in disk.rglob("*"):
        if path.is_file():
            path.unlink()
    room = 0 if verb in ("look --json", "identify --json", "init", "identify --plot") else 4096
    (disk / "full").write_bytes(bytes(65536 - room))
    given = {"LOG": str(log), "DBC": str(ROOT / "dbc/generic.dbc")}
    words = [given.get(word, word.replace("OUT", str(disk / "out"))) for word in VERBS[verb]]
    done = subprocess.run(
        [sys.executable, "-m", "canid", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    left = sorted(str(path.relative_to(disk)) for path in disk.rglob("*") if path.is_file())
    assert done.returncode == NOT_WRITTEN, done.stderr
    assert "Traceback" not in done.stderr
    assert "No space left on device" in done.stderr
    assert left == ["full"], left
