"""--publish of `live`, `record` and `replay`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from canid.io.publishing import udp_address
from canid.ui.terminal.messages import info

if TYPE_CHECKING:
    from canid.io.publishing.udp_publisher import UdpPublisher


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument(
        "--publish",
        action="append",
        default=[],
        metavar="udp://HOST:PORT",
        help="send samples, estimates and health as JSON datagrams, such as to PlotJuggler (docs/publish.md)",
    )


def check(args: argparse.Namespace) -> None:
    """Check the destinations. Raises ConfigError."""
    for url in args.publish:
        udp_address.parse(url)


def publishers(args: argparse.Namespace, start_ns: int | None = None) -> list[UdpPublisher]:
    """One for each destination, running. `start_ns`: epoch ns of t = 0; None: comes with the status. Raises ConfigError."""
    destinations = [udp_address.parse(url) for url in args.publish]
    if not destinations:
        return []
    from canid.io.publishing.udp_publisher import UdpPublisher

    return [UdpPublisher(destination, info, start_ns) for destination in destinations]
