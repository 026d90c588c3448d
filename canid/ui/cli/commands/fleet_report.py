"""`canid fleet report DIR -o FILE.html`: one page on a fleet."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from canid.ui.cli.command_line import reproducing
from canid.ui.cli.options.report_option import page_name
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, print_line
from canid.values.errors import DONE

if TYPE_CHECKING:
    from canid.values.findings import Provenance
    from canid.values.fleet_summary import FleetSummary


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
    from canid.analysis.fleet.answers.summary import summarise
    from canid.analysis.fleet.storage import mirror
    from canid.analysis.fleet.storage.generations import is_folder, not_a_folder
    from canid.ui.views.fleet_report.fleet_document import page, text

    folder = mirror.local(args.folder)
    if not is_folder(folder):
        raise not_a_folder(args.folder)
    written = None
    if args.output is not None:
        name = page_name("fleet report", args.output, None, option="-o")
        written = Output("-o", name, output_kinds.report_page("fleet"))
        outputs.check([written], sorted(Path(folder).glob("*.parquet")))
    summary = summarise(folder)
    for line in text(summary):
        print_line(line)
    complete_files.write(written, lambda: page(summary, _provenance(args, folder, summary)))
    if written is not None:
        info(f"{args.output} written")
    return DONE


def _provenance(args: argparse.Namespace, folder: str, summary: FleetSummary) -> Provenance:
    from canid.ui.cli.provenance import versions
    from canid.values.findings import Provenance

    before = _analysis(folder)
    command = reproducing(args, "fleet report", args.folder, options=("-o",))
    return Provenance(
        log=f"{summary.counts.logs:,} logs of {args.folder}, listed in logs.parquet",
        # as it was when it was read: a run may have replaced it since
        log_sha256=summary.logs_sha256,
        command=f"{before}; {command}" if before else command,
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
