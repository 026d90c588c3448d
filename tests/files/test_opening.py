"""A file is opened for writing only where nothing else can be written through its name."""

from __future__ import annotations

import os
import random
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from canid.io.files import opening
from canid.values.processes import limits

CONTENT = b"a recording"


def symbolic(path: Path, target: Path) -> None:
    path.symlink_to(target)


def hanging(path: Path, target: Path) -> None:
    path.symlink_to(target.with_name("nothing"))


def chained(path: Path, target: Path) -> None:
    path.with_name("between").symlink_to(target)
    path.symlink_to("between")


def hard(path: Path, target: Path) -> None:
    os.link(target, path)


def fifo(path: Path, target: Path) -> None:
    os.mkfifo(path)


def folder(path: Path, target: Path) -> None:
    path.mkdir()


@pytest.mark.parametrize("plant", [symbolic, hanging, chained, hard, fifo, folder])
def test_what_is_planted_is_not_opened(tmp_path: Path, plant: Callable[[Path, Path], None]) -> None:
    """Neither a new nor an existing file is what a link leads to, and nothing waits for a reader."""
    target, path = tmp_path / "recording", tmp_path / "name"
    target.write_bytes(CONTENT)
    plant(path, target)
    with pytest.raises(FileExistsError):
        opening.create(path)
    with pytest.raises(OSError, match=r"link|not a regular file"):
        opening.existing(path)
    assert target.read_bytes() == CONTENT
    assert not (tmp_path / "nothing").exists()


@pytest.mark.parametrize("plant", [symbolic, hanging, chained, hard, fifo])
def test_a_replacement_takes_the_name_alone(tmp_path: Path, plant: Callable[[Path, Path], None]) -> None:
    """What had the name before keeps its content, and no temporary name is left."""
    target, path = tmp_path / "recording", tmp_path / "name"
    target.write_bytes(CONTENT)
    plant(path, target)
    before = set(os.listdir(tmp_path))
    with opening.replacement(path) as file:
        file.write(b"new")
    assert (target.read_bytes(), path.read_bytes()) == (CONTENT, b"new")
    assert stat.S_ISREG(path.lstat().st_mode)
    assert set(os.listdir(tmp_path)) == before


def test_a_replacement_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    """Whether writing fails or the check before the name."""
    path = tmp_path / "name"
    path.write_bytes(CONTENT)

    def refused() -> None:
        raise ValueError("refused")

    with pytest.raises(ValueError, match="refused"), opening.replacement(path, refused) as file:
        file.write(b"new")
    with pytest.raises(TypeError), opening.replacement(path) as file:
        file.write("no bytes")  # type: ignore[arg-type]
    assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [("name", CONTENT)]


def test_temporary_names_are_random_and_fit(tmp_path: Path, seed: int) -> None:
    """A name as long as the system allows has temporary names too, and they are found again; others are not."""
    rng = random.Random(seed)
    target = tmp_path / ("ä" * rng.randrange(1, 127) + rng.choice(("", ".blf", "[a]*")))
    made = []
    for _ in range(3):
        fd, path = opening.create_temporary(target)
        os.close(fd)
        made.append(path)
    (tmp_path / f".{target.name[:40]}.0123.new").touch()
    (tmp_path / ".other.0123456789abcdef.new").touch()
    assert len(set(made)) == 3
    assert sorted(opening.leftovers(target)) == sorted(made)


def test_only_proc_has_settings(tmp_path: Path) -> None:
    """A setting of the kernel is no way to write a file."""
    with pytest.raises(ValueError, match="not a file of /proc"):
        limits.kernel_setting(str(tmp_path / "a"), "1")
