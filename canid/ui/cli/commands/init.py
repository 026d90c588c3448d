"""`canid init FILE.dbc... [--log LOG]`: propose a vehicle file from DBC files and a drive."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, print_text
from canid.values.errors import DAMAGED, DONE

if TYPE_CHECKING:
    from canid.analysis.proposal import Proposal
    from canid.analysis.proposal.choice import Choice, Decision

# of a role, in JSON
MAX_CANDIDATES = 10


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
    options.time_zone(parser)
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"init": Proposed}


def run(args: argparse.Namespace) -> int:
    """Propose."""
    from canid.analysis.proposal import proposal
    from canid.io.logs import open_log
    from canid.ui.cli.inputs.signal_question import asked
    from canid.ui.terminal.progress import Progress
    from canid.values.text import json_values

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
    complete_files.write(file, lambda: made.text)
    if file is None and args.json != "-":
        print_text(made.text)
    complete_files.write(json, lambda: json_values.document("init", _document(args, made)) + "\n")
    _report(args, made)
    return DAMAGED if log is not None and log.damage else DONE


def _report(args: argparse.Namespace, made: Proposal) -> None:
    """Which roles are still to be filled in, and what to do next."""
    from canid.analysis.proposal.summary import summary
    from canid.analysis.proposal.vehicle_text import missing

    for sentence in (*made.warnings, *(summary if args.output else missing)(made.decisions)):
        info(sentence)
    if args.output:
        log = args.log or "LOG"
        info(
            f"{args.output} written: read its comments, then run `canid check --vehicle {args.output} {log}`"
        )


class ProposedSignal(NamedTuple):
    """A signal that may be a role's."""

    signal: str
    score: float
    unit: str | None
    bus: int | None
    says: tuple[str, ...]


class ProposedRole(NamedTuple):
    """What a role ends as."""

    state: str  # "sure", "close", "open"
    signal: str | None
    candidates: tuple[ProposedSignal, ...]  # the best
    not_in_log: tuple[str, ...]


class Proposed(NamedTuple):
    """The object of --json."""

    files: list[str]
    log: str | None
    proposed: dict[str, Any]  # the vehicle file
    roles: Mapping[str, ProposedRole]
    tracks: str | None
    missing: list[str]


def _document(args: argparse.Namespace, made: Proposal) -> Proposed:
    from canid.analysis.proposal.vehicle_text import missing

    tracks = made.decisions.tracks
    return Proposed(
        args.dbc,
        args.log,
        tomllib.loads(made.text),
        {role: _role(decision) for role, decision in made.decisions.roles.items()},
        tracks.pattern if tracks is not None else None,
        missing(made.decisions),
    )


def _role(decision: Decision) -> ProposedRole:
    chosen = decision.chosen
    best = [*([] if chosen is None else [chosen]), *decision.others][:MAX_CANDIDATES]
    signal = None if chosen is None else chosen.candidate.where
    return ProposedRole(
        decision.state, signal, tuple(map(_signal, best)), tuple(decision.absent[:MAX_CANDIDATES])
    )


def _signal(choice: Choice) -> ProposedSignal:
    candidate = choice.candidate
    return ProposedSignal(
        candidate.where, choice.score, candidate.unit or None, candidate.bus, tuple(choice.remarks)
    )
