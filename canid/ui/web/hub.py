"""Distribution of messages to any number of clients, none of which can delay the others or fill the memory.

A client has no queue of its own but a position in one bounded queue. It is sent what is new since then, when it has taken
what was sent before; one that falls behind the queue is given the history anew, and one that takes nothing is dropped.
Of the tables of all signals only the newest is kept, and sent to those alone who ask for it.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from canid.io.recording.controls import SIGNALS_HOLD_S
from canid.ui.web.access import PROTOCOL
from canid.ui.web.connections import POLICY_VIOLATION
from canid.ui.web.history import History
from canid.ui.web.requests import parsed

# messages that a client may be behind: some 5 s of a replay at 100 times real time
MAX_BEHIND = 4000
# s between two sendings to a client: a page redraws no faster
SEND_INTERVAL_S = 0.05
# s between two snapshots to a client that cannot follow
SNAPSHOT_INTERVAL_S = 1.0
# s that a client may take nothing before it is dropped
STALLED_S = 10.0
MAX_CLIENTS = 64
TRY_LATER = 1013  # RFC 6455


class _Client:
    """What a client has."""

    def __init__(self) -> None:
        self.position = -1  # in the messages; -1: it has nothing
        self.shows_until = 0.0  # monotonic clock, s; the table of signals
        self.table = 0  # number of the table that it has


class Hub:
    """History, queue and clients. All of it runs in the event loop."""

    def __init__(self, allowed: tuple[str, ...], request: Callable[[dict[str, Any]], None]) -> None:
        """`request` takes what a client asks for, of the kinds `allowed`."""
        self._allowed = allowed
        self._request = request
        self._history = History()
        self._queue: deque[str] = deque(maxlen=MAX_BEHIND)
        self._count = 0  # messages so far
        self._clients = 0
        self._waiting: set[asyncio.Future[None]] = set()
        self._made: tuple[tuple[int, int], str] = (
            (-1, -1),
            "",
        )  # the last batch: several clients want the same
        self._snapshot: tuple[int, float, str] = (-1, 0.0, "")
        self._table: tuple[int, str] = (0, "")  # how many there were, and the last one

    def take(self, lines: list[bytes]) -> None:
        """Take messages from the session."""
        for line in lines:
            text = line.decode("utf-8", "replace")
            message = json.loads(text)
            if message["kind"] == "table":
                self._table = self._table[0] + 1, text
                continue
            self._history.take(message)
            self._queue.append(text)
            self._count += 1
        for future in self._waiting:
            if not future.done():
                future.set_result(None)
        self._waiting.clear()

    def _behind(self, position: int) -> bool:
        return position < self._count - len(self._queue)

    def _batch(self, position: int) -> str:
        key = (position, self._count)
        if self._made[0] != key:
            first = len(self._queue) - (self._count - position)
            news = list(self._queue)[first:]
            self._made = key, '{"kind":"news","messages":[' + ",".join(news) + "]}"
        return self._made[1]

    def _whole(self) -> tuple[int, str]:
        """A snapshot, at most as old as half the interval between two, and its position."""
        count, at, text = self._snapshot
        now = time.monotonic()
        if count != self._count and (now - at > SNAPSHOT_INTERVAL_S / 2 or self._behind(count)):
            text = json.dumps(self._history.snapshot(), ensure_ascii=False, allow_nan=False)
            self._snapshot = count, _, _ = self._count, now, text
        return count, text

    async def _news(self) -> None:
        waiting = asyncio.get_running_loop().create_future()
        self._waiting.add(waiting)
        try:
            await waiting
        finally:
            self._waiting.discard(waiting)

    async def serve(self, socket: WebSocket) -> None:
        """Serve one client until it leaves, breaks a rule, or takes nothing."""
        if self._clients >= MAX_CLIENTS:
            await socket.close(TRY_LATER)
            return
        self._clients += 1
        writer: asyncio.Task[None] | None = None
        try:
            await socket.accept(PROTOCOL)
            client = _Client()
            writer = asyncio.create_task(self._write(socket, client))
            reader = asyncio.create_task(self._read(socket, client))
            done, left = await asyncio.wait((writer, reader), return_when=asyncio.FIRST_COMPLETED)
            for task in left:
                task.cancel()
            await asyncio.gather(*done, *left, return_exceptions=True)
        finally:
            self._clients -= 1

    async def _write(self, socket: WebSocket, client: _Client) -> None:
        due = 0.0
        try:
            while True:
                if client.position < 0 or self._behind(client.position):
                    await asyncio.sleep(due - time.monotonic())
                    due = time.monotonic() + SNAPSHOT_INTERVAL_S
                    client.position, text = self._whole()
                elif client.table < self._table[0] and time.monotonic() < client.shows_until:
                    client.table, text = self._table
                elif client.position == self._count:
                    await self._news()
                    continue
                else:
                    text, client.position = self._batch(client.position), self._count
                async with asyncio.timeout(STALLED_S):
                    await socket.send_text(text)
                await asyncio.sleep(SEND_INTERVAL_S)
        except TimeoutError:
            # not a closing handshake: nobody would read it
            socket.scope["canid.abort"]()

    async def _read(self, socket: WebSocket, client: _Client) -> None:
        with suppress(WebSocketDisconnect):
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                request = parsed(message.get("text") or "", self._allowed)
                if request is None:
                    socket.scope["canid.close"](POLICY_VIOLATION)
                    return
                if request["do"] == "signals":
                    client.shows_until = time.monotonic() + SIGNALS_HOLD_S
                self._request(request)
