"""The page in a real browser: no error, every plot drawn, light, dark and printed, and its text without JavaScript."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.findings import Report, Verdict
from canid.views.report import page

ReportOf = Callable[..., Report]
# as root and without a network: no sandbox, and no attempt to call home
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip
# ms; a busy machine may take its time, nothing here is about speed
PATIENCE = 120_000
A4 = (210 / 25.4 * 72, 297 / 25.4 * 72)  # points


def missing(why: str) -> None:
    """Skip; fail where CANID_BROWSER says that a browser must be there."""
    (pytest.fail if os.environ.get("CANID_BROWSER") else pytest.skip)(why)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is not installed: pip install -e '.[dev]'")
    chromium = shutil.which("chromium")
    if chromium is None:
        missing("chromium is not installed: apt-get install chromium")
    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=chromium, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def file(named: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page(named), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def short(report_of: ReportOf, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of two minutes, which is drawn quickly."""
    path = tmp_path_factory.mktemp("page") / "short.html"
    path.write_text(page(report_of(Verdict.ONE_OF, minutes=2)), encoding="utf-8")
    return path


class OpenPage:
    """An opened page, and the errors on the way."""

    def __init__(self, browser: Any, file: Path, **options: Any) -> None:
        self.context = browser.new_context(viewport={"width": 1180, "height": 900}, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.wrong: list[str] = []
        self.asked: list[str] = []
        self.page.on(
            "console", lambda m: self.wrong.append(m.text) if m.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri())

    def drawn(self) -> "OpenPage":
        self.page.wait_for_function("document.documentElement.dataset.drawn === 'all'")
        return self

    def evaluate(self, script: str) -> Any:
        return self.page.evaluate(script)


@pytest.fixture
def open_page(browser: Any, file: Path) -> Iterator[Callable[..., OpenPage]]:
    opened: list[OpenPage] = []

    def of(at: Path = file, **options: Any) -> OpenPage:
        opened.append(OpenPage(browser, at, **options))
        return opened[-1]

    yield of
    for one in opened:
        one.context.close()


PER_PLOT = "[...document.querySelectorAll('.plot')].map(p => p.querySelectorAll('{}').length)"


def test_every_plot_is_drawn_and_nothing_is_asked_for(open_page: Callable[..., OpenPage], file: Path) -> None:
    """No error, no warning, no request but for the file itself, and shapes of data in each of the seven plots."""
    seen = open_page().drawn()
    assert seen.wrong == []
    assert seen.asked == [file.as_uri()]
    shapes = seen.evaluate(PER_PLOT.format(".plot path.js-line, .plot .heatmaplayer image, .plot .bars path"))
    assert len(shapes) == 7
    assert min(shapes) > 0
    assert seen.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_colors_follow_the_reader(open_page: Callable[..., OpenPage], short: Path) -> None:
    """The dark scheme draws light lines on dark ground, the light one the reverse; a change redraws."""
    line = "getComputedStyle(document.querySelector('.plot path.js-line')).stroke"
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    seen = open_page(short, color_scheme="dark").drawn()
    night = (seen.evaluate(line), seen.evaluate(ground))
    seen.page.emulate_media(color_scheme="light")
    seen.page.wait_for_function(f"{line} !== '{night[0]}'")
    day = (seen.evaluate(line), seen.evaluate(ground))

    def bright(color: str) -> float:
        return sum(int(x) for x in color[color.index("(") + 1 :].rstrip(")").split(",")[:3]) / 3

    assert bright(night[0]) > 150 > 60 > bright(night[1])
    assert bright(day[0]) < 100 < 200 < bright(day[1])
    assert seen.wrong == []


def test_it_prints_on_a4(open_page: Callable[..., OpenPage], short: Path, tmp_path: Path) -> None:
    """Printed from the dark scheme: plots no wider than the paper, in the light colors; afterwards all is as before."""
    seen = open_page(short, color_scheme="dark").drawn()
    widths = "[...document.querySelectorAll('.plot .main-svg')].map(svg => svg.getBoundingClientRect().width)"
    before = seen.evaluate(widths)
    seen.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert max(seen.evaluate(widths)) <= (210 - 2 * 12) / 25.4 * 96
    assert "255, 255, 255" in seen.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    seen.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert seen.evaluate(widths) == before
    out = seen.page.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True, print_background=True)
    assert out.startswith(b"%PDF")
    boxes = {tuple(float(x) for x in box.split()[2:]) for box in _boxes(out)}
    assert len(boxes) == 1
    assert boxes.pop() == pytest.approx(A4, abs=1.5)
    assert seen.wrong == []


def _boxes(pdf: bytes) -> list[str]:
    return [found.decode() for found in re.findall(rb"/MediaBox\s*\[([^\]]+)\]", pdf)]


def test_zoom_is_kept_when_the_window_changes(open_page: Callable[..., OpenPage], short: Path) -> None:
    """The zoomed range stays when the window is resized."""
    seen = open_page(short).drawn()
    seen.evaluate(
        "Plotly.relayout(document.querySelector('[data-figure=whole-drive]'), {'xaxis.range': [20, 50]})"
    )
    seen.page.set_viewport_size({"width": 900, "height": 900})
    seen.page.wait_for_function("document.querySelector('[data-figure=whole-drive]')._fullLayout.width < 900")
    assert seen.evaluate("document.querySelector('[data-figure=whole-drive]')._fullLayout.xaxis.range") == [
        20,
        50,
    ]


def test_without_javascript_the_words_and_tables_are_there(
    open_page: Callable[..., OpenPage], file: Path
) -> None:
    seen = open_page(file, java_script_enabled=False)
    text = seen.page.inner_text("body")
    for words in ("headway dead zone", "31 [24, 37] %", "The plots need JavaScript", "canid diagnose"):
        assert words in text
    assert seen.wrong == []


@pytest.mark.parametrize("verdict", [Verdict.UNEXPLAINED, Verdict.NOT_ENOUGH_DATA])
def test_other_verdicts_open_without_complaint(
    open_page: Callable[..., OpenPage], report_of: ReportOf, tmp_path: Path, verdict: Verdict
) -> None:
    path = tmp_path / "other.html"
    path.write_text(page(report_of(verdict, minutes=2)), encoding="utf-8")
    seen = open_page(path)
    if verdict is not Verdict.NOT_ENOUGH_DATA:
        seen.drawn()
    assert seen.wrong == []
