"""`canid study`: the two papers behind canid, checked by their own numbers, reproduced on logs and corrected.

All but the options is the package `canid_study`, which nothing else of canid imports.
"""

from __future__ import annotations

import argparse
from typing import Any

from canid.ui.cli.inputs import drive_source
from canid.ui.cli.options import options
from canid.values import bounded_numbers

PAPERS = ("grover", "chen-ulsoy")
# drivers, drives of each, replicates: more take years
MAX_COUNT = 100_000


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verbs = parser.add_subparsers(
        dest="what", required=True, metavar="prints|grover|chen-ulsoy", help="what to study"
    )
    prints = verbs.add_parser("prints", help="what follows from the papers' own numbers; needs no log")
    prints.add_argument("paper", nargs="?", choices=PAPERS, help="one of them; default: both")
    prints.add_argument(
        "--deep", action="store_true", help="search the misprints that would repair an equation as well"
    )
    _common(prints)
    grover = verbs.add_parser(
        "grover", help="car following: Grover's method and canid's on the same episodes"
    )
    grover.add_argument(
        "--min-episode", type=bounded_numbers.seconds, metavar="S", help="shortest episode in s; default: 20"
    )
    grover.add_argument(
        "--gate-fit",
        type=bounded_numbers.number("a fit in percent (such as 20)", 0.0, 100.0),
        metavar="PERCENT",
        help="leave out episodes where a transfer function fits less; default: 0, none",
    )
    _of_logs(grover, "1,10")
    chen = verbs.add_parser(
        "chen-ulsoy", help="lane keeping: Chen & Ulsoy's method and canid's on the same segments"
    )
    chen.add_argument(
        "--segment",
        type=bounded_numbers.number("a time in seconds (such as 60)", 1.0, 86_400.0),
        metavar="S",
        help="length of a segment in s; default: 60, of short logs less",
    )
    chen.add_argument(
        "--by",
        metavar="file|folder|MAP.toml",
        default="folder",
        help="what is one driver's: a file, a folder (the default), or the logs that MAP.toml names in [drivers]",
    )
    chen.add_argument(
        "--bootstraps",
        type=bounded_numbers.whole("a number of replicates", 0, MAX_COUNT),
        metavar="N",
        help="replicates for null bands and intervals",
    )
    chen.add_argument(
        "--drivers",
        type=bounded_numbers.whole("a number of drivers", 1, MAX_COUNT),
        metavar="N",
        help="with --reproduce: drivers; default: 12",
    )
    chen.add_argument(
        "--c1",
        type=bounded_numbers.number("a coefficient of a moving average (such as 0.5)", -1.0, 1.0),
        metavar="C",
        help="with --reproduce: moving average of the driver's noise",
    )
    chen.add_argument(
        "--push",
        type=bounded_numbers.number("a disturbance in m/s² (such as 0.1)", 0.0, 10.0),
        metavar="A",
        help="with --reproduce: disturbance of the road in m/s²",
    )
    _of_logs(chen, "120")


def _of_logs(parser: argparse.ArgumentParser, minutes: str) -> None:
    """Options of a study of logs."""
    from canid.models.simulation import MAX_MINUTES, MIN_MINUTES

    parser.add_argument("logs", metavar="LOG", nargs="*", help=options.LOGS)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    options.part(parser)
    parser.add_argument(
        "--reproduce",
        action="store_true",
        help="simulate the paper's drivers through DBC and .blf, and study those",
    )
    parser.add_argument(
        "--seed",
        type=bounded_numbers.seed,
        default=1,
        metavar="N",
        help="with --reproduce: random seed; default: 1",
    )
    parser.add_argument(
        "--minutes",
        type=bounded_numbers.numbers("a list of times in minutes (such as 1,10)", MIN_MINUTES, MAX_MINUTES),
        default=minutes,
        metavar="M",
        help=f"with --reproduce: length of the drives; default: {minutes}",
    )
    parser.add_argument(
        "--seeds",
        type=bounded_numbers.whole("a number of drives", 1, MAX_COUNT),
        metavar="N",
        help="with --reproduce: drives of each driver and length",
    )
    parser.add_argument(
        "--check", action="store_true", help="exit with 1 if a figure of --reproduce is missed (for CI)"
    )
    options.workers(parser, "--jobs")
    _common(parser)


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--out",
        metavar="DIR",
        help="write study.html, study.json, tables/*.csv and figures/*.svg into a folder",
    )
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid_study.views.study_files import Studied

    return {"study": Studied}


def run(args: argparse.Namespace) -> int:
    """Study, and show the results."""
    from canid_study import command

    return command.run(args)
