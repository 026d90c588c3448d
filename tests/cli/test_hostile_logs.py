"""Hostile logs at the command line: exit 4 and one sentence on how much was read and where the damage is."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.io.logs import open_log, write_log
from canid.values.errors import DAMAGED, DONE, USAGE
from tests.damaged_logs.hostile import FAMILIES, write

Canid = Callable[..., Any]
SIZE = 64 * 1024
# What is unusual but no damage: objects of other types, empty lines, comments, headers
SOUND = {
    "size 16, bare.blf", "size 16, stored.blf", "size 16, bomb.blf", "objects within objects, bomb.blf",
    "containers within containers.blf", "bombs within bombs.blf", "frames, bomb.blf", "markers, bomb.blf",
    "base.asc", "base relative.asc", "dates.asc", "comments.asc", "empty.asc", "base.asc.gz", "empty.asc.gz",
    "empty.log.gz", "comments.trc",
}  # fmt: skip
# Nothing at all can be read
HOPELESS = {"no log.blf", "zeros.mf4"}
# Ends after ten CPU s, in the process of asammdf: the benchmark's
SLOW = {"links.mf4"}
SAID = re.compile(
    r"read \d+( of \d+)? (objects|frame lines)(, bytes \d+–\d+( and \d+ more places?)? damaged)?: "
)


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("name", sorted({*FAMILIES} - SLOW))
def test_recover(canid: Canid, name: str, tmp_path: Path) -> None:
    """Of each hostile file: a copy of what is whole, and what is not is reported with its place."""
    path = write(name, tmp_path, SIZE)
    ran = canid("recover", path, "-o", tmp_path / "copy.blf")
    if name in HOPELESS:
        assert ran.code == (DAMAGED if path.read_bytes().startswith(b"MDF") else USAGE)
        assert str(path) in ran.line
        return
    assert ran.code == (DONE if name in SOUND else DAMAGED), ran.err
    assert "Traceback" not in ran.err
    said = [line for line in ran.err.splitlines() if SAID.search(line)]
    assert len(said) == (name not in SOUND), ran.err
    if said and not name.endswith(".gz"):
        assert "damaged: " in said[0]
    copy = open_log(tmp_path / "copy.blf")
    assert sum(1 for _ in copy) > 0
    assert copy.damage is None


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(
    "name",
    [
        "streams within streams.blf", "signatures, bomb.blf", "too large.blf", "short.asc", "one line.asc",
        "broken.asc.gz", "short.log",
    ],
)  # fmt: skip
def test_replay_and_identify(canid: Canid, log: Path, name: str, tmp_path: Path) -> None:
    """A drive with something hostile behind it: the drive is estimated, the rest reported, exit 4."""
    hostile = write(name, tmp_path, SIZE)
    suffix = "".join(hostile.suffixes)
    path = tmp_path / f"drive{suffix}"
    if suffix == ".blf":
        path.write_bytes(log.read_bytes() + hostile.read_bytes()[144:])
    else:
        plain = tmp_path / f"plain{hostile.suffixes[0]}"
        write_log(plain, open_log(log), 1_600_000_000.0)
        drive = plain.read_bytes()
        # the end of the trigger block is no end of the file here
        path.write_bytes((gzip.compress(drive) if suffix.endswith(".gz") else drive) + hostile.read_bytes())
    for verb in ("replay", "identify"):
        ran = canid(verb, path, "--vehicle", "generic", "--json", tmp_path / f"{verb}.json")
        assert ran.code == DAMAGED, ran.err
        assert "Traceback" not in ran.err
        assert len([line for line in ran.err.splitlines() if SAID.search(line)]) == 1, ran.err
        assert (tmp_path / f"{verb}.json").stat().st_size > 0
