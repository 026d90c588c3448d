"""`canid compare` as a user runs it: logs, parts, halves, JSON, hostile files and names; text, JSON and page agree."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from canid.ui.cli import main
from canid.ui.cli.command_line import READ_BY
from canid.ui.cli.commands.compare import OPTIONS

LOGS = Path(__file__).parents[2] / "replay_logs"
URBAN, MIXED = LOGS / "following_urban.blf", LOGS / "following_mixed.blf"
GENERIC = ("--vehicle", "generic")
WIDTH = 80


class Ran(NamedTuple):
    code: int
    out: str
    err: str


def canid(*words: object) -> Ran:
    """Run canid in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    return Ran(code, out.getvalue(), err.getvalue())


class Compared(NamedTuple):
    """Two logs, compared by themselves and by what identify says of them."""

    ran: Ran
    of: dict[str, Any]
    page: Path
    files: tuple[Path, Path]  # of identify --json


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Compared:
    folder = tmp_path_factory.mktemp("compared")
    files = tuple(folder / f"{log.stem}.json" for log in (URBAN, MIXED))
    for log, file in zip((URBAN, MIXED), files, strict=True):
        assert canid("identify", log, *GENERIC, "--json", file).code == 0
    # a name that is markup and moves a cursor
    hostile = folder / "a<img src=x onerror=alert(1)>\x1b[2J.blf"
    shutil.copy(URBAN, hostile)
    out, page = folder / "out.json", folder / "page.html"
    ran = canid("compare", hostile, MIXED, *GENERIC, "--json", out, "--report", page)
    return Compared(ran, json.loads(out.read_text(encoding="utf-8")), page, (files[0], files[1]))


@pytest.mark.slow("compares many drives")
def test_json_of_identify_compares_as_the_logs_do(compared: Compared, tmp_path: Path) -> None:
    """The same verdict and the same numbers from two logs and from the JSON that identify wrote of them; with each file as
    part of a side, the order of the sides turns the sign."""
    out = tmp_path / "out.json"
    assert canid("compare", *compared.files, "--json", out).code == 0
    again = json.loads(out.read_text(encoding="utf-8"))
    for key in ("verdict", "says", "parameters", "conditions", "critical", "margins_at"):
        assert again[key] == compared.of[key], key
    known = [row for row in again["parameters"] if row["why_not"] is None]
    assert len(known) >= 5
    assert any(row["differs"] for row in known)
    ran = canid("compare", *reversed(compared.files), "--json", out, "--check")
    assert ran.code == 1
    turned = {row["name"]: row for row in json.loads(out.read_text(encoding="utf-8"))["parameters"]}
    for row in known:
        other = turned[row["name"]]["difference"]
        assert other["value"] == pytest.approx(-row["difference"]["value"], rel=1e-9)
        assert other["low"] == pytest.approx(-row["difference"]["high"], rel=1e-9)


@pytest.mark.slow("compares many drives")
def test_the_text_has_80_columns_and_no_control_characters(compared: Compared) -> None:
    """Every line fits a terminal of 80 columns, whatever the files are called, and the verdict stands before the tables."""
    assert compared.ran.code == 0
    lines = compared.ran.out.splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert "\x1b" not in compared.ran.out + compared.ran.err
    verdict = next(k for k, line in enumerate(lines) if line.startswith("DIFFERENT:"))
    assert verdict < next(k for k, line in enumerate(lines) if line.startswith("parameter"))


