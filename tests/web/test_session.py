"""The page of a session: clients cost no frame, whatever they do, and a server that dies ends nothing."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from canid.analysis.session.session import SessionSettings
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.ui.cli import live_session
from canid.ui.views.terminal_view.state import View
from canid.values.types import Frame
from tests.web.conftest import Page

# frames, and s that they take
FRAMES, SECONDS = 9000, 3.0
CLIENTS = 18
# s; bounds what hangs, no more
PATIENCE_S = 120.0


def session(page: Page, folder: Path, ended: Callable[[], bool]) -> list[Frame]:
    """A recorded session of numbered frames on a virtual bus, with this page; returns what was sent."""
    frames = [Frame(k * SECONDS / FRAMES, 0, 0x100 + k % 4, k.to_bytes(8, "little")) for k in range(FRAMES)]
    config = {"interface": "virtual", "channel": str(folder)}
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    buses = open_buses([config])
    sender.start()
    end = time.monotonic() + PATIENCE_S
    code, _ = live_session.watch(
        buses,
        SessionSettings(record=folder / "drive.blf"),
        View("test"),
        stop=lambda: (not sender.is_alive() and ended()) or time.monotonic() > end,
        controls=page.controls,
        others=[page.live],
    )
    assert time.monotonic() < end
    assert code == 0
    return frames


def recorded(folder: Path) -> list[tuple[int, bytes]]:
    return [(frame.id, frame.data) for frame in open_log(folder / "drive.blf")]


class Clients(threading.Thread):
    """Prompt clients, one that never reads, and one that floods, until the page ends."""

    def __init__(self, page: Page) -> None:
        super().__init__()
        self.here = f"127.0.0.1:{page.port}"
        self.token = page.token
        self.states: dict[int, str] = {}
        self.thrown_out: list[int] = []
        self.flooded = 0

    def run(self) -> None:
        asyncio.run(self.all())

    def open(self) -> Any:
        return connect(
            f"ws://{self.here}/live",
            origin=f"http://{self.here}",  # type: ignore[arg-type]
            subprotocols=["canid", self.token],  # type: ignore[list-item]
            max_size=2**26,
        )

    async def all(self) -> None:
        mute = socket.create_connection(("127.0.0.1", int(self.here.rpartition(":")[2])))
        with mute:
            mute.sendall(
                f"GET /live HTTP/1.1\r\nHost: {self.here}\r\nOrigin: http://{self.here}\r\n"
                f"Sec-WebSocket-Protocol: canid, {self.token}\r\n"
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
            )
            await asyncio.gather(self.flood(), *(self.prompt(k) for k in range(CLIENTS)))

    async def prompt(self, k: int) -> None:
        try:
            async with self.open() as client:
                async for text in client:
                    for one in json.loads(text).get("messages", ()):
                        if one["kind"] == "status":
                            self.states[k] = one["value"]["state"]
                        if one["kind"] == "end":
                            self.states[k] = "end"
        except ConnectionClosed:
            pass

    async def flood(self) -> None:
        try:
            async with self.open() as client:
                while True:
                    await client.send('{"do": "mark", "text": "flood"}')
                    self.flooded += 1
        except ConnectionClosed as closed:
            self.thrown_out.append(closed.rcvd.code if closed.rcvd else 0)


@pytest.mark.slow("a session and its page in a browser")
def test_clients_cost_no_frame(fresh: Page, tmp_path: Path) -> None:
    """18 that read, one that never does, one that floods: all frames are recorded, the flooding one is thrown out and has
    made few marks, and each of the others sees the session's end."""
    clients = Clients(fresh)
    clients.start()
    frames = session(fresh, tmp_path, lambda: len(clients.states) == CLIENTS and bool(clients.thrown_out))
    clients.join(PATIENCE_S)
    assert recorded(tmp_path) == [(frame.id, frame.data) for frame in frames]
    assert clients.states == dict.fromkeys(range(CLIENTS), "end")
    assert len(clients.thrown_out) == 1  # without a code where its own messages fill the connection
    assert fresh.says == []
    journal = "".join(
        path.read_text(encoding="utf-8") for path in tmp_path.iterdir() if path.suffix != ".blf"
    )
    assert 0 < journal.count("flood") < 10


@pytest.mark.slow("pages in a browser")
def test_a_server_that_is_killed_ends_nothing(fresh: Page, tmp_path: Path) -> None:
    """kill -9 of the server in mid-session: all frames are recorded, and one line says so."""

    def kill() -> None:
        time.sleep(SECONDS / 3)
        os.kill(fresh.live.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    frames = session(fresh, tmp_path, lambda: bool(fresh.says))
    killer.join()
    assert recorded(tmp_path) == [(frame.id, frame.data) for frame in frames]
    assert fresh.says == ["the live page has ended (SIGKILL); the session goes on without it"]
