"""Limits of the server's connections: those that have not shown the token, and the frames of those that have.

A connection without the token asks for one file and is closed; it has a few seconds to ask and a minute to take the answer.
Only so many are open, and one that has asked for nothing leaves first, so that no number of silent ones keeps a page out.
Websockets with the token do not count among them: the hub limits those.
"""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

# connections without the token; a browser has six at a time
MAX_STRANGERS = 128
# s for the whole head of a request
REQUEST_TIMEOUT_S = 5.0
# s for taking an answer: plotly.js over a slow phone network
ANSWER_TIMEOUT_S = 60.0
# s that a websocket that was ended may take its last bytes
LINGER_S = 2.0
# frames of a client, of whatever kind: a person with a key held down makes 30 requests a second, half of which are of no use
FRAMES_PER_S = 20.0
POLICY_VIOLATION = 1008  # RFC 6455


class Strangers:
    """The open connections that have not shown the token, those that have asked for nothing apart from the others."""

    def __init__(self) -> None:
        """None yet."""
        self._silent: dict[asyncio.Transport, asyncio.TimerHandle] = {}
        self._asked: dict[asyncio.Transport, asyncio.TimerHandle] = {}

    def came(self, transport: asyncio.Transport) -> None:
        """A connection is new: where there are too many, the oldest one that has asked for nothing is ended."""
        oldest = next(iter(self._silent or self._asked), None)
        if oldest is not None and len(self._silent) + len(self._asked) >= MAX_STRANGERS:
            self._end(oldest)
        self._silent[transport] = asyncio.get_running_loop().call_later(
            REQUEST_TIMEOUT_S, self._end, transport
        )

    def asked(self, transport: asyncio.Transport) -> None:
        """It has sent a request."""
        timer = self._silent.pop(transport, None)
        if timer is not None:
            timer.cancel()
            loop = asyncio.get_running_loop()
            self._asked[transport] = loop.call_later(ANSWER_TIMEOUT_S, self._end, transport)

    def left(self, transport: asyncio.Transport) -> None:
        """It has gone, or has shown the token."""
        for group in (self._silent, self._asked):
            timer = group.pop(transport, None)
            if timer is not None:
                timer.cancel()

    def _end(self, transport: asyncio.Transport) -> None:
        self.left(transport)
        transport.abort()


class HttpProtocol(H11Protocol):
    """uvicorn's HTTP, of connections that are counted and limited in time."""

    def __init__(self, strangers: Strangers, *args: Any, **settings: Any) -> None:
        """`strangers` counts the connection."""
        super().__init__(*args, **settings)
        self._strangers = strangers

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count it."""
        super().connection_made(transport)
        self._strangers.came(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """It counts no more."""
        self._strangers.left(self.transport)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        super().data_received(data)
        if self.scope is not None:
            self._strangers.asked(self.transport)


class WebsocketProtocol(WebSocketsSansIOProtocol):
    """uvicorn's websocket, with a limit of frames, and which an application may end without waiting for the client."""

    def __init__(self, strangers: Strangers, *args: Any, **settings: Any) -> None:
        """`strangers` counts the connection until it has shown the token."""
        super().__init__(*args, **settings)
        self._strangers = strangers
        self._left = FRAMES_PER_S  # frames that it may send now
        self._last = self.loop.time()
        self._out = False

    def connection_lost(self, exc: Exception | None) -> None:
        """It counts no more."""
        self._strangers.left(self.transport)
        super().connection_lost(exc)

    async def run_asgi(self) -> None:
        """Serve one websocket."""
        scope: dict[str, Any] = self.scope  # type: ignore[assignment]
        scope["canid.abort"] = self.transport.abort
        scope["canid.close"] = self._close_now
        scope["canid.known"] = lambda: self._strangers.left(self.transport)
        await super().run_asgi()
        self.loop.call_later(LINGER_S, self.transport.abort)

    def data_received(self, data: bytes) -> None:
        """Take a part of a frame, or several; from a client that was thrown out nothing more is even read."""
        if self._out:
            self.transport.pause_reading()
        else:
            super().data_received(data)

    # every frame counts: a fragment and a ping cost as much as a request

    def handle_cont(self, event: Frame) -> None:
        """Take a fragment; empty ones are not kept."""
        if self._may() and (event.data or event.fin):
            super().handle_cont(event)

    def handle_text(self, event: Frame) -> None:
        """Take a text, or its first fragment."""
        if self._may():
            super().handle_text(event)

    def handle_bytes(self, event: Frame) -> None:
        """Take bytes, which are no request; the application ends it."""
        if self._may():
            super().handle_bytes(event)

    def handle_ping(self) -> None:
        """Answer a ping."""
        if self._may():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """Take a pong."""
        if self._may():
            super().handle_pong(event)

    def _may(self) -> bool:
        if self._out:
            return False
        now = self.loop.time()
        self._left = min(self._left + (now - self._last) * FRAMES_PER_S, FRAMES_PER_S) - 1.0
        self._last = now
        if self._left < 0.0:
            self._out = True
            self._close_now(POLICY_VIOLATION)
            self.queue.put_nowait({"type": "websocket.disconnect", "code": POLICY_VIOLATION})
        return not self._out

    def _close_now(self, code: int) -> None:
        if not self.close_sent and not self.transport.is_closing():
            self.conn.send_close(code)
            self.transport.write(b"".join(self.conn.data_to_send()))
