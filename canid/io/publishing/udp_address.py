"""Destinations of --publish: udp://host:port of one machine."""

from __future__ import annotations

import ipaddress
import socket
from typing import NamedTuple
from urllib.parse import urlsplit

from canid.values.errors import ConfigError


class Destination(NamedTuple):
    """A host and a port."""

    host: str
    port: int
    url: str


def parse(url: str) -> Destination:
    """Parse a destination; a host given as a number is checked at once.

    Raises:
        ConfigError: not udp://host:port, or not one machine.

    Example:
        >>> parse("udp://127.0.0.1:9870").port
        9870
        >>> parse("udp://224.0.0.1:9870")
        Traceback (most recent call last):
        canid.values.errors.ConfigError: --publish udp://224.0.0.1:9870: 224.0.0.1 is a multicast address; name one machine
    """
    shown = "".join(c if c.isprintable() else "?" for c in url)[:100]
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise ConfigError(f"--publish {shown}: {error}; write udp://127.0.0.1:9870") from None
    if parts.scheme != "udp" or not host or not port:
        raise ConfigError(f"--publish {shown}: write udp://HOST:PORT, such as udp://127.0.0.1:9870")
    if parts.path or parts.query or parts.fragment or parts.username is not None:
        raise ConfigError(f"--publish {shown}: nothing but host and port, such as udp://127.0.0.1:9870")
    destination = Destination(host, port, shown)
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return destination  # a name, which is resolved once, by the thread that publishes
    why = refused(address)
    if why:
        raise ConfigError(f"--publish {shown}: {why}")
    return destination


def refused(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> str:
    """Why nothing is sent there; "": it is one machine.

    >>> refused(ipaddress.ip_address("255.255.255.255"))
    '255.255.255.255 is the broadcast address; name one machine'
    """
    address = getattr(address, "ipv4_mapped", None) or address  # ::ffff:224.0.0.1
    if address.is_multicast:
        return f"{address} is a multicast address; name one machine"
    if address == ipaddress.ip_address("255.255.255.255"):
        return f"{address} is the broadcast address; name one machine"
    if address.is_unspecified:
        return f"{address} is no machine; this one is 127.0.0.1"
    return ""


def resolve(destination: Destination) -> tuple[socket.AddressFamily, tuple[object, ...]]:
    """Resolve a name, which may take long. Raises OSError with a sentence."""
    addresses = socket.getaddrinfo(destination.host, destination.port, type=socket.SOCK_DGRAM)
    family, _, _, _, address = addresses[0]
    why = refused(ipaddress.ip_address(str(address[0]).partition("%")[0]))
    if why:
        raise OSError(None, why)
    return family, address
