"""`canid record`: record a bus without loss. Listens only."""

from __future__ import annotations

import argparse
import time

from canid.cli import options, sessions


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="F.blf",
        help="default: the date and time; an existing file is never overwritten",
    )
    options.rotation(parser)
    sessions.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record."""
    rotation = options.rotation_of(args)
    # the files of a series carry the time themselves
    name = "canid.blf" if rotation else time.strftime("canid_%Y-%m-%d_%H-%M-%S.blf")
    return sessions.run(args, vehicle=None, record=args.output or name, rotation=rotation)
