"""Addresses that the live page is served on: parsing HOST:PORT, loopback or not, and the listening socket."""

from __future__ import annotations

import errno
import ipaddress
import os
import re
import socket
from typing import NamedTuple

from canid.values.errors import ConfigError

DEFAULT_HOST = "127.0.0.1"
# 8080 is taken on many machines
DEFAULT_PORT = 8090
# ports that are tried, from the one that was asked for
TRIED_PORTS = 20
# connections that wait until the server has started
BACKLOG = 128


class Address(NamedTuple):
    """Where to listen."""

    host: str  # name or IP address, IPv6 without brackets
    port: int


def parse(text: str) -> Address:
    """HOST:PORT, HOST, :PORT, PORT or nothing at all.

    Raises ConfigError where it is none of these.

    Example:
        >>> parse(""), parse("9000"), parse("[::1]:9000")
        (Address(host='127.0.0.1', port=8090), Address(host='127.0.0.1', port=9000), Address(host='::1', port=9000))
    """
    host, port = text, ""
    if text.isdecimal():
        host, port = "", text
    elif match := re.fullmatch(r"\[([0-9a-fA-F:.]+)\](?::(\d+))?", text):
        host, port = match[1], match[2] or ""
    elif text.count(":") == 1:
        host, _, port = text.partition(":")
    number = int(port) if re.fullmatch(r"[0-9]{1,5}", port) else DEFAULT_PORT if not port else 0
    if not re.fullmatch(r"[A-Za-z0-9.:-]*", host) or not 0 < number < 65536 or os.path.exists(text):
        hint = "; it is a file: put it before --web" if os.path.exists(text) else ""
        raise ConfigError(f'--web: "{text}" is not HOST:PORT, such as {DEFAULT_HOST}:{DEFAULT_PORT}{hint}')
    return Address(host or DEFAULT_HOST, number)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach it.

    Example:
        >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("localhost"), is_loopback("0.0.0.0")
        (True, True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def listening(address: Address) -> tuple[socket.socket, Address]:
    """A listening socket on the first free port from `address.port` on, and where it listens.

    Raises ConfigError where there is no such host on this machine, or no free port.
    """
    host = DEFAULT_HOST if address.host == "localhost" else address.host
    last = min(address.port + TRIED_PORTS, 65536)
    for port in range(address.port, last):
        try:
            family, kind, protocol, _, where = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            sock = socket.socket(family, kind, protocol)
        except (OSError, UnicodeError) as error:
            raise ConfigError(f"--web: no host {address.host}: {_why(error)}") from None
        try:
            if os.name == "posix":  # a port whose last connections have just ended is free
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(where)
            sock.listen(BACKLOG)
        except OSError as error:
            sock.close()
            if error.errno in (errno.EADDRINUSE, errno.EACCES) and port + 1 < last:
                continue
            raise ConfigError(f"--web: cannot listen on {address.host}:{port}: {_why(error)}") from None
        return sock, Address(address.host, port)
    raise AssertionError("unreachable: the last port raises")


def url(address: Address, token: str) -> str:
    """The address of the page, with its token behind the "#", which no browser sends to a server.

    Example:
        >>> url(Address("::1", 8090), "abc")
        'http://[::1]:8090/#token=abc'
    """
    host = f"[{address.host}]" if ":" in address.host else address.host
    return f"http://{host}:{address.port}/#token={token}"


def _why(error: OSError | UnicodeError) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
