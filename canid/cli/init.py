"""`canid init FILE.dbc`: propose a vehicle file from a DBC."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options
from canid.errors import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("dbc", metavar="FILE.dbc")
    parser.add_argument("-o", "--output", metavar="V.toml", help="default: standard output")
    options.force(parser)


def run(args: argparse.Namespace) -> int:
    """Propose."""
    from canid.vehicle import propose

    text = propose(Path(args.dbc))
    with options.sink(args.output or "-", overwrite=args.force) as sink:
        assert sink is not None
        sink.write(text)
    if args.output:
        options.talk(
            f"{args.output} written: read its comments, then `canid check --vehicle {args.output} LOG`"
        )
    return DONE
