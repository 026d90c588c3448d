"""The page in a real browser: no error, every plot drawn, light, dark and printed, and its text without JavaScript."""

import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.values.findings import Report, Verdict

ReportOf = Callable[..., Report]
# ms; a busy machine may take its time, nothing here is about speed
PATIENCE = 120_000
A4 = (210 / 25.4 * 72, 297 / 25.4 * 72)  # points


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

    def __init__(self, browser: Any, file: Path, width: int = 1180, **options: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, **options)
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


@pytest.mark.slow("pages in a browser")
def test_every_plot_is_drawn_and_nothing_is_asked_for(open_page: Callable[..., OpenPage], file: Path) -> None:
    """No error, no warning, no request but for the file itself, and shapes of data in each of the seven plots."""
    seen = open_page().drawn()
    assert seen.wrong == []
    assert seen.asked == [file.as_uri()]
    shapes = seen.evaluate(PER_PLOT.format(".plot path.js-line, .plot .heatmaplayer image, .plot .bars path"))
    assert len(shapes) == 7
    assert min(shapes) > 0
    assert seen.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert seen.evaluate(CLIPPED) == []


# captions of tables that stick out of the page without a container of their own that scrolls
CLIPPED = """[...document.querySelectorAll('table')].filter(t => {
  const box = t.closest('.wide'), own = t.getBoundingClientRect();
  const scrolls = box && ['auto', 'scroll'].includes(getComputedStyle(box).overflowX);
  const clipped = box && box.getBoundingClientRect().right > window.innerWidth;
  return own.width && (clipped || (!scrolls && own.right > window.innerWidth));
}).map(t => t.caption.innerText)"""
# of each plot that is shown: its width over that of its place, and the height of its lowest panel in px
DRAWN = """[...document.querySelectorAll('.plot')].filter(p => !p.closest('details:not([open])')).map(p => [
  p.querySelector('.main-svg').getBoundingClientRect().width / p.clientWidth,
  Math.min(...[...p.querySelectorAll('.bglayer .bg, .gridlayer')].map(g => g.getBoundingClientRect().height).filter(h => h)),
])"""


@pytest.mark.slow("pages in a browser")
def test_no_line_doubles_the_frame_of_the_key_figures(
    open_page: Callable[..., OpenPage], short: Path
) -> None:
    """Between two of a row there is one line; that of the first of each row lies outside of the frame."""
    seen = open_page(short).drawn()
    edges = seen.evaluate(
        """(() => { const frame = document.querySelector('.key').getBoundingClientRect();
        return [...document.querySelectorAll('.key div')].map(d => [d.getBoundingClientRect().left - frame.left,
          parseFloat(getComputedStyle(d).borderLeftWidth), parseFloat(getComputedStyle(d).borderRightWidth)]); })()"""
    )
    assert all(right == 0 for _, _, right in edges)
    firsts = [(left, line) for left, line, _ in edges if left < 2]
    assert firsts
    assert all(left + line <= 1 + 1e-3 for left, line in firsts)


@pytest.mark.slow("pages in a browser")
def test_on_a_phone_nothing_is_clipped_and_the_page_is_short(
    open_page: Callable[..., OpenPage], file: Path
) -> None:
    """390 px: no sideways scroll, no table cut off, at most 9,000 px; folded figures are drawn when they are opened."""
    seen = open_page(file, width=390).drawn()
    assert seen.evaluate("document.documentElement.scrollWidth") <= 390
    assert seen.evaluate("document.documentElement.scrollHeight") <= 9000
    assert seen.evaluate(CLIPPED) == []
    shown = len(seen.evaluate(DRAWN))
    assert 2 <= shown < 7
    seen.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    seen.page.wait_for_function(
        "[...document.querySelectorAll('.plot')].every(p => p.querySelector('.main-svg'))"
    )
    drawn = seen.evaluate(DRAWN)
    assert len(drawn) == 7
    for share, panel in drawn:
        assert share == pytest.approx(1.0, abs=0.01)
        assert panel >= 50
    assert seen.evaluate("document.documentElement.scrollWidth") <= 390
    assert seen.evaluate(CLIPPED) == []
    # a finger that moves over a figure scrolls the page
    assert seen.evaluate("document.querySelector('.plot')._fullLayout.dragmode") is False
    assert seen.wrong == []


@pytest.mark.slow("pages in a browser")
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


PAPER_PX = (210 - 2 * 12) / 25.4 * 96
SECTIONS = "[...document.querySelectorAll('section')].map(s => s.querySelector('h2').innerText)"


@pytest.mark.slow("pages in a browser")
def test_it_prints_on_a4(open_page: Callable[..., OpenPage], short: Path, tmp_path: Path) -> None:
    """Printed from a dark phone: all details open, in light colors, nothing wider than paper; afterwards all as before."""
    seen = open_page(short, width=390, color_scheme="dark").drawn()
    widths = "[...document.querySelectorAll('.plot .main-svg')].map(svg => svg.getBoundingClientRect().width)"
    closed = "document.querySelectorAll('details:not([open])').length"
    before = (seen.evaluate(widths), seen.evaluate(closed))
    headings = seen.evaluate(SECTIONS)
    assert before[1] > 3
    seen.page.set_viewport_size({"width": int(PAPER_PX), "height": 900})
    seen.page.emulate_media(media="print", color_scheme="dark")
    seen.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert seen.evaluate(closed) == 0
    printed = seen.evaluate(widths)
    assert len(printed) > len(before[0])
    assert max(printed) <= PAPER_PX
    assert "255, 255, 255" in seen.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    assert seen.evaluate("document.documentElement.scrollWidth") <= PAPER_PX
    tables = "[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect()).map(r => [r.right, r.height])"
    for right, height in seen.evaluate(tables):
        assert right <= PAPER_PX
        assert height > 0
    for rule in ("figure", "tr", ".verdict"):
        style = f"getComputedStyle(document.querySelector('{rule}')).breakInside"
        assert seen.evaluate(style) == "avoid", rule
    seen.page.emulate_media(media="screen", color_scheme="dark")
    seen.page.set_viewport_size({"width": 390, "height": 900})
    seen.evaluate("window.dispatchEvent(new Event('afterprint'))")
    seen.page.wait_for_function(f"{closed} === {before[1]}")
    out = seen.page.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True, print_background=True)
    assert out.startswith(b"%PDF")
    boxes = {tuple(float(x) for x in box.split()[2:]) for box in _boxes(out)}
    assert len(boxes) == 1
    assert boxes.pop() == pytest.approx(A4, abs=1.5)
    if shutil.which("pdftotext"):
        words = subprocess.run(
            ["pdftotext", tmp_path / "page.pdf", "-"], check=True, capture_output=True
        ).stdout.decode()
        for text in (
            *headings,
            "drives/urban 7.blf",
            "2026-05-04 08:00:00 UTC",
            "Every candidate at every step",
        ):
            assert text in words, text
    assert seen.wrong == []


def _boxes(pdf: bytes) -> list[str]:
    return [found.decode() for found in re.findall(rb"/MediaBox\s*\[([^\]]+)\]", pdf)]


@pytest.mark.slow("pages in a browser")
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


@pytest.mark.slow("pages in a browser")
def test_without_javascript_the_words_and_tables_are_there(
    open_page: Callable[..., OpenPage], file: Path
) -> None:
    seen = open_page(file, java_script_enabled=False)
    text = seen.page.inner_text("body")
    for words in ("headway dead zone", "31 [24, 37] %", "The plots need JavaScript", "canid diagnose"):
        assert words in text
    assert seen.wrong == []


@pytest.mark.slow("pages in a browser")
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
