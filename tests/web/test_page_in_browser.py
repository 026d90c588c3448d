"""The live page in a real browser: its numbers are those of --json, every control works, and names are inert."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import can
import cantools
import pytest

from canid.values.signal_table import Row, SignalTable
from canid.values.text import numbers
from canid.values.types import Interval
from tests.web.conftest import HOSTILE, HOSTILE_CAR, ROOT, STOP_S, Page, Replay

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


@pytest.mark.slow("pages in a browser")
def test_numbers_are_those_of_the_json_stream(opened: Opened, replay: Replay) -> None:
    """The large numbers, their intervals and the table of the estimators, to the last digit."""
    lines = replay.lines()
    assert {one["estimator"] for one in lines if "estimator" in one} == {"fopdt", "armax"}
    check_numbers(opened, lines)


@pytest.mark.slow("pages in a browser")
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


@pytest.mark.slow("pages in a browser")
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


def test_a_laptop_shows_driver_prediction_and_measurement_without_scrolling(opened: Opened) -> None:
    """At 1280x800 and 1366x768; and no panel of the estimates is an empty box: what is not known is said."""
    above = ["headline", "plot-output", "plot-residual", "plot-lead", "plot-rate"]
    for width, height, names in ((1280, 800, [*above, "plot-K"]), (1366, 768, above)):
        opened.page.set_viewport_size({"width": width, "height": height})
        opened.until("document.querySelectorAll('#plot-K path.js-line').length > 0")
        fold = opened.evaluate("document.querySelector('#bar').getBoundingClientRect().top")
        for name in names:
            bottom = opened.evaluate(f"document.querySelector('#{name}').getBoundingClientRect().bottom")
            assert bottom <= fold, (width, name)
        empty = """[...document.querySelectorAll('#estimates .plot:not([hidden])')]
          .filter((plot) => !plot.querySelector('path.js-line')).map((plot) => plot.id)"""
        opened.until(f"{empty}.length === 0")
        hidden = opened.evaluate("document.querySelectorAll('#estimates .plot[hidden]').length")
        said = opened.page.text_content("#absent") or ""
        assert len(said.partition(": ")[2].split(", ")) == hidden or not said


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1366, 768), (390, 844)])
def test_no_estimate_is_broken_over_lines_or_cut_off(opened: Opened, width: int, height: int) -> None:
    """Each K and each delay of the table of estimators, with its interval and unit, is one line within the panel."""
    opened.page.set_viewport_size({"width": width, "height": height})
    cells = opened.evaluate(
        """[...document.querySelectorAll('#rows [data-of]')].map(cell => {
        const range = document.createRange();
        range.selectNodeContents(cell);
        const tops = new Set([...range.getClientRects()].map(r => Math.round(r.top)));
        const right = cell.closest('.panel').getBoundingClientRect().right;
        return [cell.innerText, tops.size, Math.max(...[...range.getClientRects()].map(r => r.right)) <= right]; })"""
    )
    assert len(cells) >= 2
    assert [cell for cell in cells if cell[1:] != [1, True]] == []


def test_every_decoded_value_is_there_when_asked_for(opened: Opened) -> None:
    """A table of all roles that came, with their units, in the numbers of the panel of what is now."""
    rows = (
        "[...document.querySelectorAll('#decoded-rows tr')].map(r => [...r.children].map(c => c.textContent))"
    )
    assert opened.evaluate(rows) == []
    opened.page.click("#decoded summary")
    opened.until("document.querySelectorAll('#decoded-rows tr').length > 10")
    shown = {name: (value, unit) for name, value, unit in opened.evaluate(rows)}
    now = opened.evaluate("parseFloat(document.querySelector('[data-of=gap] dd').textContent)")
    assert float(shown["gap"][0]) == pytest.approx(now, abs=0.051)
    assert shown["gap"][1] == "m"
    assert shown["speed"][1] == "m/s"
    opened.page.click("#decoded summary")


SIGNALS = """({t: Number(document.querySelector('#signal-count').dataset.t),
  rows: [...document.querySelectorAll('#signal-rows tr')].map(r => [...r.children].map(c => c.textContent))})"""


def of_cantools(t: float) -> dict[str, float | str]:
    """The last value of each signal up to a time of the log, by python-can and cantools."""
    database = cantools.database.load_file(ROOT / "dbc/generic.dbc")
    known = {message.frame_id: message for message in database.messages}
    last: dict[str, float | str] = {}
    frames = list(can.BLFReader(ROOT / "replay_logs/following_urban.blf"))
    for frame in frames:
        if frame.timestamp - frames[0].timestamp <= t + 0.0006 and frame.arbitration_id in known:
            message = known[frame.arbitration_id]
            for name, value in message.decode(frame.data).items():
                last[f"{message.name}.{name}"] = value if isinstance(value, float | int) else str(value)
    return last


def check_signals(opened: Opened) -> float:
    """The table against cantools; returns its time."""
    shown = opened.evaluate(SIGNALS)
    expected = of_cantools(shown["t"])
    texts = {name: text for name, text, _, _ in shown["rows"]}
    assert texts.keys() == expected.keys()
    for name, value in expected.items():
        if isinstance(value, str):
            assert texts[name] == value
        else:
            assert float(texts[name].split()[0]) == pytest.approx(value, rel=1e-9), name
    return float(shown["t"])


@pytest.mark.slow("pages in a browser")
def test_all_signals_are_those_of_cantools_at_the_end_and_after_a_seek_back(opened: Opened) -> None:
    """Every signal of the DBC file with its last value; found by words; nothing is asked for once it is closed."""
    page = opened.page
    page.click("#decoded summary")
    opened.until("Number(document.querySelector('#signal-count').dataset.t) > 44.9")
    assert check_signals(opened) == pytest.approx(STOP_S, abs=0.1)
    page.fill("#search", "speed ego")
    opened.until("document.querySelectorAll('#signal-rows tr').length < 10")
    names = opened.evaluate("[...document.querySelectorAll('#signal-rows tr')].map(r => r.dataset.signal)")
    assert names
    assert all("EGO" in name and "speed" in name.lower() for name in names)
    page.fill("#search", "")
    if page.text_content("#pause") == "Pause":
        page.click("#pause")
    page.fill("#seek", "20")
    opened.until("Math.abs(Number(document.querySelector('#signal-count').dataset.t) - 20) < 0.2")
    check_signals(opened)
    page.click("#pause")
    opened.shows("#playing", "end of the log")
    opened.until("Number(document.querySelector('#signal-count').dataset.t) > 44.9")
    check_signals(opened)
    page.click("#decoded summary")


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


@pytest.mark.slow("a session and its page in a browser")
def test_marks_of_a_session(browser: Any, fresh: Page) -> None:
    """The button and the key make marks, with their text; a mark and an event with markup are text; the end is shown."""
    from canid.values.types import Event

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


@pytest.mark.slow("pages in a browser")
def test_signals_of_several_buses_with_hostile_names_and_why_there_are_none(
    browser: Any, fresh: Page
) -> None:
    """A column for the bus, names and values as text, old ones marked; of 1,200 the first 1,000; then what has failed."""
    page = Opened(browser, fresh.live.url)
    page.until("document.body.dataset.mode === 'live'")
    page.page.click("#decoded summary")
    rows = [
        Row(0, "M.<img src=x onerror=window.pwned=1>", "<b>on</b>", 50.0, 0.02),
        Row(1, "M.PEDAL", "12.5 %", math.nan, 75.0),
        *(Row(1, f"M.S{k}", "1", 0.1234, 0.0) for k in range(1198)),
    ]
    shown = (
        "[...document.querySelectorAll('#signal-rows tr')].map(r => [...r.children].map(c => c.textContent))"
    )

    def show(table: SignalTable, until: str) -> None:
        """Until it is there: the page asks every 2 s."""
        end = time.monotonic() + PATIENCE / 1000
        while until not in (page.page.text_content("#signal-count") or ""):
            assert time.monotonic() < end, until
            fresh.live.table(table)
            page.page.wait_for_timeout(200)

    show(SignalTable(61.0, rows, 0.0), "1,200 of 1,200 signals at 1:01.0, the first 1,000 are shown")
    first = page.evaluate(shown)
    assert len(first) == 1000
    assert first[0] == ["0", rows[0].name, "<b>on</b>", "50 1/s", "0.0 s"]
    assert first[1] == ["1", "M.PEDAL", "12.5 %", "", "75 s"]
    assert first[2][3] == "0.123 1/s"
    assert page.evaluate(
        "[...document.querySelectorAll('#signal-rows tr.old')].map(r => r.dataset.signal)"
    ) == ["M.PEDAL"]
    assert page.page.is_visible("#bus-head")
    page.page.fill("#search", "pedal 12.5")
    page.until("document.querySelectorAll('#signal-rows tr').length === 1")
    page.page.fill("#search", "")
    show(SignalTable(62.0, rows[:1], 0.0), "1 of 1 signals")
    assert page.evaluate(shown) == [[rows[0].name, "<b>on</b>", "50 1/s", "0.0 s"]]
    show(SignalTable(62.0, [], 0.0, "<b>no memory"), "no signals: <b>no memory")
    assert page.evaluate("window.pwned === undefined && !document.querySelector('#decoded b, #decoded img')")
    assert page.wrong == []
    page.context.close()


@pytest.mark.slow("a session and its page in a browser")
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
