"""The live page in a real browser: its numbers are those of --json, every control works, and names are inert."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest

from canid.types import Interval
from canid.views import numbers
from tests.web.conftest import HOSTILE, HOSTILE_CAR, STOP_S, Page, Replay

# ms; a busy machine may take its time, nothing here is about speed
PATIENCE = 120_000
QUOTED = {
    "ok": ("K", "tau", "dead_time", "tau_plus_dead_time"),
    "sum_only": ("K", "tau_plus_dead_time"),
    "gain_only": ("K",),
    "not_identifiable": (),
}
VIOLATIONS = """window.violations = [];
document.addEventListener("securitypolicyviolation", (e) => violations.push(e.violatedDirective));"""


class Opened:
    """An opened page, and what went wrong in it."""

    def __init__(self, browser: Any, url: str, **options: Any) -> None:
        self.context = browser.new_context(**({"viewport": {"width": 1600, "height": 1000}} | options))
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.wrong: list[str] = []
        self.asked: list[str] = []
        self.page.add_init_script(VIOLATIONS)
        self.page.on("console", lambda m: self.wrong.append(f"{m.type}: {m.text}"))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("websocket", lambda socket: self.asked.append(socket.url))
        self.page.goto(url)

    def until(self, condition: str) -> None:
        """Wait; from outside, because the page's policy keeps playwright from waiting inside."""
        end = time.monotonic() + PATIENCE / 1000
        while not self.page.evaluate(f"Boolean({condition})"):
            assert time.monotonic() < end, condition
            self.page.wait_for_timeout(50)

    def shows(self, selector: str, text: str) -> None:
        self.until(f"document.querySelector({selector!r})?.textContent === {text!r}")

    def evaluate(self, script: str) -> Any:
        return self.page.evaluate(script)


@pytest.fixture(scope="module")
def opened(browser: Any, replay: Replay) -> Iterator[Opened]:
    """The replay's page, at its end."""
    page = Opened(browser, replay.url)
    page.shows("#playing", "end of the log")
    page.until("document.documentElement.dataset.plots === 'ready'")
    yield page
    page.context.close()


def iv(of: dict[str, Any]) -> Interval:
    return Interval(*(math.nan if of[end] is None else of[end] for end in ("value", "low", "high")))


LARGE = """[...document.querySelectorAll('#big .parameter')].map(p => ({...p.dataset,
  text: p.querySelector('.value').textContent, limits: p.querySelector('.interval').textContent}))"""
TABLE = "[...document.querySelectorAll('#rows [data-of]')].map(c => ({...c.dataset, text: c.textContent}))"


def check_numbers(opened: Opened, lines: list[dict[str, Any]]) -> None:
    """Large numbers and table against the lines of --json."""
    opened.until("document.querySelector('#big').dataset.t")
    big = opened.evaluate("({...document.querySelector('#big').dataset})")
    (line,) = [
        one for one in lines if one.get("estimator") == big["estimator"] and one["t"] == float(big["t"])
    ]
    shown = 0
    for cell in opened.evaluate(LARGE):
        channel, _, what = cell["parameter"].rpartition(".")
        of = line["channels"][channel]
        if what not in QUOTED[of["status"]]:
            assert cell["text"] == "–"
            continue
        shown += 1
        # JavaScript writes the shortest text that gives the number back, as Python does
        assert [float(cell[end]) for end in ("value", "low", "high")] == [
            of[what][end] for end in ("value", "low", "high")
        ]
        assert f"{cell['text']} {cell['limits']}" == numbers.interval(iv(of[what]))
    assert shown > 0
    # delays that may not be quoted are there for what they are worth
    names = {"tau": "τ", "dead_time": "θ", "tau_plus_dead_time": "τ+θ"}
    small = {
        one["name"]: one["text"]
        for one in opened.evaluate(
            "[...document.querySelectorAll('[data-tentative]')].map(p => ({name: p.dataset.tentative, text: p.textContent}))"
        )
    }
    for channel, of in line["channels"].items():
        for what, symbol in names.items():
            if (
                of["K"]["value"] is not None
                and of["status"] != "not_identifiable"
                and of[what]["value"] is not None
            ):
                stated = f"{symbol} {numbers.interval(iv(of[what]))} s"
                assert (stated in small.get(channel, "")) == (what not in QUOTED[of["status"]])
    of_line = {(one["estimator"], one["t"]): one["channels"] for one in lines if "estimator" in one}
    for cell in opened.evaluate(TABLE):
        name, channel, what = cell["of"].split(".")
        of = of_line[name, float(cell["t"])][channel]
        assert what in QUOTED[of["status"]] or cell["text"] == "–"
        if "value" in cell:
            assert numbers.interval(iv(of[what])) in cell["text"]
            assert float(cell["value"]) == of[what]["value"]


