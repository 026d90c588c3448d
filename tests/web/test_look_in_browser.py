"""The signals of a log in a real browser: searched, put on one axis, zoomed to single frames, and read at the cursor."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.contents.signal_lines import lines_of_log
from tests.web.test_page_in_browser import Opened

ROOT = Path(__file__).parents[2]
LOG, DBC = ROOT / "replay_logs/following_lost_lead.blf", ROOT / "dbc/generic.dbc"
PLOTTED = "document.querySelector('#plot')"
DRAWN = "Number(document.documentElement.dataset.drawn || 0)"
LIST = (
    "[...document.querySelectorAll('#list button')].filter(b => b.style.display !== 'none').map(b => b.title)"
)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("look")
    says = folder / "stderr"
    with says.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "canid", "look", str(LOG), "--dbc", str(DBC), "--web"],
            stdout=subprocess.DEVNULL,
            stderr=file,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        )
    found = None
    while found is None:
        assert process.poll() is None, says.read_text()
        time.sleep(0.05)
        found = re.search(r"http://127\.0\.0\.1:\d+/#token=\S+\n", says.read_text(encoding="utf-8"))
    yield found[0].strip()
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 0


@pytest.fixture(scope="module")
def opened(browser: Any, address: str) -> Iterator[Opened]:
    page = Opened(browser, address, viewport={"width": 1280, "height": 800})
    page.until(DRAWN)
    yield page
    assert page.wrong == []
    assert page.evaluate("violations") == []
    page.context.close()


def after(page: Opened, deed: str) -> None:
    """Do it, and wait until the page has drawn what it asked for."""
    before = page.evaluate(DRAWN)
    page.evaluate(deed)
    page.until(f"{DRAWN} > {before}")


def test_it_begins_with_lines_that_move_and_the_search_finds_by_any_part_of_a_name(opened: Opened) -> None:
    assert opened.evaluate(f"{PLOTTED}.data.length") == 3
    opened.page.fill("#search", "radar rel")
    assert opened.evaluate(LIST) == ["RADAR_LEAD.LeadRelSpeed"]
    opened.page.fill("#search", "nothing of that kind")
    assert opened.evaluate("document.querySelector('#list .none').isConnected")
    opened.page.fill("#search", "")


def test_no_button_moves_away_from_the_pointer(opened: Opened) -> None:
    """What the cursor reads stands in the legends, in front of their buttons."""
    places = "[...document.querySelectorAll('#legends button')].map(b => b.getBoundingClientRect().left)"
    opened.page.mouse.move(5, 5)
    opened.until("document.querySelector('#cursor').textContent === ''")
    before = opened.evaluate(places)
    for x in (500, 800, 1100):
        opened.page.mouse.move(x, 300)
        opened.until("/\\d/.test(document.querySelector('.chip .value').textContent)")
        assert opened.evaluate(places) == before


def test_two_signals_share_an_axis_by_the_button_or_by_dragging(opened: Opened) -> None:
    opened.page.click(".legend:first-child .add")
    after(
        opened,
        "[...document.querySelectorAll('#list button')].find(b => b.title.endsWith('.LeadDistance')).click()",
    )
    axes = opened.evaluate(f"{PLOTTED}.data.map(d => d.yaxis)")
    assert axes.count("y") == 2
    before = opened.evaluate(DRAWN)
    opened.page.drag_and_drop(".legend:nth-child(2) .chip .name", ".legend:nth-child(3) .chip .name")
    opened.until(f"{DRAWN} > {before}")
    assert opened.evaluate(f"new Set({PLOTTED}.data.map(d => d.yaxis)).size") == 2
    after(opened, "document.querySelector('.chip[data-k] button').click()")
    assert opened.evaluate(f"{PLOTTED}.data.length") == 3


def test_a_zoom_shows_every_frame_and_the_cursor_reads_one(opened: Opened) -> None:
    """The server decimates at the zoom that is asked for; the value is that of the last frame before the cursor."""
    from canid.analysis.contents.log_survey import Wanted
    from canid.io.logs import open_log
    from canid.ui.cli.signals import selection

    lines = lines_of_log(open_log(LOG), selection.read_files([(str(DBC), None)], {}), Wanted())
    k = int(opened.evaluate("document.querySelector('.chip').dataset.k"))
    line = lines[k].read()
    before = opened.evaluate(DRAWN)
    box = opened.page.query_selector("#plot").bounding_box()
    x = [box["x"] + 58 + share * (box["width"] - 70) for share in (0.5, 0.53, 0.515)]
    y = box["y"] + 90
    opened.page.mouse.move(x[0], y)
    opened.page.mouse.down()
    opened.page.mouse.move(x[1], y, steps=4)
    opened.page.mouse.up()
    opened.until(f"{DRAWN} > {before}")
    begin, end = opened.evaluate(f"{PLOTTED}.layout.xaxis.range")
    assert 2.0 < end - begin < 6.0
    inside = (line.t > begin) & (line.t < end)
    shown = opened.evaluate(f"{PLOTTED}.data[0].x.length")
    assert shown <= inside.sum() + 2
    opened.page.mouse.move(x[2], y)
    opened.until("document.querySelector('#cursor').textContent")
    opened.until("/\\d/.test(document.querySelector('.chip .value').textContent)")
    t = float(opened.evaluate("document.querySelector('#cursor').textContent").removesuffix(" s"))
    value = float(opened.evaluate("document.querySelector('.chip .value').textContent").split()[0])
    near = abs(line.t - t) < 0.2
    assert line.value[near].min() <= value <= line.value[near].max()
    after(opened, "document.querySelector('#whole').click()")
    assert opened.evaluate(f"{PLOTTED}.layout.xaxis.range[0]") == pytest.approx(float(line.t[0]), abs=0.1)


def test_on_paper_it_is_light_whatever_the_screen_is(opened: Opened) -> None:
    """Background and lines, printed from a dark screen; afterwards the screen is as before."""
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    first = f"{PLOTTED}.data[0].line.color"
    light = opened.evaluate(first)
    before = opened.evaluate(DRAWN)
    opened.page.emulate_media(color_scheme="dark")
    opened.until(f"{DRAWN} > {before}")
    dark = opened.evaluate(first)
    assert dark != light
    opened.page.emulate_media(color_scheme="dark", media="print")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert opened.evaluate(ground) == "rgb(255, 255, 255)"
    assert opened.evaluate(first) == light
    assert opened.evaluate(f"{PLOTTED}.layout.width") < 720
    assert opened.evaluate(f"{PLOTTED}.layout.height") <= 920
    opened.page.emulate_media(color_scheme="dark", media="screen")
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate(first) == dark
    opened.page.emulate_media(color_scheme="light", media="screen")


def test_without_the_token_nothing_of_the_log_is_given(browser: Any, address: str) -> None:
    page = Opened(browser, address.split("#")[0])
    page.until("!document.querySelector('#problem').hidden")
    assert page.evaluate("document.querySelectorAll('#list button').length") == 0
    page.context.close()


def test_on_a_phone_nothing_is_wider_than_the_screen(browser: Any, address: str) -> None:
    page = Opened(browser, address, viewport={"width": 390, "height": 844})
    page.until(DRAWN)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.context.close()


def test_on_a_phone_no_name_covers_a_curve(browser: Any, address: str) -> None:
    """A legend stands in the 25 px above its panel; the whole name is in the list, and in its title."""
    page = Opened(browser, address, viewport={"width": 390, "height": 844})
    page.until(DRAWN)
    heights = "[...document.querySelectorAll('.legend')].map(b => b.getBoundingClientRect().height)"
    assert max(page.evaluate(heights)) <= 25
    titles = page.evaluate("[...document.querySelectorAll('.chip .name')].map(b => b.title)")
    assert all("." in title for title in titles)
    page.context.close()


@pytest.mark.long("pages in a browser")
def test_six_panels_and_their_axis_of_time_are_on_the_screen(browser: Any, address: str) -> None:
    opened = Opened(browser, address, viewport={"width": 1280, "height": 800})
    opened.until(DRAWN)
    lowest = "Math.max(...[...document.querySelectorAll('#plot .xtick text')].map(t => t.getBoundingClientRect().bottom))"
    while (panels := opened.evaluate(f"new Set({PLOTTED}.data.map(d => d.yaxis)).size")) < 6:
        after(opened, "document.querySelector('#list button[aria-pressed=\"false\"]').click()")
        assert opened.evaluate(f"new Set({PLOTTED}.data.map(d => d.yaxis)).size") == panels + 1
    assert opened.evaluate(lowest) <= 800
    # and each is found by the pointer where it is drawn
    boxes = opened.evaluate(
        "[...document.querySelectorAll('.legend')].map(b => b.getBoundingClientRect().top)"
    )
    assert boxes == sorted(boxes)
    assert boxes[-1] < 700
    opened.context.close()
