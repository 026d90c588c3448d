"""`canid compare A B`: which parameters and causes of two drivers differ, by how much, and what could not be seen."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from canid.ui.cli.command_line import PART, READ_BY, reproducing
from canid.ui.cli.inputs import compare_sides, drive_source
from canid.ui.cli.options import options, report_option
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.terminal.messages import info, line_printer
from canid.values.errors import CHECK_FAILED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.values.findings import Provenance

# that change a comparison
OPTIONS = ("--halves", *READ_BY, "--vehicle-a", "--vehicle-b", *PART, "--diagnose")


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
    options.time_zone(parser)
    options.json_file(parser)
    report_option.add(
        parser, "write the comparison as an HTML page", ("-o", "--report"), default="compare.html"
    )
    parser.add_argument("--check", action="store_true", help="exit with 1 if a difference is found (for CI)")


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.ui.views.comparison_report.comparison_json import Compared

    return {"compare": Compared}


def run(args: argparse.Namespace) -> int:
    """Compare."""
    if args.halves and args.b:
        raise ConfigError(f"compare: --halves compares the halves of one drive: leave out {args.b}")
    named = [compare_sides.named(side) for side in (args.a, args.b) if side]
    from canid.analysis.comparison.comparison import DIFFERENT, compare
    from canid.ui.views.comparison_report import comparison_document, comparison_json
    from canid.values.text import json_values

    files = [part.path for side in named for part in side]
    vehicles = [name for name in (args.vehicle, args.vehicle_a, args.vehicle_b) if name]
    json = options.json_output(args)
    page = report_option.output(args, "compare", output_kinds.COMPARISON_PAGE)
    outputs.check([json, page], [*files, *vehicles])
    sides, code = compare_sides.read(args, named)
    comparison = compare(*sides)
    command = reproducing(args, "compare", *filter(None, (args.a, args.b)), options=OPTIONS)
    show = line_printer(args.json)
    for line in comparison_document.text(comparison):
        show(line)
    document = comparison_json.document(comparison, command)
    complete_files.write(json, lambda: json_values.document("compare", document) + "\n")
    complete_files.write(
        page, lambda: comparison_document.page(comparison, _provenance(args, files, command))
    )
    if page is not None:
        info(f"{page.path} written")
    return code or (CHECK_FAILED if args.check and comparison.verdict == DIFFERENT else DONE)


def _provenance(args: argparse.Namespace, files: list[str], command: str) -> Provenance:
    from canid.ui.cli.provenance import sha256, versions
    from canid.values.findings import Provenance

    vehicles = [name for name in (args.vehicle, args.vehicle_a, args.vehicle_b) if name]
    files = list(dict.fromkeys(files))  # both sides may be parts of one log
    return Provenance(
        log=", ".join(files),
        log_sha256=", ".join(map(sha256, files)),
        vehicle=", ".join(vehicles),
        command=command,
        versions=versions(),
    )
