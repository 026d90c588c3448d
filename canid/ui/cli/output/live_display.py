"""The terminal view of a running session: drawn on the alternate screen, with keys."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, TextIO

from canid.io.recording.controls import MAX_MARK_TEXT, Controls
from canid.ui.terminal import ansi, open_terminal
from canid.ui.terminal.keys import Keyboard, in_foreground
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import REDRAW_HZ
from canid.ui.terminal.spans import Line, Span, cells, cut
from canid.ui.views.terminal_view import sections
from canid.ui.views.terminal_view.picture import Overlay, render
from canid.ui.views.terminal_view.state import HealthLine, Item, View, frozen, update, with_status
from canid.values.text.numbers import clock
from canid.values.types import Event

# where the terminal does not know its size
USUAL_SIZE = (80, 24)
# s that the last line confirms a mark
NOTICE_S = 2.0
# messages of other parts that wait to be shown as events
MAX_MESSAGES = 20


class LiveDisplay:
    """The live view on a terminal.

    Any thread may call it; the keys come in a thread of their own. It draws while the process is in the foreground.
    """

    def __init__(self, view: View, stream: TextIO, controls: Controls | None = None) -> None:
        """Draw on the terminal behind `stream`; keys from standard input, where that is a terminal."""
        self._lock = threading.RLock()
        self._view = view
        self._paused: View | None = None  # the view when it was paused
        self._prompt: str | None = None  # the text of a mark that is being typed
        self._overlay = Overlay()
        self._stopping = False
        self._notice = ""  # that a mark was made
        self._notice_until = 0.0
        self._stream = stream
        self._controls = controls
        self._color = "NO_COLOR" not in os.environ
        self._drawn = 0.0
        self._entered = False  # the alternate screen
        self._messages: deque[str] = deque(maxlen=MAX_MESSAGES)
        self._held = open_terminal.hold_messages(self._messages.append)
        self._keyboard = Keyboard(self._key)
        open_terminal.opened(stream, self._keyboard)
        self._overlay = Overlay(keys=self._keyboard.start())
        self._redraw(force=True)

    def put(self, item: Item) -> None:
        """Take it into the view, and redraw at `REDRAW_HZ`."""
        with self._lock:
            self._view = update(self._view, item)
            self._redraw()

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators."""
        with self._lock:
            self._view = self._view._replace(lines=tuple(lines), output=output or self._view.output)
            self._redraw()

    def status(self, values: dict[str, Any]) -> None:
        """Show how far the recording or the replay is."""
        with self._lock:
            self._view = with_status(self._view, values)
            self._redraw()

    def close(self) -> None:
        """Restore the terminal; the events then stand on its main screen."""
        self._keyboard.close()
        with self._lock:
            try:
                # of any kind: what cannot be drawn must not leave the terminal as it is
                with suppress(Exception):
                    self._redraw(force=True)
                if self._entered:
                    open_terminal.write(self._stream, ansi.LEAVE)
                    self._entered = False
            finally:
                open_terminal.closed()
                open_terminal.release_messages(self._held)
            for event in self._view.events:
                if event.what != MESSAGE:
                    info(sections.event_text(event))

    # --- drawing ---

    def _redraw(self, *, force: bool = False) -> None:
        now = time.monotonic()
        if not force and now - self._drawn < 1.0 / REDRAW_HZ:
            return
        self._drawn = now
        while self._messages:
            self._view = update(self._view, Event(self._view.t, MESSAGE, self._messages.popleft()))
        fd = _descriptor(self._stream)
        if fd is not None and not in_foreground(fd):
            # another program has the terminal
            if self._entered:
                open_terminal.write(self._stream, ansi.LEAVE)
                self._entered = False
            return
        if not self._entered:
            # else Ctrl-Z would stop the recording for as long as the thread of the keys has not noticed
            self._keyboard.grab()
            open_terminal.write(self._stream, ansi.ENTER)
            self._entered = True
        columns, rows = _size(fd)
        shown = self._view if self._paused is None else frozen(self._view, self._paused)
        overlay = self._overlay._replace(last_line=self._last_line(columns))
        picture = render(shown, columns, rows, overlay)
        open_terminal.draw(self._stream, ansi.drawn(picture, columns, color=self._color))

    def _last_line(self, columns: int) -> Line:
        if self._prompt is not None:
            return _prompt(self._prompt, self._where_marks_go(), columns)
        if time.monotonic() < self._notice_until:
            return (Span(f" {self._notice} ", "reverse bold cyan"),)
        if self._stopping:
            return (Span(" stopping: what was received is being written ", "reverse yellow"),)
        if self._paused is not None:
            goes_on = "the replay goes on" if self._view.replayed is not None else "the recording goes on"
            if self._view.recording is not None and not self._view.recording.path:
                goes_on = "the session goes on"
            long = f" VIEW PAUSED at {clock(self._paused.t)}: {goes_on}; space shows it again "
            short = f" VIEW PAUSED; {goes_on}; space "
            return (Span(long if cells(long) <= columns else short, "reverse yellow"),)
        return ()

    def _where_marks_go(self) -> str:
        """A warning where a mark is only shown."""
        if self._view.recording is not None and self._view.recording.path:
            return ""
        return "shown only, nothing is recorded"

    # --- keys ---

    def _key(self, key: str) -> None:
        with self._lock:
            if self._prompt is not None:
                self._typed(key)
            elif self._overlay.help:
                self._overlay = self._overlay._replace(help=False)
            elif key == "q" and self._controls is not None:
                self._stopping = True
                self._controls.stop()
            elif key == "m" and self._controls is not None:
                self._prompt = ""
            elif key == "d" and self._controls is not None:
                self._controls.diagnose()
            elif key == " ":
                self._paused = self._view if self._paused is None else None
            elif key == "u":
                self._overlay = self._overlay._replace(unit=self._overlay.unit.other)
            elif key == "?":
                self._overlay = self._overlay._replace(help=True)
            # of any kind: the session's own thread reports it, and the keys still act
            with suppress(Exception):
                self._redraw(force=True)

    def _typed(self, key: str) -> None:
        assert self._prompt is not None
        if key == "enter":
            self._mark(self._prompt.strip())
            self._prompt = None
        elif key == "escape":
            self._prompt = None
        elif key == "backspace":
            self._prompt = self._prompt[:-1]
        elif len(key) == 1 and len(self._prompt) < MAX_MARK_TEXT:
            self._prompt += key

    def _mark(self, text: str) -> None:
        self._notice = "mark set"
        self._notice_until = time.monotonic() + NOTICE_S
        if self._view.recording is None:
            # a replay has no journal
            says = f"mark{f': {text}' if text else ''} (shown only: a replay records nothing)"
            self._view = update(self._view, Event(self._view.t, "mark", says))
        elif self._controls is not None:
            self._controls.mark(text)


