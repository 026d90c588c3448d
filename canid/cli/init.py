"""`canid init FILE.dbc`: propose a vehicle file from a DBC."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

from canid.cli import options, output_kinds, outputs
from canid.cli.outputs import Output
from canid.cli.talk import talk, tell
from canid.errors import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("dbc", metavar="FILE.dbc", nargs="+", help="the vehicle's DBC files")
    parser.add_argument(
        "-o", "--output", metavar="V.toml", help="where to write it; default: standard output"
    )
    options.force(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Propose."""
    from canid.vehicle import propose
    from canid.views import as_json

    json = options.json_output(args)
    file = Output("-o", args.output, output_kinds.VEHICLE, replace=args.force) if args.output else None
    outputs.check([json, file], options.read_by(args))
    # paths in it are relative to where it will be; what is printed is redirected to a file here, if anywhere
    text = propose(args.dbc, Path(args.output).parent if args.output else ".")
    if file is not None:
        with outputs.opened_file(file) as written:
            written.write(text)
    elif args.json != "-":
        for line in text.splitlines():
            tell(line)
    with outputs.opened(json) as sink:
        if sink is not None:
            sink.write(as_json.line({"files": args.dbc, "proposed": tomllib.loads(text)}) + "\n")
    if args.output:
        talk(f"{args.output} written: read its comments, then `canid check --vehicle {args.output} LOG`")
    return DONE
