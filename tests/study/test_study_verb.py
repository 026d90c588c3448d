"""`canid study` as a user has it: files, exit codes, what is refused, and the page in a real browser."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.ui.cli import main
from canid.values.errors import CHECK_FAILED, DONE, NOT_WRITTEN, USAGE
from canid.values.findings import Provenance
from canid.values.text import json_values
from canid_study.artifact import Artifact, ClaimVerdict, Curve, Figure, Panel, Skipped, Study, Table
from canid_study.views import figure_svg, study_files, study_page

# what a test of the page shows: every kind of panel, a missing number, markup in names
STUDY = Study(
    "A paper & more",
    "Title <b>",
    ("One claim fails.",),
    (Artifact("eq. 1", "a|b", "2", "", "3 [2, 4]", ClaimVerdict.FAILS, "why", ("figures/fig_01.svg",)),),
    (Table("table_1", "Table 1", ("name", "K (s)", "K_low"), [("a", 1.5, None), ("b", float("nan"), 2)]),),
    (
        Figure(
            "fig_01",
            "Fig. 1",
            (
                Panel("f (Hz)", "|G|", (Curve(np.array([0.1, 1.0]), np.array([1.0, np.nan])),), log_x=True, log_y=True),
                Panel("x", "y", (Curve(np.zeros(0), np.zeros(0), "none", points=True),), equal=True),
                Panel(
                    "t (s)", "y",
                    (Curve(np.arange(3.0), np.ones(3), "a", np.zeros(3), np.full(3, 2.0), points=True),),
                ),
            ),
        ),
    ),
    (Skipped("a.blf", "segment 3", "it is constant"),),
    (("seed", "1"),),
    ("coverage 0.80, 0.90 needed",),
)  # fmt: skip


def test_a_study_is_complete_in_every_format() -> None:
    """Every number is in JSON and CSV, every row in the text; the same figure gives the same drawing."""
    made = json.loads(json_values.document("study", study_files.document(STUDY, "canid study x")))
    assert made["artifacts"][0]["verdict"] == "fails"
    assert made["figures"][0]["panels"][0]["curves"][0]["y"] == [1.0, None]
    rows = list(csv.reader(study_files.to_csv(STUDY.tables[0]).splitlines()))
    assert rows == [["name", "K (s)", "K_low"], ["a", "1.5", ""], ["b", "", "2"]]
    text = "\n".join(study_files.text(STUDY))
    for word in ("One claim fails.", "eq. 1", "3 [2, 4]", "segment 3", "coverage 0.80"):
        assert word in text
    drawing = figure_svg.drawn(STUDY.figures[0])
    assert drawing == figure_svg.drawn(STUDY.figures[0])
    assert figure_svg.BACKGROUND not in figure_svg.svg(drawing)


@pytest.mark.parametrize(("width", "height"), [(1180, 900), (390, 844)])
def test_the_page_in_a_browser(browser: Any, tmp_path: Path, width: int, height: int) -> None:
    """It loads nothing, reports no error, escapes names, and is as wide as the window, on a phone as well."""
    file = tmp_path / "study.html"
    drawings = {(STUDY.paper, f.name): figure_svg.drawn(f) for f in STUDY.figures}
    file.write_text(study_page.page([STUDY], Provenance(), drawings), encoding="utf-8")
    page = browser.new_page(viewport={"width": width, "height": height})
    wrong: list[str] = []
    asked: list[str] = []
    page.on("console", lambda m: wrong.append(m.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    assert page.locator("h1").inner_text() == "Title <b>"
    assert page.locator("figure svg").count() == 1
    assert page.locator("figure svg").bounding_box()["height"] > 100
    assert page.locator(".artifacts tbody tr").count() == 1
    # every link leads somewhere
    links = page.locator("a[href^='#']").evaluate_all("all => all.map(a => a.getAttribute('href').slice(1))")
    assert links
    assert all(page.locator(f"[id='{name}']").count() == 1 for name in links), links
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()
    assert wrong == []
    assert [url for url in asked if not url.startswith("data:")] == [file.as_uri()]


def test_prints_are_written_again_and_nothing_else_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A study replaces its own files, leaves others, and says what it would have had to replace."""
    out = tmp_path / "out"
    for _ in range(2):
        assert main(["study", "prints", "grover", "-o", str(out)]) == DONE
    made = json.loads((out / "study.json").read_text(encoding="utf-8"))
    files = {file for one in made["artifacts"] for file in one["files"]}
    assert files
    assert all((out / file).is_file() for file in files), files
    assert "six unstable" in " ".join(made["says"]) or "6 unstable" in " ".join(made["says"])
    figure = next((out / "figures").iterdir())
    figure.write_text("<svg>somebody's own drawing</svg>", encoding="utf-8")
    page = (out / "study.html").read_bytes()
    capsys.readouterr()
    assert main(["study", "prints", "grover", "-o", str(out)]) == NOT_WRITTEN
    assert figure.name in capsys.readouterr().err
    assert figure.read_text(encoding="utf-8") == "<svg>somebody's own drawing</svg>"
    assert (out / "study.html").read_bytes() == page


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["prints", "newton"], "newton"),
        (["grover"], "--reproduce"),
        (["grover", "a.blf"], "--vehicle"),
        (["grover", "a.blf", "--reproduce"], "leave out a.blf"),
        (["grover", "--reproduce", "--minutes", "1,x"], '--minutes: "x" is not a list of times in minutes'),
        ([], "prints"),
    ],
)
def test_a_wrong_call_is_one_clear_line(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", *words]) == USAGE
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert says in lines[0]


def test_a_log_without_what_is_needed_ends_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Lane keeping has no episode of car following, nor has car following a lane; one unreadable log does not end it."""
    lane, following = tmp_path / "lane.blf", tmp_path / "following.blf"
    for file, more in ((lane, ["--profile", "lane"]), (following, [])):
        assert main(["simulate", str(file), "--minutes", "1.5", *more]) == DONE
    broken = tmp_path / "broken.blf"
    broken.write_bytes(os.urandom(400))
    capsys.readouterr()
    for paper, log, vehicle in (("grover", lane, "generic_lane"), ("chen-ulsoy", following, "generic")):
        code = main(["study", paper, str(broken), str(log), "--vehicle", vehicle, "--jobs", "1"])
        shown = capsys.readouterr()
        assert code == CHECK_FAILED, shown
        assert "broken.blf" in shown.out
        assert "Traceback" not in shown.err
    # a log of another car among others is skipped as well, and alone an error
    assert main(["study", "grover", str(lane), str(following), "--vehicle", "toyota_rav4_2017"]) == USAGE
    shown = capsys.readouterr()
    assert "lane.blf" in shown.err
    assert "Traceback" not in shown.err


def test_a_figure_of_many_drivers_has_room_for_its_axes() -> None:
    """matplotlib warns where a legend leaves none, and a warning is an error here."""
    x = np.linspace(0.1, 9.0, 20)
    curves = tuple(Curve(x, x * k, f"c1 -0.3, driver {k}") for k in range(1, 41))
    drawing = figure_svg.drawn(Figure("fig_10", "Many", (Panel("x", "y", curves), Panel("x", "z", curves))))
    assert "c1 -0.3, driver 1 to c1 -0.3, driver 40 (40)" in drawing
