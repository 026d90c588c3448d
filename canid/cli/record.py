"""`canid record`: record a bus without loss. Listens only."""

from __future__ import annotations

import argparse
import time

from canid.cli import sessions


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="F.blf",
        help="default: the date and time; an existing file is never overwritten",
    )
    sessions.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record."""
    return sessions.run(
        args, vehicle=None, record=args.output or time.strftime("canid_%Y-%m-%d_%H-%M-%S.blf")
    )
