"""The terminal that a view has taken over: how it is written to, and how it is restored before a hard end."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

from canid.ui.terminal.ansi import LEAVE
from canid.ui.terminal.keys import Keyboard
from canid.ui.terminal.streams import Stream

_open: tuple[TextIO, Keyboard] | None = None


def opened(stream: TextIO, keyboard: Keyboard) -> None:
    """A view is on `stream` from now on."""
    global _open
    _open = stream, keyboard


def closed() -> None:
    """The view has restored the terminal."""
    global _open
    _open = None


def restore_at_once() -> None:
    """Restore the terminal, if a view is open, without waiting for anything: the process ends now."""
    if _open is None:
        return
    stream, keyboard = _open
    with suppress(Exception):  # of any kind: the process ends
        keyboard.restore()
        fd = stream.fileno()
        if hasattr(select, "poll"):
            poll = select.poll()
            poll.register(fd, select.POLLOUT)
            if not poll.poll(0):
                return  # a stuck terminal
        os.write(fd, LEAVE.encode())


def write(stream: TextIO, text: str) -> None:
    """Write a control sequence that must not be lost."""
    if isinstance(stream, Stream):
        stream.draw(text, keep=True)
    else:
        stream.write(text)
        stream.flush()


def draw(stream: TextIO, picture: str) -> None:
    """Write a picture; one that still waits is replaced by it. Characters that the terminal cannot show become "?"."""
    if isinstance(stream, Stream):
        stream.draw(picture, keep=False)
    else:
        encoding = getattr(stream, "encoding", None) or "utf-8"
        stream.write(picture.encode(encoding, "replace").decode(encoding))
        stream.flush()


def hold_messages(show: Callable[[str], object]) -> Stream | None:
    """Keep what is written to standard error while a view covers the same screen; `show` gets its lines."""
    stream = sys.stderr
    if isinstance(stream, Stream) and stream.isatty():
        stream.hold(show)
        return stream
    return None


def release_messages(held: Stream | None) -> None:
    """Write what was kept."""
    if held is not None:
        held.release()
