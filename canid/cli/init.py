"""`canid init FILE.dbc... [--log LOG]`: propose a vehicle file from DBC files and a drive."""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.cli import options
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, print_line
from canid.cli.output.outputs import Output
from canid.errors import DAMAGED, DONE

if TYPE_CHECKING:
    from canid.proposal import Proposal
    from canid.proposal.choice import Choice, Decision


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("dbc", metavar="FILE.dbc", nargs="+", help="the vehicle's DBC files")
    parser.add_argument(
        "--log",
        metavar="LOG",
        help="a drive of this vehicle: candidates are judged by what it shows (present, moving, range, agreement with "
        "each other), and buses, silent units and signs are found; the first 30 min are read",
    )
    parser.add_argument(
        "--yes",
        action="store_true",
        help="never ask: where two signals are close, the first is taken if it leads clearly or both are copies of one "
        "quantity; else the role stays open (so it is where standard input is not a terminal)",
    )
    parser.add_argument(
        "-o", "--output", metavar="V.toml", help="vehicle file to write; default: standard output"
    )
    options.force(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Propose."""
    from canid.cli.output.progress import Progress
    from canid.cli.signal_question import asked
    from canid.logs import open_log
    from canid.proposal import proposal
    from canid.views import json_values

    json = options.json_output(args)
    file = Output("-o", args.output, output_kinds.VEHICLE_FILE, replace=args.force) if args.output else None
    outputs.check([json, file], options.read_by(args))
    # paths in it are relative to its own folder; printed, to the current one
    home = Path(args.output).parent if args.output else Path(".")
    asking = not args.yes and sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
    log = open_log(args.log) if args.log else None
    bar = Progress(f"reading {args.log}") if log is not None and not asking else None
    try:
        made = proposal(
            args.dbc, home, log, ask=asked if asking else None, progress=bar.to if bar is not None else None
        )
    finally:
        if bar is not None:
            bar.__exit__()
    if file is not None:
        with outputs.opened_file(file) as written:
            written.write(made.text)
    elif args.json != "-":
        for line in made.text.splitlines():
            print_line(line)
    with outputs.opened(json) as sink:
        if sink is not None:
            sink.write(json_values.document("init", _values(args, made)) + "\n")
    _report(args, made)
    return DAMAGED if log is not None and log.damage else DONE


def _report(args: argparse.Namespace, made: Proposal) -> None:
    """Which roles are still to be filled in, and what to do next."""
    from canid.proposal.vehicle_text import missing

    for sentence in (*made.warnings, *missing(made.decisions)):
        info(sentence)
    if args.output:
        log = args.log or "LOG"
        info(
            f"{args.output} written: read its comments, then run `canid check --vehicle {args.output} {log}`"
        )


def _values(args: argparse.Namespace, made: Proposal) -> dict[str, Any]:
    from canid.proposal.vehicle_text import missing

    return {
        "files": args.dbc,
        "log": args.log,
        "proposed": tomllib.loads(made.text),
        "roles": {role: _role(decision) for role, decision in made.decisions.roles.items()},
        "tracks": made.decisions.tracks.pattern if made.decisions.tracks is not None else None,
        "missing": missing(made.decisions),
    }


def _role(decision: Decision) -> dict[str, Any]:
    found = ([decision.chosen] if decision.chosen is not None else []) + list(decision.others)
    return {
        "state": decision.state,
        "signal": decision.chosen.candidate.where if decision.chosen is not None else None,
        "candidates": [_candidate(choice) for choice in found[:10]],
        "not_in_log": list(decision.absent[:10]),
    }


def _candidate(choice: Choice) -> dict[str, Any]:
    return {
        "signal": choice.candidate.where,
        "score": choice.score,
        "unit": choice.candidate.unit or None,
        "bus": choice.candidate.bus,
        "says": list(choice.remarks),
    }