@pytest.mark.slow("compares many drives")
def test_halves_parts_folders_and_lists_are_sides(tmp_path: Path) -> None:
    """A log alone is compared by halves; parts, a folder and a list join several drives, with the spread between them."""
    out = tmp_path / "out.json"
    assert canid("compare", URBAN, *GENERIC, "--json", out).code == 0
    halves = json.loads(out.read_text(encoding="utf-8"))
    assert [len(halves[side]["drives"]) for side in "ab"] == [1, 1]
    assert "@" in halves["a"]["drives"][0]["name"]
    folder = tmp_path / "drives, of one driver"
    folder.mkdir()
    shutil.copy(URBAN, folder / "one.blf")
    shutil.copy(MIXED, folder / "two.blf")
    assert canid("compare", folder, f"{URBAN}@0:80,{MIXED}@70:", *GENERIC, "--json", out).code == 0
    several = json.loads(out.read_text(encoding="utf-8"))
    assert [len(several[side]["drives"]) for side in "ab"] == [2, 2]
    assert all(row["spread"] is not None for row in several["parameters"] if row["why_not"] is None)


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "no JSON"),
        ("[]", "no JSON object"),
        ('{"frames": 3}', "neither"),
        (
            '{"log": "x", "vehicle": "v", "windows": [], "driver_time": "much", "whole": null}',
            "as canid writes it",
        ),
        ('{"log": 5, "vehicle": "v", "windows": [], "driver_time": 3, "whole": null}', "as canid writes it"),
        (
            '{"log": "x", "vehicle": "v", "windows": [], "driver_time": 3, "whole": {"channels": 7}}',
            "as canid writes it",
        ),
        ("[" * 100_000, "no JSON"),
    ],
)
def test_a_json_file_of_something_else_is_one_line_and_exit_2(
    compared: Compared, tmp_path: Path, text: str, says: str
) -> None:
    """Broken, foreign and hostile JSON: one clear line, no traceback."""
    file = tmp_path / "other.json"
    file.write_text(text, encoding="utf-8")
    ran = canid("compare", file, compared.files[0])
    assert ran.code == 2
    assert ran.err.count("\n") == 1
    assert says in ran.err
    assert "Traceback" not in ran.err


def test_what_is_missing_or_contradicts_itself_is_one_line(tmp_path: Path) -> None:
    """No vehicle, no file, an empty folder, a part that ends before it begins, halves of two, a page that is no page."""
    for words, code in (
        ((URBAN, MIXED), 2),
        ((tmp_path / "none.blf", URBAN, *GENERIC), 2),
        ((tmp_path, URBAN, *GENERIC), 2),
        ((f"{URBAN}@60:30", URBAN, *GENERIC), 2),
        ((URBAN, MIXED, "--halves", *GENERIC), 2),
        ((tmp_path / "none.json", tmp_path / "none.json"), 2),
        ((URBAN, MIXED, *GENERIC, "--report", tmp_path / "page.blf"), 2),
    ):
        ran = canid("compare", *words)
        assert ran.code == code, (words, ran.err)
        assert ran.err.count("\n") == 1
        assert "Traceback" not in ran.err


@pytest.mark.slow("compares many drives")
@pytest.mark.parametrize("width", [1100, 390])
def test_the_page_shows_the_numbers_and_loads_nothing(browser: Any, compared: Compared, width: int) -> None:
    """In Chromium, wide and on a phone: no console message, no request but the file, no markup from names, verdict first,
    nothing beyond the width, and one row per compared parameter with the verdict of the JSON."""
    page = browser.new_page(viewport={"width": width, "height": 800})
    wrong: list[str] = []
    asked: list[str] = []
    page.on("console", lambda m: wrong.append(m.text))
    page.on("pageerror", lambda e: wrong.append(str(e)))
    page.on("request", lambda r: asked.append(r.url))
    page.goto(compared.page.as_uri())
    assert wrong == []
    assert asked == [compared.page.as_uri()]
    assert page.evaluate("document.querySelectorAll('img, script').length") == 0
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.inner_text("h1") == "Different"
    assert compared.of["says"].lower() in page.inner_text(".verdict p").lower()
    known = [row for row in compared.of["parameters"] if row["why_not"] is None]
    rows = page.evaluate("[...document.querySelectorAll('table.compared tbody tr')].map(r => r.innerText)")
    assert ["differs" in row for row in rows] == [row["differs"] for row in known]
    assert page.evaluate("document.querySelectorAll('.drawings circle').length") == 3 * len(known)
    page.close()


def test_the_command_of_a_comparison_has_each_option_once() -> None:
    """All by which logs are read, the time zone too; an option that is written twice reproduces nothing sooner."""
    assert sorted(OPTIONS) == sorted(set(OPTIONS))
    assert set(READ_BY) <= set(OPTIONS)
