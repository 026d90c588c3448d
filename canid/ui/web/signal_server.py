"""The server of `canid look --web`: answers each question of the page with lines at the zoom that it asks for."""

from __future__ import annotations

import asyncio
import json
import math
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from canid.ui.views.document.templates import environment, file_text
from canid.ui.views.signal_page import signal_page, zoom
from canid.ui.views.signal_page.signal_page import Decoded, SignalPage
from canid.ui.web.access import PROTOCOL, Access, Guard
from canid.ui.web.connections import POLICY_VIOLATION
from canid.ui.web.serving import TYPES, plots, server_of

# lines of one question, and points of one line: more than a screen shows
MAX_LINES, MAX_POINTS = 64, 20_000
FILES = {
    "/signals.js": "signal_page/signals.js",
    "/signals.css": "signal_page/signals.css",
    "/page.css": "document/page.css",
}


def run(source: SignalPage, access: Access, sock: socket.socket) -> None:
    """Serve until Ctrl-C."""
    with suppress(KeyboardInterrupt):
        asyncio.run(server_of(application(source, access)).serve(sockets=[sock]))


def application(source: SignalPage, access: Access) -> Guard:
    """The page, its files, and the websocket that answers its questions."""
    route, plotly = plots()
    shell = environment().get_template("signal_page/shell.html.j2")
    answered = answers(source)

    async def page(request: Request) -> Response:
        text = shell.render(plotly=plotly, nonce=request.scope["canid.nonce"])
        return Response(text, media_type=TYPES[".html"])

    def file(path: str) -> Callable[[Request], Response]:
        kind = TYPES[path[path.rindex(".") :]]
        return lambda _: Response(str(file_text(path)), media_type=kind)

    async def signals(websocket: WebSocket) -> None:
        await websocket.accept(PROTOCOL)
        with suppress(WebSocketDisconnect):
            while True:
                answer = answered(await websocket.receive_text())
                if answer is None:
                    websocket.scope["canid.close"](POLICY_VIOLATION)
                    return
                await websocket.send_text(answer)

    files = [Route(address, file(path)) for address, path in FILES.items()]
    return Guard(
        Starlette(routes=[Route("/", page), route, *files, WebSocketRoute("/signals", signals)]), access
    )


def answers(source: SignalPage) -> Callable[[str], str | None]:
    """What answers a question of the page, in JSON; None for what is no question of it.

    Example:
        >>> answer = answers(SignalPage("a.blf", 0.0, 1.0, ()))
        >>> answer('{"id": 1, "do": "readings", "lines": [], "t": 0.5}'), answer('{"do": "stop"}')
        ('{"id":1,"answer":[]}', None)
    """
    decoded = Decoded(source.lines)

    def answer(text: str) -> str | None:
        try:
            question = json.loads(text)
        except (ValueError, RecursionError):
            return None
        if not isinstance(question, dict) or not isinstance(question.get("id"), int):
            return None
        given = _answer(question, source, decoded)
        if given is None:
            return None
        shown = {"id": question["id"], "answer": given}
        return json.dumps(shown, ensure_ascii=False, allow_nan=False, separators=(",", ":"))

    return answer


def _answer(question: dict[str, Any], source: SignalPage, decoded: Decoded) -> Any:
    match question.get("do"):
        case "listing":
            return signal_page.listing(source, decoded)
        case "pieces":
            begin, end, points = (_number(question.get(name)) for name in ("begin", "end", "points"))
            ks = _known(question.get("lines"), len(source.lines))
            if ks is None or begin is None or end is None or points is None:
                return None
            most = int(min(points, MAX_POINTS))
            return [zoom.piece(decoded.line(k), begin, end, most)._asdict() for k in ks]
        case "readings":
            t, ks = _number(question.get("t")), _known(question.get("lines"), len(source.lines))
            if ks is None or t is None:
                return None
            readings = [zoom.reading(decoded.line(k), t) for k in ks]
            return [reading[0] if reading else None for reading in readings]
        case _:
            return None


def _known(ks: Any, count: int) -> list[int] | None:
    """Numbers of lines; None where one of them is none."""
    if not isinstance(ks, list) or len(ks) > MAX_LINES:
        return None
    return ks if all(isinstance(k, int) and 0 <= k < count for k in ks) else None


def _number(x: Any) -> float | None:
    """A number of a question; None where it is none."""
    known = isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e12
    return float(x) if known and math.isfinite(x) else None
