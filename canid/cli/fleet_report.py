"""`canid fleet report DIR -o FILE.html`: one page on a fleet."""

from __future__ import annotations

import argparse
import shlex
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, print_line
from canid.cli.output.outputs import Output
from canid.cli.report_option import PAGE_SUFFIXES
from canid.errors import DONE, ConfigError

if TYPE_CHECKING:
    from canid.findings import Provenance


# characters of a line
WIDTH = 80


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", metavar="DIR", help="folder of canid fleet")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE.html",
        help="the page; replaces an earlier one; default: the answer as text alone",
    )


def run(args: argparse.Namespace) -> int:
    """Summarise, show the answer, write the page."""
    from canid.fleet.database import is_folder, not_a_folder
    from canid.fleet.summary import summarise
    from canid.views.fleet_report.fleet_page import page

    if not is_folder(args.folder):
        raise not_a_folder(args.folder)
    written = None
    if args.output is not None:
        if Path(args.output).suffix.lower() not in PAGE_SUFFIXES:
            raise ConfigError(f"fleet report: -o {args.output} is not an .html file")
        written = Output("-o", args.output, output_kinds.report_page("fleet"))
        outputs.check([written], sorted(Path(args.folder).glob("*.parquet")))
    found = summarise(args.folder)
    print_line(found.verdict)
    for sentence in found.sentences:
        for line in textwrap.wrap(sentence, WIDTH, initial_indent="  ", subsequent_indent="    "):
            print_line(line)
    with outputs.opened(written) as file:
        if file is not None:
            file.write(page(found, _provenance(args, found.counts.logs)))
            info(f"{args.output} written")
    return DONE


def command(args: argparse.Namespace) -> str:
    """The command that gives the same page.

    Example:
        >>> command(argparse.Namespace(folder="my fleet", output="a.html"))
        "canid fleet report 'my fleet' -o a.html"
    """
    words = ["canid", "fleet", "report", args.folder]
    return shlex.join([*words, *(["-o", args.output] if args.output else [])])


def _provenance(args: argparse.Namespace, logs: int) -> Provenance:
    from canid.cli.provenance import sha256, versions
    from canid.findings import Provenance

    before = _analysis(args.folder)
    return Provenance(
        log=f"{logs:,} logs, listed in logs.parquet",
        log_sha256=sha256(Path(args.folder) / "logs.parquet"),
        command=f"{before}; {command(args)}" if before else command(args),
        versions=versions(),
    )


def _analysis(folder: str) -> str:
    """The command of the analysis, as the folder has it; "": not known."""
    import json

    try:
        noted = json.loads((Path(folder) / "fleet.json").read_text("utf-8"))
        return str(noted["command"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
