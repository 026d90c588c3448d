"""`look --report` and `look --web`: every signal of a log over time, on a page of one file or of a server."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from canid.ui.cli.options import report_option, web_options
from canid.ui.cli.output import complete_files
from canid.ui.cli.signals import selection
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.errors import ConfigError

if TYPE_CHECKING:
    from canid.analysis.contents.binding import DbcFile
    from canid.analysis.contents.signal_lines import NamedLine
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle
    from canid.ui.cli.output.outputs import Output
    from canid.ui.views.signal_page.signal_page import SignalPage


def arguments(parser: argparse.ArgumentParser) -> None:
    """--report, --web, --vehicle."""
    report_option.add(parser, "write the signals over time as an HTML page")
    web_options.arguments(
        parser, "serve that page instead, which then shows every frame of the part that is zoomed to"
    )
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        help="on the page next to the signals the roles of this vehicle file, lead, learning gate and masks; its DBC files "
        "where --dbc names none",
    )


def signal_page(
    args: argparse.Namespace, log: Log, files: Sequence[DbcFile], vehicle: Vehicle | None
) -> SignalPage:
    """Read the log for the page. Raises ConfigError, LogError."""
    from canid.analysis.contents.log_marks import marks_of
    from canid.analysis.contents.signal_lines import lines_of_log
    from canid.ui.views.signal_page.signal_page import SignalPage

    for file in files:
        log.know(file.messages)
    with Progress(f"reading {args.log}") as bar:
        lines = lines_of_log(log, files, selection.wanted(args, log.buses), bar.to)
    if not lines:
        raise ConfigError(f"look: none of the DBC files' signals came in {args.log}: name others by --dbc")
    if vehicle is not None:
        lines = (*_roles(args, vehicle), *lines)
    times = [
        (float(line.t[0]), float(line.t[-1]))
        for line in (first.read() for first in _firsts(lines))
        if len(line.t)
    ]
    start, stop = min(a for a, _ in times), max(b for _, b in times)
    return SignalPage(os.path.basename(args.log), start, stop, lines, marks_of(args.log))


def _firsts(lines: Sequence[NamedLine]) -> list[NamedLine]:
    """One line of each group: those of a message have the same times, but for pages of multiplexed ones."""
    return list({line.group: line for line in reversed(lines)}.values())


def _roles(args: argparse.Namespace, vehicle: Vehicle) -> tuple[NamedLine, ...]:
    from canid.analysis.contents.role_lines import lines_of_trace
    from canid.ui.cli.inputs.reading import read_drive

    return lines_of_trace(read_drive(args.log, vehicle, args, estimating=False).trace)


def write(args: argparse.Namespace, report: Output, page: SignalPage, vehicle: Vehicle | None) -> None:
    """Write the page as one file. Raises ConfigError, OutputError."""
    from canid.ui.cli.command_line import PART, READ_BY, reproducing
    from canid.ui.cli.provenance import provenance
    from canid.ui.views.signal_page import signal_page

    options = (*READ_BY, "--dbc", "--bus", "--id", "--signals", *PART)
    made_from = provenance([args.log], vehicle, reproducing(args, "look", args.log, options=options))
    complete_files.write(report, lambda: signal_page.file(page, made_from))
    info(f"{report.path} written")


def serve(args: argparse.Namespace, page: SignalPage) -> None:
    """Serve the page until Ctrl-C. Raises ConfigError."""
    opened = web_options.access(args)
    assert opened is not None  # --web is given
    from canid.ui.web import address, signal_server

    sock, access = opened
    info(f"signals: {address.url(address.Address(access.host, access.port), access.token)}")
    info("Ctrl-C ends it")
    signal_server.run(page, access, sock)