def test_numbers_are_those_of_the_json_stream(opened: Opened, replay: Replay) -> None:
    """The large numbers, their intervals and the table of the estimators, to the last digit."""
    lines = replay.lines()
    assert {one["estimator"] for one in lines if "estimator" in one} == {"fopdt", "armax"}
    check_numbers(opened, lines)


def test_names_are_text(opened: Opened) -> None:
    """A log and a vehicle whose names are markup stand on the page as they are, and nothing of them has run."""
    assert opened.page.text_content("#title") == HOSTILE
    assert opened.page.text_content("#vehicle") == HOSTILE_CAR
    assert opened.evaluate("window.pwned === undefined")
    assert opened.evaluate("document.querySelectorAll('img, b, iframe').length") == 0
    assert opened.evaluate("document.querySelectorAll('script:not([src])').length") == 0
    assert opened.evaluate("document.title") == f"canid replay · {HOSTILE}"
    assert "token" not in opened.evaluate("location.href")
    assert "token" not in opened.evaluate("document.cookie")


def test_prediction_is_the_textbook_response(opened: Opened) -> None:
    """A step through K e^(-θ s) / (1 + τ s), by its closed form; the offset that was added is found."""
    script = """async ([gain, tau, dead, offset]) => {
      const { predict } = await import('/prediction.js');
      const rows = [];
      for (let k = 0; k < 600; k += 1) {
        const t = k / 10;
        const after = t - 20 - dead;
        const y = after > 0 ? gain * (1 - Math.exp(-after / tau)) : 0;
        rows.push({ t, output: y + offset, inputs: { x: t > 20 ? 1 : 0 }, learn: t < 50, segment: 0 });
      }
      const out = predict(rows, { x: [gain, tau, dead] });
      return [out.offset, out.values, rows.map((row) => row.output)];
    }"""
    gain, tau, dead, offset = 4.0, 0.8, 0.6, 7.0
    found, values, truth = opened.page.evaluate(script, [gain, tau, dead, offset])
    assert found == pytest.approx(offset, abs=0.01)
    settled = [(v, y) for v, y in zip(values, truth, strict=True) if v is not None]
    assert len(settled) > 550
    # the step is not on the grid: it is rounded off over one sample
    assert max(abs(v - y) for v, y in settled) < gain * 0.1 / tau


def test_every_control_of_a_replay(opened: Opened, replay: Replay) -> None:
    """Buttons, seek bar and keys: pause, speeds, seeks; estimates after a seek are those of --json, which does not grow."""
    page, before = opened.page, replay.json.read_bytes()
    page.locator("body").click(position={"x": 5, "y": 5})
    page.keyboard.press("Space")
    opened.shows("#pause", "Play")
    for speed in ("1", "10", "max"):
        page.click(f"[data-speed='{speed}']")
        opened.until(
            f"document.querySelector(\"[data-speed='{speed}']\").getAttribute('aria-pressed') === 'true'"
        )
    page.fill("#seek", "35")
    opened.until(
        "document.querySelector('#playing').textContent === 'paused' && document.querySelector('#seek').value < 36"
    )
    at = float(opened.evaluate("document.querySelector('#seek').value"))
    assert at == pytest.approx(35.0, abs=0.1)
    check_numbers(opened, replay.lines())
    page.locator("h1").click()
    page.keyboard.press("ArrowLeft")
    opened.until("Math.abs(document.querySelector('#seek').value - 25) < 0.3")
    page.keyboard.press("ArrowRight")
    opened.until("Math.abs(document.querySelector('#seek').value - 35) < 0.6")
    page.keyboard.press("Shift+ArrowLeft")
    opened.until("document.querySelector('#seek').value < 1")
    page.click("[data-speed='max']")
    page.keyboard.press("Space")
    opened.shows("#playing", "end of the log")
    assert replay.json.read_bytes() == before
    # the view
    opened.shows("#units", "m/s")
    page.keyboard.press("u")
    opened.shows("#units", "km/h")
    speed, unit = (
        "parseFloat(document.querySelector('[data-of=speed] dd').textContent)",
        "[data-of=speed] dd small",
    )
    opened.shows(unit, " km/h")
    kmh = opened.evaluate(speed)
    page.click("#units")
    opened.shows(unit, " m/s")
    assert kmh == pytest.approx(3.6 * opened.evaluate(speed), abs=0.3)
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    light = opened.evaluate(ground)
    page.keyboard.press("t")
    assert opened.evaluate(ground) != light
    page.click("#theme")
    assert opened.evaluate(ground) == light
    page.keyboard.press("?")
    assert page.is_visible("#explain")
    page.keyboard.press("Escape")
    assert not page.is_visible("#explain")
    page.click("#channels button >> nth=0")
    assert page.get_attribute("#channels button >> nth=0", "aria-pressed") == "true"


