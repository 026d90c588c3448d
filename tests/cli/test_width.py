"""No line of a result is wider than a terminal of 80 columns, whatever the paths and names; a path stays whole."""

from __future__ import annotations

import random
import re
import shutil
import string
from pathlib import Path

import pytest

from canid.ui.cli import main
from canid.ui.views.document.document import Table
from canid.ui.views.document.document_text import WIDTH, block_lines

ROOT = Path(__file__).parents[2]
# a command is one line, so that it can be copied
COMMAND = re.compile(r"^next: ")


def drawn(rng: random.Random, chars: int) -> str:
    return "".join(rng.choices(string.ascii_letters + string.digits + "_-", k=chars))


@pytest.fixture
def files(tmp_path: Path, seed: int) -> tuple[Path, Path]:
    """A log and a vehicle file with a DBC, with long names, in a folder with a long name."""
    rng = random.Random(seed)
    folder = tmp_path / drawn(rng, rng.randint(60, 110)) / drawn(rng, rng.randint(20, 70))
    folder.mkdir(parents=True)
    log = folder / f"{drawn(rng, rng.randint(30, 90))}.blf"
    shutil.copy(ROOT / "replay_logs/following_urban.blf", log)
    dbc, vehicle = ((ROOT / f"dbc/generic.{ending}").read_text() for ending in ("dbc", "toml"))
    for name in ("VehicleSpeed", "LeadDistance"):
        # the longest that a DBC allows
        long = f"{name}_{drawn(rng, 31 - len(name))}".replace("-", "_")
        dbc, vehicle = (re.sub(rf"\b{name}\b", long, text) for text in (dbc, vehicle))
    (folder / "generic.dbc").write_text(dbc)
    car = folder / f"{drawn(rng, rng.randint(30, 90))}.toml"
    car.write_text(vehicle)
    return log, car


@pytest.mark.long("verbs on whole logs")
@pytest.mark.parametrize(
    "words", ["check --vehicle CAR", "check --vehicle CAR LOG", "check LOG", "look LOG", "look LOG --dbc DBC"]
)
def test_no_line_is_wider(
    words: str, files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log, car = files
    paths = {"LOG": str(log), "CAR": str(car), "DBC": str(car.parent / "generic.dbc")}
    monkeypatch.chdir(ROOT)
    main([paths.get(word, word) for word in words.split()])
    printed = capsys.readouterr().out
    if words.startswith("look"):
        # tables adapt to the terminal; into a file they are wider, so that names stay whole
        printed = printed.partition("\n\n")[0]
    wide = [line for line in printed.splitlines() if len(line) > WIDTH and not COMMAND.match(line)]
    assert not [line for line in wide if len(line.split()) > 1], wide
    assert all(any(path in line for path in paths.values()) for line in wide)


def test_a_table_that_is_too_wide_has_a_paragraph_for_each_row(seed: int) -> None:
    rng = random.Random(seed)
    rows = [tuple(drawn(rng, rng.randint(1, 35)) for _ in range(4)) for _ in range(5)]
    for width in (40, WIDTH, 200):
        made = block_lines(Table(("role", ">readings", "from", "unit"), rows), width)
        assert all(len(line) <= width for line in made)
        assert all(cell in " ".join(made) for row in rows for cell in row)
