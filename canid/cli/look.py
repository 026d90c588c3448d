"""`canid look LOG`: what a log contains, without a vehicle file; with DBC files their signals over time."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable
from fnmatch import translate
from pathlib import Path
from typing import TYPE_CHECKING

from canid.cli import options
from canid.cli.output import outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.progress import Progress, is_terminal
from canid.errors import DAMAGED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.contents.binding import DbcFile
    from canid.contents.log_survey import Wanted
    from canid.log_contents import LogContents
    from canid.logs import Log
    from canid.views.look_text import Head


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.views.look_text import MAX_ROWS, SORTS

    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    parser.add_argument(
        "--dbc",
        metavar="FILE[@BUS]",
        nargs="+",
        action="extend",
        default=[],
        help="DBC files that describe messages; FILE@1: those of bus 1, else where its ids fit; repeatable",
    )
    parser.add_argument(
        "--bus", type=whole, nargs="+", action="extend", default=[], metavar="N", help="only these buses"
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
    parser.add_argument("--sort", choices=SORTS, default="id", help="order of the rows; default: id")
    parser.add_argument(
        "--all",
        action="store_true",
        help=f"all rows, not the first {MAX_ROWS}; constant signals and counters too",
    )
    options.part(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Read once, show."""
    from canid.contents import survey
    from canid.logs import open_log
    from canid.views import json_values, look_json, look_text

    json = options.json_output(args)
    named = [bound(name) for name in args.dbc]
    args.dbc = [name for name, _ in named]
    if args.signals is not None and not named:
        raise ConfigError("look: --signals shows signals of DBC files: name them by --dbc")
    outputs.check([json], options.read_by(args))
    log = open_log(args.log)
    files = read_files(named)
    with Progress(f"reading {args.log}") as bar:
        found = survey(log, files, wanted(args), bar.to)
    if not found.frames:
        from canid.drive_reader import nothing_read  # not at the start: it takes as long as half of a log

        raise nothing_read(args.log, args.start, args.stop, log.damage)
    if args.signals is not None:
        only = {(one.bus, one.id) for one in found.signals}
        found = found._replace(messages=tuple(m for m in found.messages if (m.bus, m.id) in only))
    head = head_of(log, args.log)
    print_line = line_printer(args.json)
    for line in look_text.lines(found, head, width=width(), sort=args.sort, everything=args.all):
        print_line(line)
    command = following(args.log, args.dbc)
    print_line("")
    print_line(f"next: {command}")
    with outputs.opened(json) as sink:
        if sink is not None:
            sink.write(json_values.document("look", look_json.values(found, head) | {"next": command}) + "\n")
    say_nothing_found(args, found)
    if log.others_says:
        info(f"no CAN frames: {log.others_says}")
    return DAMAGED if log.damage else DONE


def head_of(log: Log, path: str) -> Head:
    """What is known of a log apart from its frames, once it was read."""
    from canid.logs import formats
    from canid.views.look_text import Head

    suffix = formats.log_suffix(Path(path)).removeprefix(".")
    return Head(path, suffix, log.start_utc, log.damage.says if log.damage else "")


def read_files(named: list[tuple[str, int | None]]) -> list[DbcFile]:
    """Read DBC files, and report their warnings. Raises ConfigError."""
    if not named:
        return []
    from canid.contents.binding import DbcFile
    from canid.parsing import Parser
    from canid.vehicle import database

    out = []
    with Parser() as parser:
        for name, bus in named:
            read, warnings, _ = database.load(Path(name), bus, parser)
            out.append(DbcFile(read.file, bus, tuple(read.messages.values())))
            for warning in warnings:
                info(warning)
    return out


def bound(name: str) -> tuple[str, int | None]:
    """Take the bus off FILE@BUS; a file that is called so is meant as it is.

    Example:
        >>> bound("radar.dbc@1"), bound("me@home.dbc")
        (('radar.dbc', 1), ('me@home.dbc', None))
    """
    found = re.fullmatch(r"(.+)@(\d{1,5})", name, re.DOTALL)
    if found is None or os.path.exists(name):
        return name, None
    return found[1], int(found[2])


def wanted(args: argparse.Namespace) -> Wanted:
    """The part of a log that is shown."""
    from canid.contents.log_survey import Wanted

    by_name = None if args.signals is None else matcher(args.signals)
    return Wanted(args.start, args.stop, frozenset(args.bus), frozenset(args.id), by_name)


def matcher(pattern: str) -> Callable[[str], bool]:
    """Whether a name has a pattern with * and ? in it, or contains a text; upper and lower case are the same.

    Example:
        >>> matcher("speed")("EGO.VehicleSpeed"), matcher("*.speed*")("EGO.VehicleSpeed"), matcher("e*d")("EGO.Speed")
        (True, False, True)
    """
    text = pattern if set(pattern) & set("*?[") else f"*{pattern}*"
    compiled = re.compile(translate(text), re.IGNORECASE)
    return lambda name: compiled.match(name) is not None


def width() -> int:
    """Characters of a line: of the terminal, or as many as a page takes."""
    from canid.views.look_text import PLAIN_WIDTH

    return shutil.get_terminal_size().columns if is_terminal(sys.stdout) else PLAIN_WIDTH


def following(log: str, dbc: list[str]) -> str:
    """The next command.

    Example:
        >>> following("drive 7.blf", ["car.dbc"]), following("a.asc", [])
        ("canid init car.dbc --log 'drive 7.blf'", 'canid look a.asc --dbc FILE.dbc')
    """
    words = ["canid", "init", *dbc, "--log", log] if dbc else ["canid", "look", log, "--dbc", "FILE.dbc"]
    return shlex.join(words)


def say_nothing_found(args: argparse.Namespace, found: LogContents) -> None:
    """Say why there are no rows."""
    if args.signals is not None and not found.signals:
        info(f"no signal of these DBC files that came is called {args.signals}")
    elif not found.messages:
        info("no frame has such a bus and id")
    for one in found.databases:
        if not one.found:
            info(f"{one.file}: none of its messages came: is it of another vehicle or bus?")


def whole(text: str) -> int:
    """A bus, for argparse."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'"{text}" is not the number of a bus (such as 0)')
    return int(text)


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
