"""Connections without the token keep nobody out, and no client may send more than a person does."""

from __future__ import annotations

import os
import random
import socket
import time
from contextlib import suppress

import pytest
from websockets.exceptions import ConnectionClosed

from canid.ui.web.connections import MAX_STRANGERS, REQUEST_TIMEOUT_S
from tests.fixtures.crowd import FRAMES, crowd, drawn, thrown_out
from tests.web.conftest import Page, client

# s; bounds what hangs, no more
PATIENCE_S = 60.0


def fetched(page: Page, path: str) -> bytes:
    with socket.create_connection(("127.0.0.1", page.port), timeout=PATIENCE_S) as sock:
        sock.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n\r\n".encode())
        return b"".join(iter(lambda: sock.recv(65536), b""))


def test_silent_and_slow_connections_keep_nobody_out(fresh: Page, seed: int) -> None:
    """With hundreds of connections that send nothing, or never the end of a request, the page, its files and the websocket
    of the owner answer, those that were open before stay, and the server's descriptors are bounded."""
    with client(fresh) as before:
        before.recv(PATIENCE_S)
        with crowd(fresh.port, drawn(random.Random(seed))):
            for path in ("/", "/page.js", "/plotly.min.js"):
                assert fetched(fresh, path).startswith(b"HTTP/1.1 200 ")
            with client(fresh) as late:
                assert "snapshot" in str(late.recv(PATIENCE_S))
            assert len(os.listdir(f"/proc/{fresh.live.pid}/fd")) < MAX_STRANGERS + 40
        before.send('{"do": "mark", "text": "still here"}')
        end = time.monotonic() + PATIENCE_S
        marks: list[str] = []
        while not marks and time.monotonic() < end:
            marks += [mark.text for mark in fresh.controls.take_marks()]
            time.sleep(0.02)
        assert marks == ["still here"]


def test_connections_with_a_request_are_kept_before_silent_ones(fresh: Page) -> None:
    """An answer that is being taken slowly is not ended by silent connections, however many come."""
    with socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.settimeout(PATIENCE_S)
        slow.connect(("127.0.0.1", fresh.port))
        slow.sendall(f"GET /plotly.min.js HTTP/1.1\r\nHost: 127.0.0.1:{fresh.port}\r\n\r\n".encode())
        data = slow.recv(1000)
        with crowd(fresh.port, [b""] * (MAX_STRANGERS + 50)):
            fetched(fresh, "/")
            data += b"".join(iter(lambda: slow.recv(65536), b""))
    head, _, body = data.partition(b"\r\n\r\n")
    assert f"content-length: {len(body)}".encode() in head.lower()


@pytest.mark.slow("pages in a browser")
def test_a_request_that_does_not_end_is_ended(fresh: Page) -> None:
    """A byte now and then does not keep a connection open."""
    with socket.create_connection(("127.0.0.1", fresh.port), timeout=PATIENCE_S) as slow:
        slow.sendall(b"GET / HTTP/1.1\r\nX: ")
        end = time.monotonic() + PATIENCE_S + REQUEST_TIMEOUT_S
        with suppress(OSError):
            while time.monotonic() < end:
                slow.sendall(b"x")
                time.sleep(0.2)
        assert time.monotonic() < end


@pytest.mark.slow("a session and its page in a browser")
@pytest.mark.parametrize("kind", FRAMES)
def test_every_frame_counts(kind: str, fresh: Page) -> None:
    """A client with the token that sends frames of any kind without a pause is thrown out, and other clients are not."""
    first, many = FRAMES[kind]
    with client(fresh) as other, client(fresh) as flooding:
        assert thrown_out(flooding.socket, first, many * 1000, PATIENCE_S)
        with suppress(ConnectionClosed):
            while True:
                flooding.recv(PATIENCE_S)  # a TimeoutError where it is still open
        fresh.live.status({"state": "recording"})
        while "recording" not in str(other.recv(PATIENCE_S)):
            pass


def test_a_slow_client_may_send_fragments(fresh: Page) -> None:
    """A request in a few fragments is a request."""
    with client(fresh) as own:
        own.send(['{"do": "mark", ', '"text": ', '"in parts"}'])
        end = time.monotonic() + PATIENCE_S
        marks: list[str] = []
        while not marks and time.monotonic() < end:
            marks += [mark.text for mark in fresh.controls.take_marks()]
            time.sleep(0.02)
        assert marks == ["in parts"]
