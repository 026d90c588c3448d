"""The option --report of identify, check and replay: its name, the kind of its file, and the command of its provenance."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from canid.cli import drive_source
from canid.cli.output import output_kinds
from canid.cli.output.outputs import Output
from canid.errors import ConfigError

# with any other suffix `--report LOG` (the name forgotten, the log taken for it) could write over a log
PAGE_SUFFIXES = (".html", ".htm")


def add(parser: argparse.ArgumentParser, what: str) -> None:
    """--report; an earlier page of the same verb is replaced."""
    parser.add_argument("--report", metavar="FILE.html", help=f"{what}; replaces an earlier page")


def output(args: argparse.Namespace, verb: str) -> Output | None:
    """The output of --report; None: not asked for.

    Raises:
        ConfigError: the name is not that of a page.

    Example:
        >>> output(argparse.Namespace(report="a.html"), "check").kind.name
        'a page of canid check'
    """
    if args.report is None:
        return None
    if Path(args.report).suffix.lower() not in PAGE_SUFFIXES:
        raise ConfigError(f"{verb}: --report {args.report} is not an .html file")
    return Output("--report", args.report, output_kinds.report_page(verb))


def command(args: argparse.Namespace, verb: str, *logs: str) -> str:
    """The command that gives the same numbers.

    Example:
        >>> command(argparse.Namespace(vehicle="generic", start=0.0, stop=60.0), "identify", "drive 7.blf")
        "canid identify 'drive 7.blf' --vehicle generic --stop 60"
    """
    words = ["canid", verb, *logs, *drive_source.words(args)]
    start, stop = getattr(args, "start", 0.0), getattr(args, "stop", float("inf"))
    words += ["--start", f"{start:g}"] if start > 0 else []
    words += ["--stop", f"{stop:g}"] if stop < float("inf") else []
    return shlex.join(words)
