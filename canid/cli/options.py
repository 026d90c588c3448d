"""Options that several verbs share, and what they open."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from canid.errors import OutputError

# what every reader of logs takes
LOGS = ".blf, .asc, candump .log, .csv, .trc or .mf4"


def vehicle(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """--vehicle."""
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        required=required,
        help="vehicle file, or the name of one that is shipped",
    )


def state(parser: argparse.ArgumentParser) -> None:
    """--state."""
    parser.add_argument(
        "--state",
        metavar="FILE",
        help="go on from what was learnt before a restart, and save it here every 10 s and at the end",
    )


def json_file(parser: argparse.ArgumentParser) -> None:
    """--json; what was there is replaced."""
    parser.add_argument("--json", metavar="FILE", help='the same numbers as JSON; "-" is standard output')


def force(parser: argparse.ArgumentParser) -> None:
    """--force."""
    parser.add_argument("--force", action="store_true", help="overwrite files that exist")


def part(parser: argparse.ArgumentParser) -> None:
    """--start and --stop."""
    parser.add_argument("--start", type=seconds, default=0.0, metavar="S", help="leave out what is earlier")
    parser.add_argument(
        "--stop", type=seconds, default=float("inf"), metavar="S", help="leave out what is later"
    )


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


def refuse_to_overwrite(path: str | Path, *, force: bool) -> None:
    """Raise OutputError for a file that exists, unless forced; a device or pipe may be written to."""
    if Path(path).is_file() and not force:
        raise OutputError(f"{path}: exists already; choose another name or use --force")


@contextmanager
def sink(name: str | None, *, overwrite: bool = True) -> Iterator[TextIO | None]:
    """The file that --json names; "-" is standard output, None is none.

    A command that fails before it has written anything leaves no empty file behind.

    Raises:
        OutputError: it exists already and may not be overwritten, or cannot be written.
    """
    if name is None or name == "-":
        yield sys.stdout if name else None
        return
    path = Path(name)
    existed = path.exists()
    refuse_to_overwrite(path, force=overwrite)
    try:
        file = path.open("w", encoding="utf-8")
    except OSError as error:
        raise _unwritable(name, error) from error
    try:
        yield file
    except BaseException:
        # what is in it stays, and an error of the file itself comes up again here
        _close(file, name)
        if not existed and path.is_file() and path.stat().st_size == 0:
            path.unlink()
        raise
    _close(file, name)


def _close(file: TextIO, name: str) -> None:
    try:
        file.close()
    except OSError as error:
        raise _unwritable(name, error) from error


def _unwritable(name: str, error: OSError) -> OutputError:
    return OutputError(f"{name}: cannot be written ({error.strerror})")


def talk(text: str) -> None:
    """Say something to the user, on standard error."""
    print(f"canid: {text}", file=sys.stderr, flush=True)
