"""A folder that is held by its descriptor, with real mounts in a namespace of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from canid.io.files.held_folder import HeldFolder, Standing
from tests.fixtures import mounted_recording

MOUNTS = """
import subprocess, sys
from pathlib import Path
from canid.io.files.held_folder import HeldFolder
base = Path(sys.argv[1])
rec, store = base / "rec", base / "store"
folder = HeldFolder(rec)

def note(what):
    folder.create(what)
    print(what, folder.standing().name, folder.path.name, folder.usable, sorted(path.name for path in rec.iterdir()))

def run(*words):
    subprocess.run([str(word) for word in words], check=True)

run("mount", "-t", "tmpfs", "none", rec)
note("covered")
folder.rename("covered", "renamed")
folder.unlink("renamed")
run("umount", rec)
note("shown")
run("mount", "--bind", rec, rec)
note("itself")
run("umount", rec)
run("mount", "--bind", store, rec)
folder = HeldFolder(rec)
run("umount", "--lazy", rec)
note("detached")
"""


def test_a_mount_over_a_held_folder_changes_nothing(tmp_path: Path) -> None:
    """Names are created, renamed and deleted below it; a folder that was unmounted is another case."""
    why = mounted_recording.unavailable()
    if why:
        pytest.skip(why)
    for name in ("rec", "store"):
        (tmp_path / name).mkdir()
    command = [*mounted_recording.NAMESPACE, sys.executable, "-c", MOUNTS, str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": str(mounted_recording.ROOT)}
    done = subprocess.run(command, check=True, env=environment, capture_output=True, text=True)
    assert done.stdout.splitlines() == [
        "covered COVERED rec True []",
        "shown SHOWN rec True ['shown']",
        "itself SHOWN rec True ['itself', 'shown']",
        "detached GONE rec False ['itself', 'shown']",
    ]
    assert [path.name for path in (tmp_path / "store").iterdir()] == ["detached"]


def test_a_removed_folder_is_gone_also_where_another_one_has_its_path(tmp_path: Path) -> None:
    """And so is one whose parent is removed; nothing can be created in it."""
    path = tmp_path / "a" / "b"
    path.mkdir(parents=True)
    folder = HeldFolder(path)
    shutil.rmtree(tmp_path / "a")
    path.mkdir(parents=True)
    assert (folder.standing(), folder.usable) == (Standing.GONE, False)
    with pytest.raises(FileNotFoundError):
        folder.create("c")
    assert not folder.is_same(HeldFolder(path))


def test_a_link_that_leads_elsewhere_is_not_followed_twice(tmp_path: Path) -> None:
    """The folder is the one that the link led to when it was opened, and is then named by its own path."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    (tmp_path / "link").symlink_to("one")
    folder = HeldFolder(tmp_path / "link")
    assert (folder.standing(), folder.path.name) == (Standing.SHOWN, "link")
    (tmp_path / "link").unlink()
    (tmp_path / "link").symlink_to("two")
    os.close(folder.create("file"))
    assert (folder.standing(), folder.path.name) == (Standing.SHOWN, "one")
    assert [path.name for path in tmp_path.glob("*/file")] == ["file"]
    assert (tmp_path / "one/file").exists()


def test_the_descriptor_is_closed_with_its_last_holder(tmp_path: Path) -> None:
    """What was unmounted lazily becomes free when the recording has left it."""
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    if not before:
        pytest.skip("needs /proc")
    folders = [HeldFolder(tmp_path) for _ in range(5)]
    assert len(os.listdir("/proc/self/fd")) == before + len(folders)
    folders.clear()
    assert len(os.listdir("/proc/self/fd")) == before
