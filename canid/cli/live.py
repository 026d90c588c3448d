"""`canid live`: record a bus and tell live how the driver drives. Listens only."""

from __future__ import annotations

import argparse

from canid.cli import options, sessions


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    options.vehicle(parser)
    parser.add_argument(
        "--record", metavar="F.blf", help="record to this file; an existing one is never overwritten"
    )
    options.state(parser)
    sessions.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record and estimate."""
    return sessions.run(args, vehicle=args.vehicle, record=args.record, state=args.state)
