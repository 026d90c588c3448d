"""`canid record`: record a bus without loss. Listens only."""

from __future__ import annotations

import argparse
import time

from canid.cli import live_session, options


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="F.blf",
        help="record to this file; default: canid_DATE_TIME.blf; an existing file is never overwritten",
    )
    options.rotation(parser)
    live_session.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record."""
    rotation = options.rotation_of(args)
    # the names of a series contain the time
    name = "canid.blf" if rotation else time.strftime("canid_%Y-%m-%d_%H-%M-%S.blf")
    return live_session.run(args, vehicle=None, record=args.output or name, rotation=rotation)
