"""The web server of the live page, the child process: messages in on standard input, requests out on standard output.

Standard output takes one request a line. It never blocks: what the parent does not read is dropped.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
import threading
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from canid.web.access import Access, Guard
from canid.web.hub import Hub
from canid.web.requests import MAX_MESSAGE_BYTES

PAGE = Path(__file__).parent / "page"
TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
# below everything that records or estimates
NICENESS = 5
# handfuls of messages that wait for the event loop; then the pipe fills, and the parent drops
WAITING_READS = 8
READ_BYTES = 1 << 16
# s for the last message to leave
LAST_WORDS_S = 0.1
# connections, of clients and of those that send nothing
MAX_CONNECTIONS = 256
# s between two signs of life of a client
PING_INTERVAL_S = 20.0


class Protocol(WebSocketsSansIOProtocol):
    """uvicorn's websocket, which an application may also end without waiting for the client."""

    async def run_asgi(self) -> None:
        """Serve one websocket."""
        self.scope["canid.abort"] = self.transport.abort  # type: ignore[typeddict-unknown-key]
        self.scope["canid.close"] = self._close_now  # type: ignore[typeddict-unknown-key]
        await super().run_asgi()

    def _close_now(self, code: int) -> None:
        if not self.close_sent and not self.transport.is_closing():
            self.conn.send_close(code)
            self.transport.write(b"".join(self.conn.data_to_send()))


def application(hub: Hub, access: Access) -> Guard:
    """The pages and the websocket."""
    files = {path.name: path.read_bytes() for path in sorted(PAGE.iterdir()) if path.suffix in TYPES}
    index = files.pop("index.html").decode()
    plotly = plotly_path()
    # a new version has another address: the old one may stay in the browser for good
    version = f"{plotly.stat().st_size:x}-{int(plotly.stat().st_mtime):x}"
    index = index.replace("{plotly}", f"/plotly.min.js?v={version}")

    async def page(request: Request) -> Response:
        text = index.replace("{nonce}", request.scope["canid.nonce"])
        return Response(text, media_type="text/html")

    async def file(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in files:
            return Response("404: no such file\n", 404, media_type="text/plain")
        return Response(files[name], media_type=TYPES[Path(name).suffix])

    async def plots(_: Request) -> Response:
        forever = {"Cache-Control": "private, max-age=31536000, immutable"}
        return FileResponse(plotly, media_type=TYPES[".js"], headers=forever)

    async def live(websocket: WebSocket) -> None:
        await hub.serve(websocket)

    routes = [
        Route("/", page),
        Route("/plotly.min.js", plots),
        WebSocketRoute("/live", live),
        Route("/{name}", file),
    ]
    return Guard(Starlette(routes=routes), access)


def plotly_path() -> Path:
    """The plots' script in the installed plotly package, which is not imported."""
    found = find_spec("plotly")
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent / "package_data" / "plotly.min.js"


async def serve(config: dict[str, Any], sock: socket.socket) -> None:
    """Serve until standard input ends."""
    loop = asyncio.get_running_loop()
    os.set_blocking(1, False)

    def request(value: dict[str, Any]) -> None:
        with suppress(OSError):
            os.write(1, json.dumps(value).encode() + b"\n")

    hub = Hub(tuple(config["allowed"]), request)
    app = application(hub, Access(config["host"], config["port"], config["token"]))
    # proxy_headers: nobody may say that he comes from elsewhere
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            http="h11",
            ws=Protocol,
            loop="asyncio",
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            ws_max_size=MAX_MESSAGE_BYTES,
            ws_per_message_deflate=False,
            ws_ping_interval=PING_INTERVAL_S,
            limit_concurrency=MAX_CONNECTIONS,
        )
    )
    room = threading.Semaphore(WAITING_READS)

    def take(lines: list[bytes]) -> None:
        try:
            hub.take(lines)
        finally:
            room.release()

    def read() -> None:
        rest = b""
        while data := os.read(0, READ_BYTES):
            *lines, rest = (rest + data).split(b"\n")
            room.acquire()
            loop.call_soon_threadsafe(take, lines)
        loop.call_soon_threadsafe(loop.call_later, LAST_WORDS_S, os._exit, 0)

    threading.Thread(target=read, daemon=True).start()
    await server.serve(sockets=[sock])


def main() -> None:
    """Read the configuration, the first line, and serve."""
    for ignored in ("SIGINT", "SIGHUP"):
        if hasattr(signal, ignored):
            signal.signal(getattr(signal, ignored), signal.SIG_IGN)  # for the parent to answer
    with suppress(AttributeError, OSError):  # Windows has no such call
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    first = b""
    while not first.endswith(b"\n"):  # byte by byte: the rest is for the thread
        byte = os.read(0, 1)
        if not byte:
            return
        first += byte
    config = json.loads(first)
    if len(sys.argv) > 1:
        sock = socket.socket(fileno=int(sys.argv[1]))
    else:  # where a socket cannot be inherited
        family = socket.AF_INET6 if ":" in config["host"] else socket.AF_INET
        sock = socket.create_server((config["host"], config["port"]), family=family)
    asyncio.run(serve(config, sock))


if __name__ == "__main__":
    main()
