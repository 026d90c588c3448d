"""`canid live`: record a bus and tell live how the driver drives. Listens only."""

from __future__ import annotations

import argparse

from canid.cli import options, sessions
from canid.errors import ConfigError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    options.vehicle(parser)
    parser.add_argument(
        "--record", metavar="F.blf", help="record to this file; an existing one is never overwritten"
    )
    options.rotation(parser)
    options.state(parser)
    sessions.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record and estimate."""
    rotation = options.rotation_of(args)
    if rotation is not None and args.record is None:
        raise ConfigError("live: --file-size and --file-time are about the recording: say --record F.blf")
    return sessions.run(args, vehicle=args.vehicle, record=args.record, state=args.state, rotation=rotation)
