"""`canid live`: record a bus, and estimate the driver's parameters live. Listens only."""

from __future__ import annotations

import argparse

from canid.analysis.session.session import SessionSettings
from canid.ui.cli import live_session
from canid.ui.cli.options import options, trigger_options
from canid.ui.cli.output import background_diagnosis
from canid.values.errors import ConfigError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    options.vehicle(parser)
    parser.add_argument(
        "--record", metavar="F.blf", help="record to this file; an existing file is never overwritten"
    )
    options.rotation(parser)
    trigger_options.arguments(parser)
    options.state(parser)
    live_session.arguments(parser)
    background_diagnosis.arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record and estimate."""
    rotation = options.rotation_of(args)
    if rotation is not None and args.record is None:
        raise ConfigError("live: --file-size and --file-time need a recording: add --record F.blf")
    if args.trigger and args.record is None:
        raise ConfigError("live: --trigger decides what is recorded: add --record F.blf")
    trigger = trigger_options.trigger_of(args)
    settings = SessionSettings(
        args.vehicle,
        args.record,
        args.duration,
        args.state,
        rotation,
        trigger=trigger,
        tables=args.web is not None,
    )
    return live_session.run(args, settings, background_diagnosis.output(args, "live", args.record))
