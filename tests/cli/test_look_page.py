"""`canid look --report` and `--web`: lines hold every peak and every gap, and the page's questions are checked."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.contents.log_marks import marks_of
from canid.analysis.contents.signal_lines import Line, NamedLine, with_gaps
from canid.ui.views.signal_page import zoom
from canid.ui.views.signal_page.signal_page import SignalPage
from canid.ui.web.signal_server import MAX_LINES, answers
from canid.values.errors import DONE, USAGE

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs" / "following_lost_lead.blf"


def test_a_peak_of_one_reading_is_on_the_screen_at_every_zoom() -> None:
    rng = np.random.default_rng(4)
    t = np.sort(rng.uniform(0.0, 3600.0, 200_000))
    value = rng.normal(size=t.size)
    peak = int(rng.integers(t.size))
    value[peak] = 99.0
    line = with_gaps(t, value)
    for width in (3600.0, 100.0, 1.0):
        shown = zoom.piece(line, t[peak] - width / 2, t[peak] + width / 2, 1000)
        assert 99.0 in shown.value
        assert len(shown.t) < 1600
        assert shown.t == sorted(shown.t)


def test_a_gap_stays_a_gap_at_every_zoom_and_jitter_is_none() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.005, 0.015, 50_000))
    assert not np.isnan(with_gaps(t, t).value).any()
    kept = (t < 100.0) | (t > 102.0)
    line = with_gaps(t[kept], t[kept])
    for begin, end in ((0.0, 500.0), (90.0, 110.0), (100.5, 101.5)):
        shown = zoom.piece(line, begin, end, 200)
        (at,) = [k for k, value in enumerate(shown.value) if value is None]
        assert 100.0 <= shown.t[at] < 100.1
        assert zoom.reading(line, 101.0) is None


def test_messages_that_are_sent_on_change_have_no_gap_at_each_pause() -> None:
    rng = np.random.default_rng(6)
    t = np.cumsum(rng.exponential(0.5, 4000))
    assert np.isnan(with_gaps(t, t).value).mean() < 0.001


@pytest.fixture
def asked() -> Callable[[Any], Any]:
    line = NamedLine("A.B", "0x001 A", "m", {}, lambda: Line(np.arange(3.0), np.array([1.0, np.nan, 3.0])))
    answer = answers(SignalPage("a.blf", 0.0, 2.0, [line]))

    def ask(question: Any) -> Any:
        text = question if isinstance(question, str) else json.dumps({"id": 7, **question})
        found = answer(text)
        return None if found is None else json.loads(found)["answer"]

    return ask


def test_questions_are_answered_and_anything_else_is_none(asked: Callable[[Any], Any]) -> None:
    whole = {"do": "pieces", "lines": [0], "begin": 0, "end": 2, "points": 100}
    assert asked(whole) == [{"t": [0.0, 1.0, 2.0], "value": [1.0, None, 3.0], "whole": True}]
    assert asked({"do": "readings", "lines": [0], "t": 0.5}) == [1.0]
    assert asked({"do": "readings", "lines": [0], "t": 1.5}) == [None]
    wrong: list[Any] = [
        "",
        "[]",
        "[" * 100_000,
        {"do": "stop"},
        whole | {"lines": [1]},
        whole | {"lines": [-1]},
        whole | {"lines": [0] * (MAX_LINES + 1)},
        whole | {"begin": "0"},
        whole | {"points": None},
        {"do": "readings", "lines": [0], "t": True},
    ]
    assert [asked(one) for one in wrong] == [None] * len(wrong)
    assert len(asked(whole | {"points": 1e11})[0]["t"]) == 3


def test_marks_of_the_journal_are_on_the_page(tmp_path: Path) -> None:
    (tmp_path / "a.events.jsonl").write_text('{"t": 3.5, "utc": null, "what": "mark", "says": "<b>"}\n')
    assert [mark.says for mark in marks_of(tmp_path / "a.blf")] == ["<b>"]
    assert marks_of(tmp_path / "b.blf") == ()


@pytest.mark.slow("a drive through the pipeline, and a page")
def test_the_page_has_the_signals_and_beside_them_what_canid_made_of_them(
    canid: Canid, tmp_path: Path
) -> None:
    page = tmp_path / "look.html"
    assert canid("look", LOG, "--vehicle", "generic", "--report", page).code == DONE
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text)
    assert found
    data = json.loads(found[1])
    names = [line["name"] for group in data["groups"] for line in group["lines"]]
    assert {"learning gate", "gap", "RADAR_LEAD.LeadDistance", "EGO_SPEED.VehicleSpeed"} <= set(names)
    assert len(data["pieces"]) == len(names)
    assert data["shown"]
    # what the log is known to hold: the lead is lost twice, so the gap has holes and the gate says so
    assert None in data["pieces"][names.index("gap")]["value"]
    gate = next(
        line for group in data["groups"] for line in group["lines"] if line["name"] == "learning gate"
    )
    seen = {gate["meanings"][str(int(x))] for x in data["pieces"][gate["k"]]["value"]}
    assert {"open", "no lead"} <= seen


def test_what_cannot_be_shown_is_said(canid: Canid, tmp_path: Path) -> None:
    page = tmp_path / "look.html"
    for words, says in (
        (("--report", page), "name them by --dbc"),
        (("--vehicle", "generic"), "--web or --report"),
        (("--dbc", "generic.dbc", "--web", "--json", "-"), "the page alone"),
    ):
        ended = canid("look", LOG, *words)
        assert ended.code == USAGE
        assert says in ended.err
    assert not page.exists()
