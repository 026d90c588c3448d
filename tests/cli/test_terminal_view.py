"""The terminal view on real terminals: what is always there, the keys, and the terminal afterwards."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.io.recording.controls import Controls
from canid.ui.cli.output.live_display import LiveDisplay
from canid.ui.terminal import open_terminal
from canid.ui.terminal.detached_writer import DetachedWriter
from canid.ui.terminal.keys import CHECK_INTERVAL_S, Keyboard
from canid.ui.terminal.spans import cells
from canid.ui.views.terminal_view.state import View
from canid.values.types import Event
from tests.bus.conftest import NEEDS, has_netns
from tests.fixtures import terminal
from tests.fixtures.readers import by_canid
from tests.fixtures.terminal import ROOT, Terminal
from tests.fixtures.traffic import WORDS, Traffic

URBAN = ROOT / "replay_logs" / "following_urban.blf"
SIZES = ((80, 24), (40, 15), (200, 60))
BUS = " ".join(WORDS)

Opened = Callable[[int, int], Terminal]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Opened]:
    """Opens a terminal; in CI it must be there, as the browser must."""
    why = terminal.missing()
    if why:
        (pytest.fail if os.environ.get("CANID_BROWSER") else pytest.skip)(why)
    windows: list[Terminal] = []

    def open_(columns: int, rows: int) -> Terminal:
        windows.append(Terminal(tmp_path, columns, rows))
        return windows[-1]

    yield open_
    for window in windows:
        window.close()


@pytest.fixture
def between_processes() -> None:
    if not has_netns():
        (pytest.fail if "netns" in os.environ.get("CANID_BUSES", "").split() else pytest.skip)(NEEDS["netns"])


def fits(screen: str, columns: int, rows: int) -> bool:
    lines = screen.split("\n")
    return len(lines) <= rows + 1 and max(map(cells, lines)) <= columns


def ended(screen: str) -> bool:
    """The shell has written the exit code."""
    return re.search(r"^code=\d", screen, re.MULTILINE) is not None


def headline(screen: str) -> bool:
    """Estimator, K with its interval, and the sentence on what may be quoted."""
    interval = r"\[-?\d+\.\d\d, -?\d+\.\d\d\]"
    says = r"K only|K, and τ and θ only as a sum|K, τ and θ"
    return bool(re.search(r"▶ \w+  ok", screen) and re.search(interval, screen) and re.search(says, screen))


@pytest.mark.slow("whole commands, one after the other")
def test_a_replay_at_three_sizes_and_its_keys(opened: Opened) -> None:
    """The drive's time and the headline are there at every size while it runs; u, ?, space, m act, q ends it with 0."""
    window = opened(*SIZES[0])
    window.type("stty -g > before")
    window.type(f"./c replay {URBAN} --vehicle generic --speed 10; echo code=$?; stty -g > after")
    window.wait(headline)
    for columns, rows in (*SIZES, SIZES[0]):
        window.resize(columns, rows)
        # the picture that was on its way when the size changed is drawn over by the next one
        last = "units  ? help" if columns >= 80 else "? help"
        screen = window.wait(
            lambda s, size=(columns, rows), last=last: (
                headline(s) and fits(s, *size) and s.rstrip().endswith(last)
            )
        )
        assert re.search(r"REPLAY  \d:\d\d\.\d of 2:59\.9  \d+ %  ×10", screen)
        assert "…" not in screen
    assert window.state("alternate_on") == "1"
    window.wait(lambda s: re.search(r"speed +[\d.]+ m/s", s) is not None)
    window.press("u")
    window.wait(lambda s: re.search(r"speed +[\d.]+ km/h", s) is not None)
    window.press("?")
    window.wait(lambda s: "stop cleanly" in s and headline(s))
    window.press("x")
    window.wait(lambda s: "stop cleanly" not in s)
    window.press("mq")  # a letter of the text is no key
    assert "shown only" in window.wait(lambda s: " mark: q" in s)
    window.key("Escape")
    window.wait(lambda s: " mark: " not in s)
    window.press("m overtaking")
    window.key("Enter")
    window.wait(lambda s: "mark: overtaking (shown only: a replay records nothing)" in s)
    window.press(" ")
    paused = window.wait(lambda s: "VIEW PAUSED" in s and "the replay goes on" in s)
    moved = window.wait(lambda s: s.split("\n")[0] != paused.split("\n")[0])
    assert moved.split("\n")[1:4] == paused.split("\n")[1:4]
    window.press("q")
    screen = window.wait(ended)
    assert "code=0" in screen
    assert "headline estimate" in screen
    assert "mark: overtaking" in screen
    assert (window.state("alternate_on"), window.state("cursor_flag")) == ("0", "1")
    window.wait(lambda s: s.rstrip().endswith("$"))
    folder = window.folder
    assert (folder / "after").read_text() == (folder / "before").read_text()


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.usefixtures("between_processes")
def test_a_recording_with_marks_and_its_clean_stop(opened: Opened, tmp_path: Path) -> None:
    """REC, frames and drops at every size; the view paused, its line goes on; marks in log and journal; q ends with 0."""
    traffic = Traffic(500.0).start()
    try:
        window = opened(*SIZES[1])
        window.type(f"./c live {BUS} --vehicle generic --record a.asc; echo code=$?")
        for columns, rows in (SIZES[1], SIZES[2], SIZES[0]):
            window.resize(columns, rows)
            screen = window.wait(
                lambda s, size=(columns, rows): "● REC" in s and "a.asc" in s and fits(s, *size)
            )
            assert "0 dropped" in screen
            assert re.search(r"[\d,]+ frames", screen)
        window.press("m")
        window.wait(lambda s: " mark: " in s)
        window.key("Enter")  # without a text
        window.wait(lambda s: re.search(r"\d mark$", s, re.MULTILINE) is not None)
        window.press(" ")
        window.wait(lambda s: "VIEW PAUSED" in s and "the recording goes on" in s)
        before = window.screen().split("\n")[0]
        window.wait(lambda s: "● REC" in s and s.split("\n")[0] != before)
        window.press("mlorry \x01\x9b31m[cut in] τ")
        window.key("Enter")
        window.wait(lambda s: "mark: lorry 31m[cut in] τ" in s)
        window.press("q")
        assert "code=0" in window.wait(ended)
    finally:
        traffic.stop()
    log = open_log(tmp_path / "a.asc")
    numbers = [int.from_bytes(data[:4], "big") for _, data in by_canid(tmp_path / "a.asc").frames]
    assert log.damage is None
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    journal = [json.loads(line) for line in (tmp_path / "a.events.jsonl").read_text().splitlines()]
    says = [event["says"] for event in journal if event["what"] == "mark"]
    assert says == ["mark", "mark: lorry 31m[cut in] τ"]
    assert "mark: lorry 31m[cut in]" in (tmp_path / "a.asc").read_text(encoding="utf-8", errors="replace")