# `what` of an event that is a message of another part of canid
MESSAGE = "message"


def _prompt(text: str, warning: str, columns: int) -> Line:
    """The prompt of a mark: of a long text its end; how to leave it where there is room for that."""
    start = " mark: "
    hint = "  Enter sets it, Esc cancels" + (f"; {warning}" if warning else "")
    short = f"  {warning}" if warning else "  Enter, Esc"
    room = columns - cells(start) - 1
    for words in (hint, short, ""):
        if cells(words) <= room - min(cells(text), 12):
            break
    tail = cut(text[::-1], max(room - cells(words), 1))[::-1]
    return (Span(start, "reverse bold cyan"), Span(tail, "bold"), Span("▏"), Span(words, "dim"))


def _descriptor(stream: TextIO) -> int | None:
    try:
        return stream.fileno()
    except (OSError, ValueError, AttributeError):
        return None


def _size(fd: int | None) -> tuple[int, int]:
    """Columns and rows: of the terminal, else of COLUMNS and LINES, else the usual ones."""
    columns = rows = 0
    if fd is not None:
        with suppress(OSError):
            columns, rows = os.get_terminal_size(fd)
    known = [os.environ.get(name, "") for name in ("COLUMNS", "LINES")]
    asked = [int(text) if text.isdecimal() else 0 for text in known]
    return columns or asked[0] or USUAL_SIZE[0], rows or asked[1] or USUAL_SIZE[1]
