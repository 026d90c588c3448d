"""The server of the live page, taken over by who connects to it, can write, send, connect, start and signal nothing."""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocket
from websockets.sync.client import connect

from canid.ui.web import address, server
from canid.values.processes.child import Child
from canid.values.processes.child_process import command
from canid.values.processes.confinement import offered
from tests.fixtures import attempts
from tests.fixtures.attempts import REFUSED
from tests.web.conftest import Page

needs_all = pytest.mark.skipif(not offered().complete, reason="this kernel or container refuses to confine")
PATIENCE_S = 60.0


class Hub(server.Hub):
    """Tries what its configuration allows to be asked, as soon as somebody connects."""

    def __init__(self, allowed: tuple[str, ...], request: Callable[[dict[str, Any]], None]) -> None:
        super().__init__(allowed, request)
        self.expressions = list(allowed)

    async def serve(self, websocket: WebSocket) -> None:
        """Answer with what came of each attempt."""
        await websocket.accept("canid")
        tried = attempts.tried(self.expressions)
        await asyncio.get_running_loop().run_in_executor(None, str)  # threads are left
        await websocket.send_text(tried)


def main() -> None:
    """The real server, but for its websocket."""
    server.Hub = Hub  # type: ignore[misc]
    server.main()


def answers(*expressions: str) -> list[Any]:
    """What comes of attempts in a server that has started as the real one does."""
    sock, where = address.listening(address.parse(""))
    token = secrets.token_urlsafe(16)
    here = f"127.0.0.1:{where.port}"
    with (
        sock,
        Child(command("tests.web.test_taken_over", str(sock.fileno())), inherited=[sock.fileno()]) as child,
    ):
        config = {"host": where.host, "port": where.port, "token": token, "allowed": expressions}
        child.stdin.write(json.dumps(config).encode() + b"\n")
        child.stdin.flush()
        with connect(
            f"ws://{here}/live",
            origin=f"http://{here}",  # type: ignore[arg-type]
            subprotocols=["canid", token],  # type: ignore[list-item]
        ) as websocket:
            found: list[Any] = json.loads(websocket.recv(PATIENCE_S))
    return found


@pytest.fixture
def listening() -> Iterator[int]:
    """A port of loopback that takes connections."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield other.getsockname()[1]


@needs_all
def test_what_a_taken_over_server_tries_is_refused(tmp_path: Path, listening: int) -> None:
    """Files, other programs and processes, signals, new sockets, and its own to connect anew; reading is left."""
    kept, new = tmp_path / "kept", str(tmp_path / "new")
    kept.write_text("kept", encoding="ascii")
    tries = (
        f"open({new!r}, 'w')",
        f"open({str(kept)!r}, 'r+')",
        "open('/dev/null', 'w')",
        "os.open(os.path.expanduser('~'), os.O_TMPFILE | os.O_RDWR)",
        f"os.unlink({str(kept)!r})",
        f"os.rename({str(kept)!r}, {new!r})",
        f"os.mkdir({new!r})",
        f"connected({listening})",
        f"reconnected({listening})",
        "socket.socket(socket.AF_INET, socket.SOCK_DGRAM)",
        "socket.socketpair()",
        "ran('/bin/true')",
        "ran(sys.executable, '-c', '')",
        "os.fork()",
        "os.execv('/bin/true', ['true'])",
        f"os.kill({os.getpid()}, 0)",
        f"os.killpg({os.getpgrp()}, 0)",
        f"os.open('/proc/{os.getpid()}/mem', os.O_RDONLY)",
    )
    *found, text = answers(*tries, f"open({str(kept)!r}).read()")
    assert dict(zip(tries, found, strict=True)) == dict.fromkeys(tries, REFUSED)
    assert text == "kept"
    assert not os.path.exists(new)


@needs_all
def test_the_real_server_has_given_up_its_rights(fresh: Page) -> None:
    """Every thread of the process that serves a session has no new privileges and a filter of calls."""
    here = f"127.0.0.1:{fresh.port}"
    with socket.create_connection(("127.0.0.1", fresh.port)) as sock:
        sock.sendall(f"GET /plotly.min.js HTTP/1.1\r\nHost: {here}\r\n\r\n".encode())
        assert b"".join(iter(lambda: sock.recv(65536), b"")).startswith(b"HTTP/1.1 200 ")
    statuses = [
        path.read_text(encoding="ascii") for path in Path(f"/proc/{fresh.live.pid}/task").glob("*/status")
    ]
    assert len(statuses) >= 2
    assert all("NoNewPrivs:\t1" in text and "Seccomp:\t2" in text for text in statuses)


if __name__ == "__main__":
    sys.exit(main())
