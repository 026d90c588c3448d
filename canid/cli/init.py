"""`canid init FILE.dbc...`: propose a vehicle file from DBC files."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

from canid.cli import options
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, print_line
from canid.cli.output.outputs import Output
from canid.errors import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("dbc", metavar="FILE.dbc", nargs="+", help="the vehicle's DBC files")
    parser.add_argument(
        "-o", "--output", metavar="V.toml", help="vehicle file to write; default: standard output"
    )
    options.force(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Propose."""
    from canid.proposal import propose
    from canid.views import json_values

    json = options.json_output(args)
    file = Output("-o", args.output, output_kinds.VEHICLE_FILE, replace=args.force) if args.output else None
    outputs.check([json, file], options.read_by(args))
    # paths in it are relative to its own folder; printed, to the current one
    text = propose(args.dbc, Path(args.output).parent if args.output else ".")
    if file is not None:
        with outputs.opened_file(file) as written:
            written.write(text)
    elif args.json != "-":
        for line in text.splitlines():
            print_line(line)
    with outputs.opened(json) as sink:
        if sink is not None:
            sink.write(json_values.line({"files": args.dbc, "proposed": tomllib.loads(text)}) + "\n")
    if args.output:
        info(f"{args.output} written: read its comments, then run `canid check --vehicle {args.output} LOG`")
    return DONE
