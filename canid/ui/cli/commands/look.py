"""`canid look LOG`: what a log contains, without a vehicle file; with DBC files their signals over time."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.ui.cli.inputs.reading import report_log
from canid.ui.cli.options import options, report_option
from canid.ui.cli.output import complete_files, outputs
from canid.ui.cli.signals import look_page, selection
from canid.ui.terminal.messages import info, line_printer
from canid.ui.terminal.progress import Progress, is_terminal
from canid.values.errors import DAMAGED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.analysis.contents.binding import DbcFile
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle
    from canid.ui.cli.output.outputs import Output
    from canid.ui.views.look_text import Head
    from canid.values.log_contents import LogContents


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.ui.views.look_text import MAX_ROWS, SORTS

    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.time_zone(parser)
    selection.arguments(parser)
    parser.add_argument("--sort", choices=SORTS, default="id", help="order of the rows; default: id")
    parser.add_argument(
        "--all",
        action="store_true",
        help=f"all rows, not the first {MAX_ROWS}; constant signals and counters too",
    )
    options.part(parser)
    look_page.arguments(parser)
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.ui.views.look_json import Look

    return {"look": Look}


def run(args: argparse.Namespace) -> int:
    """Read once, show."""
    from canid.io.logs import open_log
    from canid.ui.cli.inputs.reading import read_vehicle

    json, report = options.json_output(args), report_option.output(args, "look")
    on_page = report is not None or args.web is not None
    if args.vehicle and not on_page:
        raise ConfigError("--vehicle shows its roles on the page: add --web or --report")
    if args.web is not None and (json is not None or report is not None):
        raise ConfigError(
            "look: --web shows the page alone; for --json and --report run it again without --web"
        )
    vehicle = read_vehicle(args.vehicle) if args.vehicle else None
    named = [selection.bound(name) for name in args.dbc]
    if not named and vehicle is not None:
        named = [(name, None) for name in vehicle.dbc]
    args.dbc = [name for name, _ in named]
    if not named and (args.signals is not None or on_page):
        option = "--signals" if args.signals is not None else "the page"
        raise ConfigError(f"look: {option} shows signals of DBC files: name them by --dbc")
    outputs.check([json, report], options.read_by(args))
    log = open_log(args.log)
    files = selection.read_files(named, log.buses)
    for file in files:
        log.know(file.messages)
    if args.web is not None:
        look_page.serve(args, look_page.signal_page(args, log, files, vehicle))
        return DAMAGED if log.damage else DONE
    return _shown(args, log, files, json, report, vehicle)


def _shown(
    args: argparse.Namespace,
    log: Log,
    files: list[DbcFile],
    json: Output | None,
    report: Output | None,
    vehicle: Vehicle | None,
) -> int:
    """Print what the log contains, and write the files that were asked for; returns the exit code."""
    from canid.analysis.contents import survey
    from canid.io.logs import open_log
    from canid.ui.views import look_json, look_text
    from canid.values.text import json_values

    with Progress(f"reading {args.log}") as bar:
        contents = survey(log, files, selection.wanted(args, log.buses), bar.to)
    if not contents.frames and (log.damage or not options.window(args).is_whole):
        from canid.analysis.drive.drive_reader import (
            nothing_read,  # not at the start: it takes as long as half of a log
        )

        raise nothing_read(args.log, options.window(args), log.damage)
    if args.signals is not None:
        only = {(signal.bus, signal.id) for signal in contents.signals}
        contents = contents._replace(messages=tuple(m for m in contents.messages if (m.bus, m.id) in only))
    head = head_of(log, args.log)
    print_line = line_printer(args.json)
    for line in look_text.lines(contents, head, width=width(), sort=args.sort, everything=args.all):
        print_line(line)
    command = following(args.log, args.dbc)
    print_line("")
    print_line(f"next: {command}")
    complete_files.write(
        json,
        lambda: json_values.document("look", look_json.document(contents, head, log.remarks, command)) + "\n",
    )
    say_nothing_found(args, contents)
    if report is not None:
        look_page.write(
            args, report, look_page.signal_page(args, open_log(args.log), files, vehicle), vehicle
        )
    report_log(log)
    return DAMAGED if log.damage else DONE


def head_of(log: Log, path: str) -> Head:
    """What is known of a log apart from its frames, once it was read."""
    from canid.io.logs import formats
    from canid.ui.views.look_text import Head

    suffix = formats.log_suffix(Path(path)).removeprefix(".")
    return Head(path, suffix, log.start_utc, log.damage.says if log.damage else "", dict(log.buses))


def width() -> int:
    """Characters of a line: of the terminal, or as many as a page takes."""
    from canid.ui.views.look_text import PLAIN_WIDTH

    return shutil.get_terminal_size().columns if is_terminal(sys.stdout) else PLAIN_WIDTH


def following(log: str, dbc: list[str]) -> str:
    """The next command.

    Example:
        >>> following("drive 7.blf", ["car.dbc"]), following("a.asc", [])
        ("canid init car.dbc --log 'drive 7.blf'", 'canid look a.asc --dbc FILE.dbc')
    """
    words = ["canid", "init", *dbc, "--log", log] if dbc else ["canid", "look", log, "--dbc", "FILE.dbc"]
    return shlex.join(words)


def say_nothing_found(args: argparse.Namespace, contents: LogContents) -> None:
    """Say why there are no rows."""
    if args.signals is not None and not contents.signals:
        info(f"no signal of these DBC files that came is called {args.signals}")
    elif not contents.frames:
        info(f"{args.log} holds no frames")
    elif contents.frames == sum(bus.errors for bus in contents.buses):
        from canid.analysis.drive.drive_reader import errors_alone

        info(errors_alone(args.log))
    elif not contents.messages:
        info("no frame has such a bus and id")
    for database in contents.databases:
        if not database.found:
            info(f"{database.file}: none of its messages came: is it of another vehicle or bus?")
