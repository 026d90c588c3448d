"""`canid record`: record a bus without loss. Listens only."""

from __future__ import annotations

import argparse
import time
from typing import Any

from canid.analysis.session.session import SessionSettings
from canid.signals.triggers.trigger import needs_estimators
from canid.ui.cli import live_session
from canid.ui.cli.options import options, trigger_options
from canid.values.errors import ConfigError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="F.blf",
        help="record to this file; default: canid_DATE_TIME.blf; an existing file is never overwritten",
    )
    options.rotation(parser)
    trigger_options.arguments(parser)
    parser.add_argument("--vehicle", metavar="V.toml", help="vehicle file that maps the signals of --trigger")
    live_session.arguments(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"record": live_session.Recorded}


def run(args: argparse.Namespace) -> int:
    """Record."""
    rotation = options.rotation_of(args)
    trigger = trigger_options.trigger_of(args)
    if trigger is not None and needs_estimators(trigger):
        raise ConfigError("record: misfit and gain_step need the estimators: use `canid live --record F.blf`")
    if trigger is None and args.vehicle is not None:
        raise ConfigError("record: --vehicle belongs to --trigger; `canid live` estimates")
    # the names of a series contain the time
    name = "canid.blf" if rotation else time.strftime("canid_%Y-%m-%d_%H-%M-%S.blf")
    settings = SessionSettings(
        record=args.output or name,
        duration=args.duration,
        rotation=rotation,
        trigger=trigger,
        trigger_vehicle=args.vehicle,
    )
    return live_session.run(args, settings)
