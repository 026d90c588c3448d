"""What both servers of pages have in common: uvicorn with the limits of strangers, and plotly.js."""

from __future__ import annotations

from functools import partial

import uvicorn
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from canid.ui.views.drawing.plotly_package import plotly_file
from canid.ui.web.access import Guard
from canid.ui.web.connections import HttpProtocol, Strangers, WebsocketProtocol
from canid.ui.web.requests import MAX_MESSAGE_BYTES

TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
# s between two signs of life of a client
PING_INTERVAL_S = 20.0
# s that open pages may hold up the end
END_S = 1


def server_of(app: Guard) -> uvicorn.Server:
    """A server that nobody can exhaust who does not know the token."""
    strangers = Strangers()
    # proxy_headers: nobody may say that he comes from elsewhere
    return uvicorn.Server(
        uvicorn.Config(
            app,
            http=partial(HttpProtocol, strangers),  # type: ignore[arg-type]
            ws=partial(WebsocketProtocol, strangers),  # type: ignore[arg-type]
            loop="asyncio",
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            ws_max_size=MAX_MESSAGE_BYTES,
            ws_per_message_deflate=False,
            ws_ping_interval=PING_INTERVAL_S,
            timeout_graceful_shutdown=END_S,
        )
    )


def plots() -> tuple[Route, str]:
    """The route of plotly.js, and its address: a new version has another one, the old one may stay in the browser."""
    plotly = plotly_file()
    assert plotly is not None  # `web_options` has asked for it

    async def answer(_: Request) -> Response:
        forever = {"Cache-Control": "private, max-age=31536000, immutable"}
        return FileResponse(plotly, media_type=TYPES[".js"], headers=forever)

    version = f"{plotly.stat().st_size:x}-{int(plotly.stat().st_mtime):x}"
    return Route("/plotly.min.js", answer), f"/plotly.min.js?v={version}"
