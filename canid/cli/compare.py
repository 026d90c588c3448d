"""`canid compare A B`: which parameters and causes of two drivers differ, by how much, and what could not be seen."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from canid.cli import compare_sides, drive_source, options
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output
from canid.errors import CHECK_FAILED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.findings import Provenance

PAGE_SUFFIXES = (".html", ".htm")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    what = (
        "a log, a part of one (LOG@60:300, s), several joined by commas or a folder (one driver), or JSON of "
        "canid identify or diagnose"
    )
    parser.add_argument("a", metavar="A", help=f"one driver: {what}")
    parser.add_argument(
        "b", metavar="B", nargs="?", help="the other driver; without it the halves of A are compared"
    )
    parser.add_argument("--halves", action="store_true", help="compare the first half of A with the second")
    options.vehicle(parser, required=False)
    parser.add_argument("--vehicle-a", metavar="V.toml", help="vehicle file of A's logs, where they differ")
    parser.add_argument("--vehicle-b", metavar="V.toml", help="vehicle file of B's logs")
    drive_source.arguments(parser)
    options.part(parser)
    parser.add_argument(
        "--diagnose", action="store_true", help="diagnose the logs, and compare causes as well; takes minutes"
    )
    options.json_file(parser)
    parser.add_argument(
        "-o",
        "--report",
        metavar="FILE.html",
        help="write the comparison as an HTML page; replaces an earlier one",
    )
    parser.add_argument("--check", action="store_true", help="exit with 1 if a difference is found (for CI)")


def run(args: argparse.Namespace) -> int:
    """Compare."""
    from canid.comparison.comparison import DIFFERENT, compare
    from canid.views import comparison_json, comparison_text, json_values

    if args.report and Path(args.report).suffix.lower() not in PAGE_SUFFIXES:
        raise ConfigError(
            f"compare: --report {args.report} is not an .html file; put A and B before --report"
        )
    if args.halves and args.b:
        raise ConfigError(f"compare: --halves compares the halves of one drive: leave out {args.b}")
    named = [compare_sides.named(side) for side in (args.a, args.b) if side]
    files = [one.path for side in named for one in side]
    vehicles = [name for name in (args.vehicle, args.vehicle_a, args.vehicle_b) if name]
    json = options.json_output(args)
    page = Output("--report", args.report, output_kinds.COMPARISON_PAGE) if args.report else None
    outputs.check([json, page], [*files, *vehicles])
    sides, code = compare_sides.read(args, named)
    found = compare(*sides)
    show = line_printer(args.json)
    for line in comparison_text.text(found):
        show(line)
    with outputs.opened(json) as sink:
        if sink is not None:
            of = {**comparison_json.to_json(found), "command": command(args)}
            sink.write(json_values.document("compare", of) + "\n")
    if page is not None:
        from canid.views.comparison_report.comparison_page import page as written

        with outputs.opened(page) as file:
            if file is not None:
                file.write(written(found, _provenance(args, files)))
                info(f"{page.path} written")
    return code or (CHECK_FAILED if args.check and found.verdict == DIFFERENT else DONE)


def command(args: argparse.Namespace) -> str:
    """The command that gives the same comparison again.

    Example:
        >>> command(argparse.Namespace(a="a b.blf", b="c.blf", halves=False, vehicle="generic", vehicle_a=None,
        ...     vehicle_b=None, start=0.0, stop=60.0, diagnose=False))
        "canid compare 'a b.blf' c.blf --vehicle generic --stop 60"
    """
    words = [
        "canid",
        "compare",
        args.a,
        *([args.b] if args.b else []),
        *(["--halves"] if args.halves else []),
    ]
    for key in ("vehicle", "vehicle_a", "vehicle_b"):
        words += [f"--{key.replace('_', '-')}", getattr(args, key)] if getattr(args, key) else []
    words += drive_source.words(argparse.Namespace(**{**vars(args), "vehicle": None}))
    words += ["--start", f"{args.start:g}"] if args.start > 0 else []
    words += ["--stop", f"{args.stop:g}"] if args.stop < float("inf") else []
    words += ["--diagnose"] if args.diagnose else []
    return shlex.join(words)


def _provenance(args: argparse.Namespace, files: list[str]) -> Provenance:
    from canid.cli.provenance import sha256, versions
    from canid.findings import Provenance

    vehicles = [name for name in (args.vehicle, args.vehicle_a, args.vehicle_b) if name]
    return Provenance(
        log=", ".join(files),
        log_sha256=", ".join(map(sha256, files)),
        vehicle=", ".join(vehicles),
        command=command(args),
        versions=versions(),
    )
