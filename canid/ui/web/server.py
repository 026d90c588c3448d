"""The web server of the live page, the child process: messages in on standard input, requests out on standard output.

Standard output takes one request a line. It never blocks: what the parent does not read is dropped. Before it takes the
first connection it gives up its rights to write, connect, start and signal anything (`confinement`).
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from canid.ui.web.access import Access, Guard
from canid.ui.web.hub import Hub
from canid.ui.web.serving import TYPES, plots, server_of
from canid.values.processes.confinement import confine
from canid.values.processes.kept_rights import Kept
from canid.values.processes.serve import connect

PAGE = Path(__file__).parent / "page"
# below everything that records or estimates
NICENESS = 5
# handfuls of messages that wait for the event loop; then the pipe fills, and the parent drops
WAITING_READS = 8
READ_BYTES = 1 << 16
# s for the last message to leave
LAST_WORDS_S = 0.1


def application(hub: Hub, access: Access) -> Guard:
    """The pages and the websocket."""
    files = {path.name: path.read_bytes() for path in sorted(PAGE.iterdir()) if path.suffix in TYPES}
    index = files.pop("index.html").decode()
    route, plotly = plots()
    index = index.replace("{plotly}", plotly)

    async def page(request: Request) -> Response:
        text = index.replace("{nonce}", request.scope["canid.nonce"])
        return Response(text, media_type="text/html")

    async def file(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in files:
            return Response("404: no such file\n", 404, media_type="text/plain")
        return Response(files[name], media_type=TYPES[Path(name).suffix])

    async def live(websocket: WebSocket) -> None:
        await hub.serve(websocket)

    routes = [
        Route("/", page),
        route,
        WebSocketRoute("/live", live),
        Route("/{name}", file),
    ]
    return Guard(Starlette(routes=routes), access)


async def serve(config: dict[str, Any], sock: socket.socket, answers: int) -> None:
    """Serve until standard input ends; requests of the pages go to the descriptor `answers`."""
    loop = asyncio.get_running_loop()
    os.set_blocking(answers, False)

    def request(value: dict[str, Any]) -> None:
        with suppress(OSError):
            os.write(answers, json.dumps(value).encode() + b"\n")

    hub = Hub(tuple(config["allowed"]), request)
    app = application(hub, Access(config["host"], config["port"], config["token"]))
    server = server_of(app)
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

    # the loop has its own sockets, and no thread has been started
    confine(Kept(connections=True))
    threading.Thread(target=read, daemon=True).start()
    await server.serve(sockets=[sock])


def main() -> None:
    """Read the configuration, the first line, and serve."""
    parent = connect()
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
    asyncio.run(serve(config, sock, parent.sink.fileno()))


if __name__ == "__main__":
    main()
