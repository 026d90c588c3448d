"""Who may see the page: what has a foreign Host or Origin, and every websocket without the token, is refused with 403."""

from __future__ import annotations

import socket
from collections.abc import Callable

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from canid.ui.web.requests import MAX_MESSAGE_BYTES
from tests.web.conftest import Page, client

WEBSOCKET = {
    "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}  # fmt: skip


def answer(page: Page, path: str, headers: dict[str, str], method: str = "GET") -> tuple[int, dict[str, str]]:
    """Status and headers of the answer to exactly these headers."""
    with socket.create_connection(("127.0.0.1", page.port), timeout=30) as sock:
        lines = [
            f"{method} {path} HTTP/1.1",
            *(f"{name}: {value}" for name, value in headers.items() if value),
        ]
        sock.sendall("\r\n".join([*lines, "", ""]).encode())
        data = b""
        while b"\r\n\r\n" not in data:
            more = sock.recv(65536)
            if not more:
                break
            data += more
    head = data.partition(b"\r\n\r\n")[0].decode("latin-1").split("\r\n")
    return int(head[0].split()[1]), {
        line.partition(":")[0].lower(): line.partition(":")[2].strip() for line in head[1:]
    }


def until_closed(own: ClientConnection) -> None:
    while True:
        own.recv(timeout=30)


# what is changed of a good request: name, and a function of the page that gives the value
FOREIGN: dict[str, tuple[str, Callable[[Page], str]]] = {
    "another name": ("Host", lambda page: f"evil.example:{page.port}"),
    "another port": ("Host", lambda page: "127.0.0.1:1"),
    "no port": ("Host", lambda page: "127.0.0.1"),
    "another address": ("Host", lambda page: f"192.0.2.1:{page.port}"),
    "another origin": ("Origin", lambda page: "http://evil.example"),
    "an origin of another port": ("Origin", lambda page: "http://127.0.0.1:1"),
    "a null origin": ("Origin", lambda page: "null"),
    "an encrypted origin": ("Origin", lambda page: f"https://127.0.0.1:{page.port}"),
}
# the subprotocols of a websocket
UNKNOWN: dict[str, Callable[[Page], str]] = {
    "no token": lambda page: "canid",
    "nothing": lambda page: "",
    "a wrong token": lambda page: f"canid, {page.token[:-1]}",
    "a longer token": lambda page: f"canid, {page.token}x",
    "the token in capitals": lambda page: f"canid, {page.token.swapcase()}",
    "the token alone": lambda page: page.token,
}


def good(page: Page) -> dict[str, str]:
    here = f"127.0.0.1:{page.port}"
    return {"Host": here, "Origin": f"http://{here}", "Sec-WebSocket-Protocol": f"canid, {page.token}"}


@pytest.mark.parametrize("what", FOREIGN)
def test_what_is_foreign_is_refused(what: str, served: Page) -> None:
    """Each change alone gives 403, on the page, on its files and on the websocket; without it they answer."""
    name, value = FOREIGN[what]
    headers = good(served) | {name: value(served)}
    for path in ("/", "/page.js", "/plotly.min.js"):
        assert answer(served, path, headers)[0] == 403
        assert answer(served, path, good(served))[0] == 200
    assert answer(served, "/live", headers | WEBSOCKET)[0] == 403
    assert answer(served, "/live", good(served) | WEBSOCKET)[0] == 101


def test_a_websocket_without_an_origin_is_refused(served: Page) -> None:
    """No browser leaves it out; a page may be asked for without one."""
    headers = good(served) | {"Origin": ""}
    assert answer(served, "/live", headers | WEBSOCKET)[0] == 403
    assert answer(served, "/", headers)[0] == 200


@pytest.mark.parametrize("what", UNKNOWN)
def test_a_websocket_without_the_token_is_refused(what: str, served: Page) -> None:
    """Nothing but the token among its subprotocols opens it, no address and no cookie; the token is never sent back."""
    headers = good(served) | {"Sec-WebSocket-Protocol": UNKNOWN[what](served)} | WEBSOCKET
    assert answer(served, "/live", headers)[0] == 403
    assert answer(served, f"/live?token={served.token}", headers)[0] == 403
    assert answer(served, "/live", headers | {"Cookie": f"canid_{served.port}={served.token}"})[0] == 403
    status, given = answer(served, "/live", good(served) | WEBSOCKET)
    assert status == 101
    assert given["sec-websocket-protocol"] == "canid"


def test_the_files_hold_nothing_of_a_session(served: Page) -> None:
    """They are given without a token, and are those of the package; no answer sets a cookie or has the token in it."""
    host = {"Host": f"localhost:{served.port}"}
    for path in ("/", "/page.js", "/live", "/nothing", f"/?token={served.token}"):
        with socket.create_connection(("127.0.0.1", served.port), timeout=30) as sock:
            lines = [f"GET {path} HTTP/1.1", *(f"{name}: {value}" for name, value in host.items())]
            sock.sendall("\r\n".join([*lines, "", ""]).encode())
            data = b"".join(iter(lambda sock=sock: sock.recv(65536), b""))  # type: ignore[misc]
        assert data.startswith(b"HTTP/1.1 404" if path in ("/live", "/nothing") else b"HTTP/1.1 200"), path
        assert b"set-cookie" not in data.lower()
        assert served.token.encode() not in data


def test_every_answer_has_strict_headers(served: Page) -> None:
    """No script but the page's own, no frame around it, no type guessed, and only plotly is kept by the browser."""
    for path in ("/", "/page.js", "/nothing", "/plotly.min.js"):
        headers = answer(served, path, good(served))[1]
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "server" not in headers
        assert ("immutable" in headers["cache-control"]) == (path == "/plotly.min.js")
        assert ("no-store" in headers["cache-control"]) == (path != "/plotly.min.js")
    assert answer(served, "/", good(served), "POST")[0] == 405
    assert answer(served, "/../server.py", good(served))[0] == 404
    assert answer(served, "/%2e%2e%2fserver.py", good(served))[0] == 404


@pytest.mark.parametrize(
    "text",
    [
        "x" * (MAX_MESSAGE_BYTES + 1),
        "not JSON",
        "[" * 4000,
        '{"do": "stop"}',
        '{"do": "seek", "t": 1}',  # of a replay
        '{"do": "mark", "text": 7}',
        '{"do": ["mark"]}',
    ],
)
def test_what_is_no_request_ends_the_websocket(text: str, served: Page) -> None:
    """Too long, not JSON, too deep, unknown, of another mode, of another type: closed; the server goes on."""
    with client(served) as own:
        own.send(text)
        with pytest.raises(ConnectionClosed) as closed:
            until_closed(own)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code in (1008, 1009)
    assert answer(served, "/", good(served))[0] == 200
