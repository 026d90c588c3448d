"""--web and --web-token, and the live page that they open."""

from __future__ import annotations

import argparse
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from canid.io.recording.controls import Controls
from canid.ui.cli.options import options
from canid.ui.cli.output.live_display import MESSAGE
from canid.ui.terminal.messages import info
from canid.ui.web import address
from canid.values.errors import ConfigError
from canid.values.types import Event

if TYPE_CHECKING:
    import socket

    from canid.signals.vehicle import Vehicle
    from canid.ui.web.access import Access
    from canid.ui.web.live_page import LivePage

# what the server imports; the extra `web` installs them
PACKAGES = ("starlette", "uvicorn", "websockets", "plotly")
# characters of a token that is given: short ones can be guessed
MIN_TOKEN_LENGTH = 16
# bytes of a token that is generated
TOKEN_BYTES = 16
# the token, for those who do not want it in the list of processes
VARIABLE = "CANID_WEB_TOKEN"


def arguments(parser: argparse.ArgumentParser, what: str = "serve a live page") -> None:
    """Declare the options; `what` --web does."""
    parser.add_argument(
        "--web",
        nargs="?",
        const="",
        metavar="HOST:PORT",
        help=f"{what}; default: {address.DEFAULT_HOST}:{address.DEFAULT_PORT}, or the next free port",
    )
    parser.add_argument(
        "--web-token",
        metavar="TOKEN",
        help=f"token of the page, at least {MIN_TOKEN_LENGTH} characters; other hosts than loopback need it; "
        f"default: {VARIABLE}, or a generated one",
    )


def session_page(
    args: argparse.Namespace, controls: Controls, *, live: bool
) -> AbstractContextManager[list[LivePage]]:
    """The page of a session on a bus; none without --web. `live`: it estimates. Raises ConfigError."""
    from canid.ui.web.requests import OF_SESSION

    file = (args.record if live else args.output) or ""
    start = {
        "mode": "live" if live else "record",
        "title": os.path.basename(file),
        "vehicle": args.vehicle if live else "",
    }
    return _opened(args, start, controls, OF_SESSION)


def replay_page(
    args: argparse.Namespace, log: str, vehicle: Vehicle, controls: Controls
) -> AbstractContextManager[list[LivePage]]:
    """The page of a replay; none without --web. Raises ConfigError."""
    from canid.ui.web.requests import OF_REPLAY

    start = {"mode": "replay", "title": log, "vehicle": vehicle.name, "start": options.window(args).begin}
    return _opened(args, start, controls, OF_REPLAY)


@contextmanager
def _opened(
    args: argparse.Namespace, start: dict[str, Any], controls: Controls, allowed: tuple[str, ...]
) -> Iterator[list[LivePage]]:
    opened = access(args)
    if opened is None:
        yield []
        return
    from canid.ui.web.live_page import LivePage
    from canid.values.roles import ROLES
    from canid.values.text.numbers import role_unit

    sock, given = opened
    start = {**start, "units": {role: role_unit(role) for role in ROLES}}
    with closing(
        LivePage(sock, given, start, controls, allowed, info, waits=start["mode"] == "replay")
    ) as page:
        info(f"live page: {page.url}")
        yield [page]


def access(args: argparse.Namespace) -> tuple[socket.socket, Access] | None:
    """The listening socket of --web, and what its server accepts; None without --web. Raises ConfigError."""
    if args.web is None:
        if args.web_token is not None:
            raise ConfigError("--web-token needs --web")
        return None
    absent = [name for name in PACKAGES if find_spec(name) is None]
    if absent:
        raise ConfigError(f"--web needs {', '.join(absent)}: pip install 'canid[web]'")
    where = address.parse(args.web)
    token = given_token(args.web_token)
    if not token and not address.is_loopback(where.host):
        raise ConfigError(
            f"--web {where.host}: others can reach it, so it needs a token: add --web-token TOKEN or set {VARIABLE}"
        )
    token = token or secrets.token_urlsafe(TOKEN_BYTES)
    from canid.ui.web.access import Access

    sock, where = address.listening(where)
    return sock, Access(where.host, where.port, token)


def announced(pages: Sequence[LivePage]) -> tuple[Event, ...]:
    """The page's address as a message of the terminal view, which hides what was printed before."""
    return tuple(Event(0.0, MESSAGE, f"live page: {page.url}") for page in pages)


def given_token(option: str | None) -> str:
    """The token of the option or the environment; "": none. Raises ConfigError where it is too short or no token."""
    token = option if option is not None else os.environ.get(VARIABLE, "")
    if option is None and not token:
        return ""
    if len(token) < MIN_TOKEN_LENGTH or not all(c.isascii() and (c.isalnum() or c in "-_.~") for c in token):
        raise ConfigError(
            f"--web-token: at least {MIN_TOKEN_LENGTH} characters of A-Z a-z 0-9 - _ . ~ "
            '(such as `python -c "import secrets; print(secrets.token_urlsafe())"` makes)'
        )
    return token