def test_it_fits_from_a_phone_to_a_wide_screen(opened: Opened) -> None:
    """No horizontal scrolling, and the headline is on the first screen."""
    for width, height in ((390, 844), (820, 1180), (1600, 1000), (2560, 1300)):
        opened.page.set_viewport_size({"width": width, "height": height})
        assert opened.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), width
        assert opened.evaluate(
            "document.querySelector('#big').getBoundingClientRect().top < innerHeight / 2"
        ), width


def test_plots_are_drawn_and_nothing_was_wrong(opened: Opened, replay: Replay) -> None:
    """After all of the above: data in each plot, no message on the console, no violation of the policy, and no request but
    to the page's own server."""
    opened.page.set_viewport_size({"width": 2560, "height": 1800})
    lines = "document.querySelectorAll('#{} path.js-line').length"
    for plot in ("plot-output", "plot-residual", "plot-lead", "plot-rate", "plot-K"):
        opened.until(f"{lines.format(plot)} > 0")
    assert opened.wrong == []
    assert opened.evaluate("violations") == []
    here = urlsplit(replay.url).netloc
    assert {urlsplit(url).netloc for url in opened.asked} == {here}
    assert any(url.startswith("ws://") for url in opened.asked)


def test_marks_of_a_session(browser: Any, fresh: Page) -> None:
    """The button and the key make marks, with their text; a mark and an event with markup are text; the end is shown."""
    from canid.types import Event

    page = Opened(browser, fresh.live.url, color_scheme="dark")
    page.until("document.body.dataset.mode === 'live'")
    page.page.fill("#mark-text", "<img src=x onerror=window.pwned=1>")
    page.page.click("#mark")
    page.page.locator("h1").click()
    marks: list[str] = []
    end = time.monotonic() + PATIENCE / 1000
    while not marks and time.monotonic() < end:
        marks += [mark.text for mark in fresh.controls.take_marks()]
        time.sleep(0.05)
    time.sleep(0.3)  # two within a fifth of a second are one
    page.page.keyboard.press("m")
    while len(marks) < 2 and time.monotonic() < end:
        marks += [mark.text for mark in fresh.controls.take_marks()]
        time.sleep(0.05)
    assert marks == ["<img src=x onerror=window.pwned=1>", ""]
    fresh.live.put(Event(61.5, "mark", f"mark: {marks[0]}"))
    page.shows("#list li bdi", f"mark: {marks[0]}")
    page.shows("#list li time", "1:01.5")
    assert page.evaluate("window.pwned === undefined && document.images.length === 0")
    page.page.keyboard.press("Space")
    page.shows("#connection", "picture held (space)")
    page.page.keyboard.press("Space")
    fresh.live.close()
    page.until("!document.querySelector('#banner').hidden")
    assert "has ended" in page.page.text_content("#banner")
    assert page.wrong == []
    page.context.close()
    assert fresh.says == []


def test_a_late_client_sees_the_whole_drive(replay: Replay, browser: Any) -> None:
    """A page that is opened at the end has the numbers of the end, and rows back to the first estimate."""
    late = Opened(browser, replay.url, viewport={"width": 390, "height": 844}, has_touch=True)
    late.shows("#playing", "end of the log")
    check_numbers(late, replay.lines())
    late.until("document.documentElement.dataset.plots === 'ready'")
    late.page.locator("#plot-K").scroll_into_view_if_needed()
    late.until("document.querySelectorAll('#plot-K path.js-line').length > 0")
    drawn = late.evaluate("document.querySelector('#plot-K').data.flatMap((one) => one.x)")
    first = min(one["t"] for one in replay.lines() if "estimator" in one)
    assert min(drawn) == first
    assert max(drawn) > STOP_S - 5.0
    assert late.wrong == []
    late.context.close()
