"""Options that several verbs share."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from canid.io.logs import formats
from canid.ui.cli.output import output_kinds
from canid.ui.cli.output.outputs import Output
from canid.values import bounded_numbers

if TYPE_CHECKING:
    from canid.io.recording.rotation import Rotation
    from canid.values.window import Window

# every verb that reads logs
LOGS = f"recorded log: {formats.described()}"


def vehicle(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """--vehicle."""
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        required=required,
        help="vehicle file (TOML), or the name of a built-in one, such as generic",
    )


def state(parser: argparse.ArgumentParser) -> None:
    """--state."""
    parser.add_argument(
        "--state",
        metavar="FILE",
        help="continue from the state of an earlier run, and save it to FILE every 10 s and at the end",
    )


def rotation(parser: argparse.ArgumentParser) -> None:
    """--file-size, --file-time, --keep-time, --keep-share."""
    group = parser.add_argument_group(
        "rotation",
        "record into F_START_000001.blf, F_START_000002.blf, ...; each file can be read on its own",
    )
    group.add_argument(
        "-s",
        "--file-size",
        type=bounded_numbers.size,
        default=0,
        metavar="SIZE",
        help="begin a new file before this size: 500k, 100M, 2G",
    )
    group.add_argument(
        "--file-time",
        type=bounded_numbers.span,
        default=math.inf,
        metavar="TIME",
        help="begin a new file after this time: 30s, 10min, 1h",
    )
    group.add_argument(
        "--keep-time",
        type=bounded_numbers.span,
        default=math.inf,
        metavar="TIME",
        help="delete files of this series older than this: 12h, 7d",
    )
    group.add_argument(
        "--keep-share",
        type=bounded_numbers.share,
        default=math.nan,
        metavar="PERCENT",
        help="delete the oldest files of this series when it takes more than this share of the disk: 50%%",
    )


def rotation_of(args: argparse.Namespace) -> Rotation | None:
    """The options of `rotation`; None: one file. Raises ConfigError."""
    from canid.io.recording.rotation import Rotation, checked

    return checked(Rotation(args.file_size, args.file_time, args.keep_time, args.keep_share))


def json_file(parser: argparse.ArgumentParser) -> None:
    """--json; an existing JSON file is replaced."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        help='write the results as JSON ("-": standard output); an existing file is replaced only if it is JSON',
    )


def time_zone(parser: argparse.ArgumentParser) -> None:
    """--time-zone."""
    parser.add_argument(
        "--time-zone",
        metavar="ZONE",
        help="of local times in the log (.asc, .trc, .blf of Vector's tools): Europe/Berlin, UTC, +08:00; default: "
        "CANID_TIME_ZONE, or else this machine's",
    )


def force(parser: argparse.ArgumentParser) -> None:
    """--force."""
    parser.add_argument(
        "--force",
        action="store_true",
        help="replace existing output files, if they are of the same kind",
    )


def part(parser: argparse.ArgumentParser) -> None:
    """--start and --stop."""
    parser.add_argument(
        "--start",
        type=bounded_numbers.seconds,
        default=-math.inf,
        metavar="S",
        help="leave out what is earlier than S seconds after the log's first frame",
    )
    parser.add_argument(
        "--stop",
        type=bounded_numbers.seconds,
        default=float("inf"),
        metavar="S",
        help="leave out what is later than S seconds after it",
    )


def workers(parser: argparse.ArgumentParser, name: str = "--workers") -> None:
    """--workers, of a verb that runs processes."""
    parser.add_argument(
        name, type=bounded_numbers.processes, metavar="N", help="processes; default: one per core"
    )


def listening(parser: argparse.ArgumentParser) -> None:
    """--duration, of a verb that reads a bus for a while."""
    parser.add_argument(
        "--duration",
        type=bounded_numbers.seconds,
        default=5.0,
        metavar="S",
        help="seconds to listen to the bus; default: 5",
    )


def window(args: argparse.Namespace) -> Window:
    """The part of a log that --start and --stop name."""
    from canid.values.window import Window

    return Window(args.start, args.stop)


def json_output(args: argparse.Namespace) -> Output | None:
    """The output of --json: it replaces JSON text, nothing else."""
    return None if args.json is None else Output("--json", args.json, output_kinds.JSON)


def read_by(args: argparse.Namespace) -> list[str]:
    """All files that the command line names for reading: no output may be one of them."""
    named = [getattr(args, name, None) for name in ("log", "logs", "vehicle", "columns", "dbc")]
    return [each for value in named if value for each in (value if isinstance(value, list) else [value])]


def jobs_of_a_fleet(parser: argparse.ArgumentParser, what: str, timeout: tuple[float, str]) -> None:
    """--workers, --scheduler, --timeout and --memory: where jobs run, and what one may take.

    Args:
        parser: of the verb.
        what: a job is, as in "one log".
        timeout: default, in s and in words.
    """
    from canid.analysis.fleet.job import Settings

    workers(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on Dask, on this scheduler: tls://host:8786"
    )
    parser.add_argument(
        "--timeout",
        type=bounded_numbers.span,
        default=timeout[0],
        metavar="TIME",
        help=f"time that {what} may take: 10min, 2h; default: {timeout[1]}",
    )
    parser.add_argument(
        "--memory",
        type=bounded_numbers.size,
        default=Settings().memory_bytes,
        metavar="SIZE",
        help=f"memory that {what} may take: 500M, 8G; default: 4G",
    )
