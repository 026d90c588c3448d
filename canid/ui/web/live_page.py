"""The live page as an observer of a session or a replay: the parent's side of the server's process.

Nothing waits for the server: messages are put in a bounded queue, and a thread makes JSON of them and writes them to the
child's standard input. What the child cannot take in time is dropped and counted. A child that dies is reported once.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from canid.io.recording.controls import Controls
from canid.ui.views.terminal_view.state import HealthLine
from canid.ui.web import messages
from canid.ui.web.access import Access
from canid.ui.web.address import Address, url
from canid.ui.web.requests import obey, parsed
from canid.values.processes.child import EXIT_S, Child
from canid.values.processes.child_process import command
from canid.values.signal_table import SignalTable

# messages that may wait: a minute of a session, some 2 MB
MAX_WAITING = 2000
# s that a replay waits for a server that takes nothing, before it goes on without the message
PATIENCE_S = 2.0
# s that the end waits for the server
CLOSE_TIMEOUT_S = 0.3
# s between two marks: pages of several people, and keys held down
MARK_INTERVAL_S = 0.2


class LivePage:
    """Feeds the server's process, and obeys its requests."""

    def __init__(
        self,
        sock: socket.socket,
        access: Access,
        start: dict[str, Any],
        controls: Controls,
        allowed: tuple[str, ...],
        say: Callable[[str], None],
        *,
        waits: bool = False,
    ) -> None:
        """Start the server on a listening socket, which is closed here.

        Args:
            sock: from `address.listening`.
            access: what the server accepts.
            start: what the page shows as its title, and which parts it has.
            controls: what requests act on.
            allowed: requests, of `requests.OF_SESSION` or `requests.OF_REPLAY`.
            say: takes the one line that the server has ended.
            waits: a full queue holds up the caller, up to `PATIENCE_S`: for a replay, which can wait.
        """
        self.lost = 0  # messages
        self.url = url(Address(access.host, access.port), access.token)
        self._controls = controls
        self._allowed = allowed
        self._say = say
        self._waits = waits
        self._output = ""
        self._passes = 1
        self._marked = 0.0
        self._closing = self._dead = False
        self._changed = threading.Condition()
        self._waiting: deque[tuple[str, Any]] = deque()
        # a socket is inherited by its number; on Windows the child opens its own
        inherited = os.name == "posix"
        if not inherited:
            sock.close()
        descriptors = (sock.fileno(),) if inherited else ()
        self._child = Child(command("canid.ui.web.server", *map(str, descriptors)), inherited=descriptors)
        if inherited:
            sock.close()
        self._waiting.append(("", {**access._asdict(), "allowed": allowed}))
        self._waiting.append(("", {"kind": "start", **start, "allowed": allowed}))
        self._writer = threading.Thread(target=self._write, name="canid-web-write", daemon=True)
        self._reader = threading.Thread(target=self._read, name="canid-web-read", daemon=True)
        self._writer.start()
        self._reader.start()

    @property
    def pid(self) -> int:
        """Of the server's process."""
        return self._child.pid

    def put(self, item: messages.Item) -> None:
        """Show one output."""
        self._offer("item", item)

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators."""
        self._offer("lines", (tuple(lines), output))

    def status(self, values: dict[str, Any]) -> None:
        """Show numbers on the session, or the position of a replay."""
        if values.get("passes", 1) != self._passes:
            self._passes = values["passes"]
            self._offer("", {"kind": "reset"})
        self._offer("status", values)

    def table(self, table: SignalTable) -> None:
        """Show all signals, to those who have asked for them."""
        self._offer("table", table)

    def close(self) -> None:
        """Give the clients the last messages, and end the server. A second call does nothing."""
        with self._changed:
            if self._closing:
                return
            self._closing = True
            self._waiting.append(("", {"kind": "end"}))
            self._changed.notify_all()
        end = time.monotonic() + CLOSE_TIMEOUT_S
        self._writer.join(CLOSE_TIMEOUT_S)
        self._child.wait(max(end - time.monotonic(), 0.0))
        self._child.kill()
        self._reader.join(CLOSE_TIMEOUT_S)
        self._child.end()

    def _offer(self, kind: str, what: Any) -> None:
        with self._changed:
            if self._waits and len(self._waiting) >= MAX_WAITING:
                self._changed.wait_for(
                    lambda: len(self._waiting) < MAX_WAITING or self._dead or self._closing, PATIENCE_S
                )
            if self._dead or self._closing:
                return
            if len(self._waiting) >= MAX_WAITING:
                self.lost += 1
                return
            self._waiting.append((kind, what))
            self._changed.notify_all()

    def _message(self, kind: str, what: Any) -> dict[str, Any]:
        if kind == "item":
            return messages.of_item(what, self._output)
        if kind == "lines":
            self._output = what[1] or self._output
            return messages.of_lines(what[0], self._output)
        if kind == "status":
            return {**messages.of_status(what), "lost": self.lost}
        if kind == "table":
            return messages.of_table(what)
        return dict(what)

    def _encoded(self, item: tuple[str, Any]) -> bytes:
        try:
            return messages.encode(self._message(*item))
        except Exception:  # of any kind: one message is lost, not the page
            self.lost += 1
            return b""

    def _write(self) -> None:
        stream = self._child.stdin
        with suppress(OSError, ValueError):  # it has died, or is being closed
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._waiting or self._dead or self._closing)
                    waiting = list(self._waiting)
                    self._waiting.clear()
                    self._changed.notify_all()
                if self._dead or not waiting:
                    break
                stream.write(b"".join(map(self._encoded, waiting)))
                stream.flush()
        with suppress(OSError):
            stream.close()

    def _read(self) -> None:
        for line in self._child.stdout:
            # the child faces the network: it is not believed either
            request = parsed(line, self._allowed)
            if request is None:
                continue
            if request["do"] == "mark":
                now = time.monotonic()
                if now - self._marked < MARK_INTERVAL_S:
                    continue
                self._marked = now
            obey(request, self._controls)
        code = self._child.end(EXIT_S)
        with self._changed:
            self._dead = True
            closing = self._closing
            self._changed.notify_all()
        if not closing:
            why = f"exit code {code}" if code is None or code >= 0 else signal.Signals(-code).name
            self._say(f"the live page has ended ({why}); the session goes on without it")
