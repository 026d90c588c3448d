"""Pages of identify, check and replay in a real browser: what they show is the JSON, of any log, on any screen."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from canid.ui.cli import main
from canid.values.errors import CHECK_FAILED, DAMAGED, DONE, USAGE
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import interval, number
from canid.values.types import Interval
from tests.views.test_page_in_browser import OpenPage

URBAN = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
# a file name is data: neither markup, nor a template, nor a script
HOSTILE = "<img src=x onerror=document.title='owned'>{{7*7}}<!--.blf"
# px; of a phone, and what a thumb can still scroll
PHONE, PHONE_PAGE = {"width": 390, "height": 844}, 9000
QUOTABLE = {
    "ok": ("K", "tau", "dead_time"),
    "sum_only": ("K", "tau_plus_dead_time"),
    "gain_only": ("K",),
    "not_identifiable": (),
}


class Ran(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


Canid = Callable[..., Ran]
Open = Callable[..., OpenPage]


@pytest.fixture
def canid(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Canid:
    """Run `canid ...` in this process, in an empty folder with the log under a hostile name."""
    shutil.copy(URBAN, tmp_path / HOSTILE)
    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Ran:
        capsys.readouterr()
        return Ran(main([str(word) for word in words]), *capsys.readouterr())

    return run


@pytest.fixture
def opened(browser: Any) -> Iterator[Open]:
    seen: list[OpenPage] = []

    def of(file: Path, **options: Any) -> OpenPage:
        seen.append(OpenPage(browser, file, **options))
        return seen[-1].drawn()

    yield of
    for one in seen:
        one.context.close()


def is_sound(seen: OpenPage, file: Path) -> None:
    """No error, no request, no markup from a name, no plot without data or description, nothing wider than a phone."""
    assert seen.wrong == []
    assert seen.asked == [file.as_uri()]
    assert seen.evaluate("document.title") != "owned"
    assert seen.evaluate("document.querySelectorAll('img').length") == 0
    assert HOSTILE in seen.page.inner_text("main")
    plots = seen.evaluate(
        "[...document.querySelectorAll('.plot')].filter(p => p.checkVisibility()).map(p => [p.getAttribute('role'), "
        "p.getAttribute('aria-label').length, p.querySelectorAll('path').length])"
    )
    assert plots
    assert all(role == "img" and words > 20 and paths > 0 for role, words, paths in plots)
    seen.page.set_viewport_size(PHONE)
    seen.page.wait_for_function(
        "[...document.querySelectorAll('.plot')].every(p => !p.checkVisibility() || p._fullLayout.width <= 390)"
    )
    assert seen.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert seen.evaluate("document.documentElement.scrollHeight") <= PHONE_PAGE
    assert seen.wrong == []


def shown(iv: dict[str, Any]) -> str:
    return interval(
        Interval(*(float("nan") if iv[key] is None else iv[key] for key in ("value", "low", "high")))
    )


@pytest.mark.slow("pages in a browser")
def test_the_page_of_identify_shows_the_numbers_of_its_json(
    canid: Canid, opened: Open, tmp_path: Path
) -> None:
    """Verdict, parameters that may be quoted, fit and its kind, margins and provenance are those of --json."""
    out = tmp_path / "a.html"
    part = ("--vehicle", "generic", "--stop", 100)
    ran = canid("identify", HOSTILE, *part, "--json", "a.json", "--report", out, "--check")
    assert ran.code == DONE
    of = json.loads((tmp_path / "a.json").read_text())
    seen = opened(out)
    text = seen.page.inner_text("main")
    assert of["verdict"]["says"] in text
    assert of["verdict"]["withheld"] in text
    rows = seen.evaluate("[...document.querySelectorAll('#parameters tbody tr')].map(r => r.innerText)")
    quoted = 0
    for name, channel in of["whole"]["channels"].items():
        for what in QUOTABLE[channel["status"]]:
            row = next(r for r in rows if r.startswith(f"{readable(name)} {SYMBOLS[what]}\t"))
            assert f"✓ {shown(channel[what])}" in row
            quoted += 1
    assert quoted >= 2
    assert sum(row.count("✓") for row in rows) >= quoted
    assert of["whole"]["fit_kind"] == of["armax"]["fit_kind"] == "simulated"
    assert f"fit {number(of['whole']['fit_percent'], '%')} (simulated)" in text
    assert f"{shown(of['loop']['phase_margin'])} °" in seen.page.inner_text("#loop")
    assert "--vehicle generic --stop 100" in seen.page.inner_text("#provenance")
    is_sound(seen, out)
    # an earlier page is replaced, one of another verb is not
    assert canid("identify", HOSTILE, *part[:2], "--stop", 20, "--report", out).code == DONE
    assert canid("check", HOSTILE, "--vehicle", "generic", "--report", out).code not in (DONE, CHECK_FAILED)


@pytest.mark.slow("pages in a browser")
def test_the_page_of_check_shows_each_role(canid: Canid, opened: Open, tmp_path: Path) -> None:
    """Readings, range and gaps are those of --json; a wrong vehicle file gets its problems, an unnamed id its row."""
    folder = Path(__file__).parents[2] / "dbc"
    shutil.copy(folder / "generic.dbc", tmp_path)
    text = (folder / "generic.toml").read_text()
    wrong = text.replace('"RADAR_LEAD.LeadRelSpeed"', '{ signal = "RADAR_LEAD.LeadRelSpeed", scale = -1 }')
    assert wrong != text
    (tmp_path / "wrong.toml").write_text(
        "\n".join(row for row in wrong.splitlines() if "GNSS_DATA" not in row and "LANE_DATA" not in row)
    )
    out = tmp_path / "a.html"
    ran = canid("check", HOSTILE, "--vehicle", "wrong.toml", "--json", "a.json", "--report", out)
    assert ran.code == CHECK_FAILED
    of = json.loads((tmp_path / "a.json").read_text())
    seen = opened(out)
    body = seen.page.inner_text("main")
    assert f"{len(of['problems'])} problem" in seen.page.inner_text("h1")
    assert all(problem in body for problem in of["problems"])
    rows = seen.evaluate("[...document.querySelectorAll('#roles tbody tr')].map(r => r.innerText)")
    assert len(rows) == len(of["roles"])
    for (role, values), row in zip(of["roles"].items(), rows, strict=True):
        assert row.startswith(readable(role))
        assert f"{values['readings']:,}" in row
        assert number(values["longest_gap"], "s") in row
        assert values["stale_percent"] == 0.0
    ids = seen.page.inner_text("#ids")
    assert of["unmapped"]
    assert all(f"0x{one['id']:X}" in ids for one in of["unmapped"])
    is_sound(seen, out)


@pytest.mark.slow("pages in a browser")
def test_the_page_of_replay_shows_what_was_said_live(canid: Canid, opened: Open, tmp_path: Path) -> None:
    """The last headline estimate, each status that came, and the monitor, as the lines of --json had them."""
    out = tmp_path / "a.html"
    ran = canid("replay", HOSTILE, "--vehicle", "generic", "--stop", 70, "--json", "a.jsonl", "--report", out)
    assert ran.code == DONE
    lines = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    estimates = [line for line in lines if "estimator" in line]
    headline = [line for line in estimates if line["headline"]][-1]
    seen = opened(out)
    verdict = seen.page.inner_text(".verdict")
    for channel in headline["channels"].values():
        assert all(shown(channel[what]) in verdict for what in QUOTABLE[channel["status"]])
    figures = seen.evaluate("JSON.parse(document.getElementById('figures').textContent)")
    strips = {state["name"]: set(state["y"]) for state in figures["states"]["data"] if state["y"]}
    for estimator in ("fopdt", "armax"):
        came = {readable(line["status"]) for line in estimates if line["estimator"] == estimator}
        assert came == {name for name, rows in strips.items() if estimator.upper() in rows}
    K = next(
        one for one in figures["live-range_rate"]["data"] if one["name"] == "FOPDT" and one["yaxis"] == "y"
    )
    last = [line for line in estimates if line["estimator"] == "fopdt"][-1]
    assert K["y"][-1] == pytest.approx(last["channels"]["range_rate"]["K"]["value"], rel=1e-4)
    is_sound(seen, out)


@pytest.mark.slow("pages in a browser")
def test_several_logs_make_one_page(canid: Canid, opened: Open, tmp_path: Path) -> None:
    """A table of all, a section each; of a damaged log what is left, with exit 4; of too short a drive the reason."""
    whole = URBAN.read_bytes()
    (tmp_path / "cut.blf").write_bytes(whole[: len(whole) // 3])
    out = tmp_path / "a.html"
    ran = canid(
        "identify", HOSTILE, "cut.blf", "--vehicle", "generic", "--stop", 60, "--report", out, "--json", "-"
    )
    assert ran.code == DAMAGED
    first, second = json.loads(ran.out)
    seen = opened(out)
    table = seen.page.inner_text("#comparison")
    assert shown(first["whole"]["channels"]["range_rate"]["K"]) in table
    assert "cut.blf" in table
    assert second["verdict"]["kind"] in table
    # a section is drawn when it is opened
    assert seen.evaluate("document.querySelectorAll('.js-plotly-plot').length") == 0
    seen.evaluate("document.querySelector('#drive-2-drive').open = true")
    seen.page.wait_for_function("document.querySelectorAll('#drive-2-drive .js-plotly-plot').length > 2")
    assert seen.page.is_visible("#drive-2-drive .damaged")
    is_sound(seen, out)


@pytest.mark.slow("pages in a browser")
def test_nothing_identifiable_has_its_own_page_and_exit_code(
    canid: Canid, opened: Open, tmp_path: Path
) -> None:
    """Ten seconds: exit 1 with --check, 0 without; one of two logs is enough; the page says why, and has the signals."""
    out = tmp_path / "a.html"
    short = ("--vehicle", "generic", "--stop", 10)
    assert canid("identify", HOSTILE, *short).code == DONE
    ran = canid("identify", HOSTILE, *short, "--check", "--report", out, "--json", "a.json")
    assert ran.code == CHECK_FAILED
    verdict = json.loads((tmp_path / "a.json").read_text())["verdict"]
    assert verdict["kind"] == "nothing"
    assert verdict["withheld"]
    seen = opened(out)
    assert verdict["withheld"] in seen.page.inner_text(".verdict")
    is_sound(seen, out)
    assert canid("identify", HOSTILE, *short, "--report", "a.txt").code == USAGE


@pytest.mark.slow("pages in a browser")
def test_one_cursor_for_all_plots_over_time_and_the_plan(canid: Canid, opened: Open, tmp_path: Path) -> None:
    """Over one plot the cursor stands at the same time in the others, and where the car was then on the plan."""
    out = tmp_path / "a.html"
    assert canid("identify", HOSTILE, "--vehicle", "generic", "--report", out).code == DONE
    seen = opened(out)
    plot = seen.page.locator("#figure-model .plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    seen.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    times = (
        "[...document.querySelectorAll('.cursor[data-t]:not([hidden])')].map(one => Number(one.dataset.t))"
    )
    seen.page.wait_for_function(f"{times}.length > 2")
    at = seen.evaluate(times)
    assert max(at) - min(at) < 0.2
    track = "document.querySelector('#figure-plan .plot')"
    dots = f"[...{track}.querySelectorAll('.cursor.dot:not([hidden])')]"
    assert seen.evaluate(f"{dots}.length") == seen.evaluate(f"{track}.data.filter(d => d.customdata).length")
    x = seen.evaluate(
        f"{track}._fullLayout.xaxis.p2d(parseFloat({dots}[0].style.left) - {track}._fullLayout.xaxis._offset)"
    )
    where = seen.evaluate(f"{track}.data.filter(d => d.customdata).map(d => [d.customdata, d.x])[0]")
    near = min(range(len(where[0])), key=lambda k: abs(where[0][k] - at[0]))
    assert x == pytest.approx(where[1][near], abs=15.0)
    assert seen.wrong == []
