"""Options that several verbs share, and the parsing of their values."""

from __future__ import annotations

import argparse
import math
import re
from typing import TYPE_CHECKING

from canid.cli.output import output_kinds
from canid.cli.output.outputs import Output
from canid.logs import formats

if TYPE_CHECKING:
    from canid.recording.rotation import Rotation
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
        type=size,
        default=0,
        metavar="SIZE",
        help="begin a new file before this size: 500k, 100M, 2G",
    )
    group.add_argument(
        "--file-time",
        type=span,
        default=math.inf,
        metavar="TIME",
        help="begin a new file after this time: 30s, 10min, 1h",
    )
    group.add_argument(
        "--keep-time",
        type=span,
        default=math.inf,
        metavar="TIME",
        help="delete files of this series older than this: 12h, 7d",
    )
    group.add_argument(
        "--keep-share",
        type=share,
        default=math.nan,
        metavar="PERCENT",
        help="delete the oldest files of this series when it takes more than this share of the disk: 50%%",
    )


def rotation_of(args: argparse.Namespace) -> Rotation | None:
    """The options of `rotation`; None: one file. Raises ConfigError."""
    from canid.recording.rotation import Rotation, checked

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
        type=seconds,
        default=-math.inf,
        metavar="S",
        help="leave out what is earlier than S seconds after the log's first frame",
    )
    parser.add_argument(
        "--stop",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="leave out what is later than S seconds after it",
    )


def listening(parser: argparse.ArgumentParser) -> None:
    """--duration, of a verb that reads a bus for a while."""
    parser.add_argument(
        "--duration",
        type=seconds,
        default=5.0,
        metavar="S",
        help="seconds to listen to the bus; default: 5",
    )


def window(args: argparse.Namespace) -> Window:
    """The part of a log that --start and --stop name."""
    from canid.values.window import Window

    return Window(args.start, args.stop)


def seconds(text: str) -> float:
    """A time in s, for argparse.

    Example:
        >>> seconds("1.5")
        1.5
    """
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f'"{text}" is not a time in seconds (such as 12.5)')
    return value


def size(text: str) -> int:
    """A size in bytes, for argparse.

    Example:
        >>> size("500k"), size("2 GB"), size("10000")
        (500000, 2000000000, 10000)
    """
    return round(
        _with_unit(text, {"": 1, "k": 1e3, "m": 1e6, "g": 1e9, "t": 1e12}, "a size (such as 100M)", "b")
    )


def span(text: str) -> float:
    """A time above 0 in s, for argparse.

    Example:
        >>> span("10min"), span("1.5h"), span("30")
        (600.0, 5400.0, 30.0)
    """
    units = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
    return _with_unit(text, units, "a time (such as 10min)", "")


def share(text: str) -> float:
    """A share, for argparse.

    Example:
        >>> share("50%"), share("0.5 %")
        (0.5, 0.005)
    """
    value = _with_unit(text, {"": 0.01, "%": 0.01}, "a share (such as 50%)", "")
    if value > 1.0:
        raise argparse.ArgumentTypeError(f'"{text}" is more than the whole disk')
    return value


def _with_unit(text: str, units: dict[str, float], what: str, ignored: str) -> float:
    match = re.fullmatch(r"\s*([0-9.]+)\s*([a-z%]*)\s*", text.lower())
    try:
        if match is None:
            raise ValueError
        value = float(match[1]) * units[match[2].removesuffix(ignored) if ignored else match[2]]
    except (ValueError, KeyError):
        value = 0.0
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'"{text}" is not {what}')
    return value


def above_zero(text: str) -> float:
    """A number above 0, for argparse.

    Example:
        >>> above_zero("0.1")
        0.1
    """
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f'"{text}" is not a number above 0')
    return value


def speed(text: str) -> float:
    """A replay speed, for argparse: a factor, or max.

    Example:
        >>> speed("10"), speed("max")
        (10.0, inf)
    """
    if text == "max":
        return float("inf")
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f'"{text}" is not a speed (a factor such as 1 or 10, or max)')
    return value


def json_output(args: argparse.Namespace) -> Output | None:
    """The output of --json: it replaces JSON text, nothing else."""
    return None if args.json is None else Output("--json", args.json, output_kinds.JSON)


def read_by(args: argparse.Namespace) -> list[str]:
    """All files that the command line names for reading: no output may be one of them."""
    named = [getattr(args, name, None) for name in ("log", "logs", "vehicle", "columns", "dbc")]
    return [each for value in named if value for each in (value if isinstance(value, list) else [value])]
