"""Who may see the page: Host and Origin of each request, the token of each websocket, and the headers of each answer.

The page's files are the same for everyone; all that is of a session comes over the websocket, which needs the token, on
loopback too: other users of the machine, and every page in the browser, can reach a loopback port. The token is behind
the "#" of the address that canid prints. The page keeps it in its tab's sessionStorage, which belongs to one port, and
sends it as a subprotocol of its websocket and nowhere else. There is no cookie: cookies belong to all ports of a host.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # the parent's side imports `Access`, and nothing of the server
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

# listening on all addresses: any of them may be asked for, but by number, or by this machine's name
WILDCARDS = ("0.0.0.0", "::", "")
FORBIDDEN = "403: open the address that canid has printed\n"
# the websocket's subprotocol, which a client offers with the token as a second one
PROTOCOL = "canid"


class Access(NamedTuple):
    """What is accepted."""

    host: str  # that the server listens on
    port: int
    token: str


def refusal(access: Access, scope: Scope) -> str:
    """Why a request is refused; "": it is not.

    Each alone refuses. Host: DNS rebinding. Origin: websockets and requests of other pages. Token: of websockets.
    """
    headers: list[tuple[bytes, bytes]] = scope["headers"]
    hosts, origins = _values(headers, b"host"), _values(headers, b"origin")
    if len(hosts) != 1 or not host_allowed(access, hosts[0]):
        return "host"
    # a browser sends an Origin with every websocket, and with no plain GET
    if origins != [f"http://{hosts[0]}"] and (origins or scope["type"] == "websocket"):
        return "origin"
    if scope["type"] != "websocket":
        return ""
    given: list[str] = scope["subprotocols"]
    # all are compared, each in constant time
    known = [
        hmac.compare_digest(protocol.encode("utf-8", "replace"), access.token.encode()) for protocol in given
    ]
    return "" if any(known) and PROTOCOL in given else "token"


def host_allowed(access: Access, header: str) -> bool:
    """Whether a Host header names this server.

    Example:
        >>> local = Access("127.0.0.1", 8090, "")
        >>> [host_allowed(local, name) for name in ("127.0.0.1:8090", "localhost:8090", "evil.example:8090")]
        [True, True, False]
        >>> everywhere = Access("0.0.0.0", 8090, "")
        >>> [host_allowed(everywhere, name) for name in ("192.168.1.7:8090", "evil.example:8090", "192.168.1.7")]
        [True, False, False]
        >>> [host_allowed(Access("::1", 80, ""), name) for name in ("[::1]", "[::1]:80", "[::1]:81")]
        [True, True, False]
    """
    header = header.lower()
    if access.port == 80 and not re.search(r":\d+$", header.rpartition("]")[2]):
        header += ":80"  # browsers leave it out
    name, _, port = header.rpartition(":")
    if port != str(access.port):
        return False
    try:
        ip = ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        ip = None
    if access.host in WILDCARDS:
        return ip is not None or name in ("localhost", socket.gethostname().lower())
    try:
        listens = ipaddress.ip_address(access.host)
    except ValueError:
        return name == access.host.lower() or (access.host == "localhost" and str(ip) == "127.0.0.1")
    return ip == listens or (listens.is_loopback and name == "localhost")


def _values(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in headers if key == name]


class Guard:
    """Middleware: refuses what `refusal` refuses with 403, and gives every answer its headers."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        """Stand in front of `app`."""
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request or websocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refused = refusal(self._access, scope)
        nonce = secrets.token_urlsafe(16)
        host = "" if refused else _values(scope["headers"], b"host")[0]
        extra = _headers(nonce, host)

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = [(key, value) for key, value in message.get("headers", [])]
                named = {key for key, _ in headers}
                message = {
                    **message,
                    "headers": headers + [header for header in extra if header[0] not in named],
                }
            await send(message)

        if not refused:
            scope["canid.nonce"] = nonce
            if scope["type"] == "websocket":
                scope["canid.known"]()
            await self._app(scope, receive, answer)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})  # before it was accepted: 403
        else:
            text = FORBIDDEN.encode()
            headers = [
                (b"content-type", b"text/plain; charset=utf-8"),
                (b"content-length", b"%d" % len(text)),
            ]
            await answer({"type": "http.response.start", "status": 403, "headers": headers})
            await answer({"type": "http.response.body", "body": b"" if scope["method"] == "HEAD" else text})


def _headers(nonce: str, host: str) -> list[tuple[bytes, bytes]]:
    # plotly makes two <style> elements; the page gives them the nonce. Nothing else inline is permitted
    policy = (
        f"default-src 'none'; script-src 'self'; style-src 'self' 'nonce-{nonce}'; img-src 'self' data:; "
        f"connect-src 'self'{f' ws://{host}' if host else ''}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return [
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"cache-control", b"no-store"),
        (b"connection", b"close"),  # a request a connection: see canid.ui.web.connections
    ]
