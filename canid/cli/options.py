"""Options that several verbs share, and what they open."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from canid.errors import OutputError


def vehicle(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """--vehicle."""
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        required=required,
        help="vehicle file, or the name of one that is shipped",
    )


def json_file(parser: argparse.ArgumentParser) -> None:
    """--json."""
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


@contextmanager
def sink(name: str | None, *, overwrite: bool = True) -> Iterator[TextIO | None]:
    """The file that --json names; "-" is standard output, None is none.

    Raises:
        OutputError: it cannot be written.
    """
    if name is None or name == "-":
        yield sys.stdout if name else None
        return
    path = Path(name)
    if path.exists() and not overwrite:
        raise OutputError(f"{name}: exists already; choose another name or use --force")
    try:
        with path.open("w", encoding="utf-8") as file:
            yield file
    except OSError as error:
        raise OutputError(f"{name}: cannot be written ({error.strerror})") from error


def talk(text: str) -> None:
    """Say something to the user, on standard error."""
    print(f"canid: {text}", file=sys.stderr, flush=True)