@pytest.mark.usefixtures("between_processes")
def test_a_job_in_the_background_is_not_stopped(opened: Opened, tmp_path: Path) -> None:
    """In the background it draws nothing and takes no key; brought to the foreground it does; SIGTERM restores all."""
    traffic = Traffic(200.0).start()
    try:
        window = opened(*SIZES[0])
        window.type(f"./c record {BUS} -o b.asc & echo $! > pid; sleep 1.5; clear; jobs")
        screen = window.wait(lambda s: "Running" in s)
        assert window.state("alternate_on") == "0"
        assert "● REC" not in screen
        window.type("fg; echo code=$?")
        window.wait(lambda s: "● REC" in s)
        assert window.state("alternate_on") == "1"
        window.key("C-z")  # would stop the recording
        window.press("u")
        os.kill(int((tmp_path / "pid").read_text()), signal.SIGTERM)
        assert "code=143" in window.wait(ended)
        assert (window.state("alternate_on"), window.state("cursor_flag")) == ("0", "1")
    finally:
        traffic.stop()
    assert open_log(tmp_path / "b.asc").damage is None


def test_without_a_keyboard_there_are_no_keys() -> None:
    """A pipe and a closed descriptor: no keys, no exception, nothing to restore."""
    reader, writer = os.pipe()
    for fd in (reader, writer):
        keyboard = Keyboard(lambda key: None, fd)
        assert not keyboard.start()
        keyboard.close()
        os.close(fd)
        assert not Keyboard(lambda key: None, fd).start()


def test_a_second_signal_leaves_the_terminal_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a hard end calls restores settings and main screen; hostile messages and marks are drawn as text."""
    reader, writer = pty.openpty()
    monkeypatch.setenv("TERM", "xterm")
    before = termios.tcgetattr(writer)
    got = bytearray()

    def read() -> None:
        try:
            while data := os.read(reader, 65536):
                got.extend(data)
        except OSError:
            pass

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    controls = Controls()
    pressed: list[str] = []
    arrived = threading.Event()

    def take(key: str) -> None:
        pressed.append(key)
        if key == "z":
            arrived.set()

    with os.fdopen(writer, "w", encoding="utf-8", closefd=False) as stream:
        shown = LiveDisplay(View("title \x1b]0;x\x07"), stream, controls)
        shown.put(Event(1.0, "x", "evil \x1b[2J\x9b\u202e"))
        keyboard = Keyboard(take, writer)
        assert keyboard.start()
        open_terminal.opened(stream, keyboard)
        os.write(reader, "m\x1b[Aü\x07\x1bz".encode())
        assert arrived.wait(terminal.PATIENCE_S)
        assert not termios.tcgetattr(writer)[3] & termios.ICANON
        open_terminal.restore_at_once()
        assert termios.tcgetattr(writer) == before
        time.sleep(3.0 * CHECK_INTERVAL_S)  # the thread of the keys does not take it again
        assert termios.tcgetattr(writer) == before
        keyboard.close()
        shown.close()
    os.close(writer)
    thread.join(terminal.PATIENCE_S)
    text = got.decode()
    assert pressed == ["m", "ü", "escape", "z"]
    assert "\x1b[?1049l" in text
    assert not set(re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", text)) & set(
        map(chr, [*range(0x09), 0x1B, 0x9B, 0x202E])
    )
    assert "\x1b[2J" not in text
    os.close(reader)


def test_a_stuck_terminal_gets_the_newest_picture() -> None:
    """Pictures that wait are replaced, control sequences are not, and neither counts as lost."""
    go, written = threading.Event(), []

    def write(data: bytes) -> None:
        written.append(data)
        assert go.wait(terminal.PATIENCE_S)

    writer = DetachedWriter(write, 100, "test")
    writer.put(b"enter")
    while not written:
        pass
    for k in range(1000):
        writer.put(b"picture %d" % k, replaceable=True)
    writer.put(b"leave")
    go.set()
    assert writer.close(terminal.PATIENCE_S)
    assert written == [b"enter", b"picture 999", b"leave"]
    assert writer.lost == 0
