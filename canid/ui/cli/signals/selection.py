"""--dbc, --bus, --id and --signals: what of a log or a bus is shown, and which DBC files describe it."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Mapping
from fnmatch import translate
from pathlib import Path
from typing import TYPE_CHECKING

from canid.ui.cli.options import options
from canid.ui.terminal.messages import info
from canid.values.bus_names import NamedBus, bus_of, on_log

if TYPE_CHECKING:
    from canid.analysis.contents.binding import DbcFile
    from canid.analysis.contents.log_survey import Wanted
# of the number of a bus; a log format has at most 16 bits for it
MAX_BUS_DIGITS = 5


def arguments(parser: argparse.ArgumentParser) -> None:
    """--dbc, --bus, --id and --signals: what of a log is shown, and which files describe it."""
    parser.add_argument(
        "--dbc",
        metavar="FILE[@BUS]",
        nargs="+",
        action="extend",
        default=[],
        help="DBC files that describe messages; FILE@1 or FILE@can1: those of this bus, else where its ids fit; repeatable",
    )
    parser.add_argument(
        "--bus",
        type=whole,
        nargs="+",
        action="extend",
        default=[],
        metavar="N",
        help="only these buses, by number or name",
    )
    parser.add_argument(
        "--id",
        type=identifier,
        nargs="+",
        action="extend",
        default=[],
        metavar="ID",
        help="only these ids, such as 0x2C1",
    )
    parser.add_argument(
        "--signals",
        metavar="PATTERN",
        help="only signals of this name: a part of MESSAGE.SIGNAL, or a pattern such as *SPEED*; needs --dbc",
    )


def read_files(named: list[tuple[str, int | str | None]], buses: Mapping[str, int]) -> list[DbcFile]:
    """Read DBC files, and report their warnings. Raises ConfigError."""
    if not named:
        return []
    from canid.analysis.contents.binding import DbcFile
    from canid.signals.dbc_text.parsing import Parser
    from canid.signals.vehicle import database

    out = []
    with Parser() as parser:
        for name, given in named:
            bus = on_log(bus_of(given), buses)
            read, warnings, _ = database.load(Path(name), bus, parser)
            out.append(DbcFile(read.file, bus, tuple(read.messages.values())))
            for warning in warnings:
                info(warning)
    return out


def bound(name: str) -> tuple[str, int | str | None]:
    """Take the bus off FILE@BUS; a file that is called so is meant as it is.

    Example:
        >>> bound("radar.dbc@1"), bound("me@home.dbc")
        (('radar.dbc', 1), ('me@home.dbc', None))
    """
    match = re.fullmatch(r"(.+\.\w+)@(\d{1,5}|[A-Za-z][\w.-]{0,254})", name, re.DOTALL)
    if match is None or os.path.exists(name):
        return name, None
    return match[1], int(match[2]) if match[2].isdecimal() else match[2]


def wanted(args: argparse.Namespace, numbers: Mapping[str, int]) -> Wanted:
    """The part of a log or a bus that is shown; `numbers`: of its interfaces."""
    from canid.analysis.contents.log_survey import Wanted

    by_name = None if args.signals is None else matcher(args.signals)
    buses = [bus.on(numbers) if isinstance(bus, NamedBus) else bus for bus in args.bus]
    return Wanted(options.window(args), frozenset(buses), frozenset(args.id), by_name)


def matcher(pattern: str) -> Callable[[str], bool]:
    """Whether a name has a pattern with * and ? in it, or contains a text; upper and lower case are the same.

    Example:
        >>> matcher("speed")("EGO.VehicleSpeed"), matcher("*.speed*")("EGO.VehicleSpeed"), matcher("e*d")("EGO.Speed")
        (True, False, True)
    """
    text = pattern if set(pattern) & set("*?[") else f"*{pattern}*"
    compiled = re.compile(translate(text), re.IGNORECASE)
    return lambda name: compiled.match(name) is not None


def whole(text: str) -> int:
    """A bus, for argparse."""
    if text.isdecimal() and len(text) <= MAX_BUS_DIGITS:
        return int(text)
    if not re.fullmatch(r"[A-Za-z][!-~]{0,254}", text):
        raise argparse.ArgumentTypeError(
            f'"{text}" is no bus: neither a number (such as 0) nor a name (such as can0)'
        )
    return NamedBus(text)


def identifier(text: str) -> int:
    """An id, for argparse: hexadecimal with 0x, or decimal.

    Example:
        >>> identifier("0x2C1"), identifier("705")
        (705, 705)
    """
    try:
        value = int(text, 16 if text.lower().startswith("0x") else 10)
    except ValueError:
        value = -1
    if not 0 <= value < 1 << 29:
        raise argparse.ArgumentTypeError(f'"{text}" is not an id (such as 0x2C1 or 705)')
    return value
