"""`canid decode LOG --dbc FILE`: each frame's message and signals on standard output; without LOG those of a bus."""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from canid.ui.cli.inputs.reading import counted, report_log, report_silence
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, outputs
from canid.ui.cli.signals import selection
from canid.ui.terminal.messages import info, line_printer
from canid.values import bounded_numbers
from canid.values.errors import DAMAGED, DONE, USAGE, ConfigError
from canid.values.text import json_values

if TYPE_CHECKING:
    from canid.analysis.contents.decoded_frames import DecodedFrame, Decoder
    from canid.ui.cli.output.outputs import TextOutput
    from canid.ui.cli.signals.live_table import LiveTable
    from canid.values.types import Columns, Frame

HEAD = ("t", "bus", "id", "message", "signal", "value", "unit", "text")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.io.buses.command_line import add_bus_arguments

    parser.add_argument(
        "log", metavar="LOG", nargs="?", help="log to decode; without LOG: the bus of -i and -c"
    )
    options.time_zone(parser)
    selection.arguments(parser)
    parser.add_argument(
        "--csv",
        action="store_true",
        help=f"a row for each signal: {', '.join(HEAD)}; default: a line for each frame",
    )
    parser.add_argument(
        "--table",
        action="store_true",
        help="a row for each signal with its last value and rate; of a bus redrawn until --duration, q or Ctrl-C",
    )
    parser.add_argument(
        "--duration",
        type=bounded_numbers.seconds,
        metavar="S",
        help="seconds to listen to the bus; default: 5, with --table until q",
    )
    options.part(parser)
    options.json_file(parser)
    add_bus_arguments(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes, a line for each frame."""
    from canid.analysis.contents.decoded_frames import DecodedFrame

    return {"decode": DecodedFrame}


def run(args: argparse.Namespace) -> int:
    """Decode."""
    from canid.io.buses.command_line import named

    if not args.dbc:
        raise ConfigError("decode: signals are decoded by DBC files: name them by --dbc")
    if not args.log and not named(args):
        raise ConfigError("decode: name a log, or a bus with -i and -c")
    if args.csv and args.json == "-":
        raise ConfigError("decode: --csv and --json - both take standard output; give --json a file")
    if args.table and (args.csv or args.json is not None):
        raise ConfigError("decode: --table shows last values alone; give --csv or --json without it")
    if args.duration is None:
        args.duration = math.inf if args.table else 5.0
    json = options.json_output(args)
    outputs.check([json], [*options.read_by(args), *args.dbc])
    with complete_files.opened(json, growing=True) as sink:
        return _log(args, sink) if args.log else _bus(args, sink)


def _log(args: argparse.Namespace, sink: TextOutput | None) -> int:
    from canid.analysis.contents.decoded_frames import Decoder
    from canid.analysis.drive.drive_reader import errors_alone
    from canid.analysis.drive.signal_columns import rounds
    from canid.io.logs import open_log

    log = open_log(args.log)
    files = selection.read_files([selection.bound(name) for name in args.dbc], log.buses)
    for file in files:
        log.know(file.messages)
    decoder = Decoder(files, selection.wanted(args, log.buses))
    if args.table:
        _last_values(args, decoder, rounds(log))
    else:
        _write(args, decoder, rounds(log), sink)
    code = _end(decoder)
    report_log(log)
    if not decoder.frames and not decoder.undescribed and (says := errors_alone(args.log)):
        info(says)
    return DAMAGED if log.damage else code


def _last_values(args: argparse.Namespace, decoder: Decoder, chunks: Iterable[list[Columns]]) -> None:
    """The table of a log at its end."""
    from canid.analysis.contents.last_values import LastValues
    from canid.ui.cli.signals.live_table import LiveTable

    values, newest = LastValues(decoder), 0.0
    for together in chunks:
        newest = max(newest, *(float(chunk.t.max()) for chunk in together if len(chunk.t)))
        values.take(together)
    LiveTable.printed(values.rows(min(newest, args.stop)))


def _live(
    args: argparse.Namespace, decoder: Decoder, frames: Callable[..., Iterator[Frame]], table: LiveTable
) -> None:
    """The table of a bus while frames come."""
    from canid.analysis.contents.last_values import LastValues
    from canid.values.frame_columns import columns_of

    values, count = LastValues(decoder), 0
    waiting: list[Frame] = []
    # the clock of the frames goes on while none comes
    newest, at = 0.0, time.monotonic()

    def turn() -> bool:
        if table.due:
            if waiting:
                values.take([columns_of(waiting)])
                waiting.clear()
            rows = values.rows(newest + time.monotonic() - at)
            table.draw(rows, f"{count:,} frames, {len(rows)} signals; q ends")
        return table.ended

    try:
        for frame in frames(turn):
            waiting.append(frame)
            newest, at, count = frame.t, time.monotonic(), count + 1
    finally:
        if waiting:
            values.take([columns_of(waiting)])
        table.close(values.rows(newest + time.monotonic() - at))


def _bus(args: argparse.Namespace, sink: TextOutput | None) -> int:
    """Frame by frame, as they come."""
    from canid.analysis.contents.decoded_frames import Decoder
    from canid.io.buses.bus import interfaces
    from canid.io.buses.bus_opener import open_buses
    from canid.io.buses.command_line import configs_of, listen
    from canid.values.frame_columns import columns_of

    buses = open_buses(configs_of(args))
    numbers = interfaces(buses)
    decoder = Decoder(
        selection.read_files([selection.bound(name) for name in args.dbc], numbers),
        selection.wanted(args, numbers),
    )
    counts: Counter[bool] = Counter()

    def frames(ends: Callable[[], bool] = lambda: False) -> Iterator[Frame]:
        return counted(listen(buses, args.duration, info, ends), counts)

    if args.table:
        from canid.ui.cli.signals.live_table import LiveTable

        _live(args, decoder, frames, LiveTable())
    else:
        _write(args, decoder, ([columns_of([frame])] for frame in frames()), sink)
    code = _end(decoder)
    return code if counts[False] else report_silence(args.duration, counts[True])


def _write(
    args: argparse.Namespace, decoder: Decoder, chunks: Iterable[list[Columns]], sink: TextOutput | None
) -> None:
    """Lines, or rows of CSV, and JSON."""
    show = line_printer(args.json)
    table = csv.writer(sys.stdout, lineterminator="\n") if args.csv else None
    if table is not None:
        table.writerow(HEAD)
    for together in chunks:
        for frame in decoder.decoded(together):
            if sink is not None:
                sink.write(json_values.document("decode", frame) + "\n")
            if table is None:
                show(line(frame))
                continue
            for signal in frame.signals:
                about = (f"{frame.t:.6f}", frame.bus, _id(frame), frame.message)
                table.writerow((*about, signal.name, signal.number, signal.unit, signal.choice))


def line(frame: DecodedFrame) -> str:
    """A frame in one line.

    Example:
        >>> from canid.analysis.contents.decoded_frames import DecodedFrame, DecodedSignal
        >>> line(DecodedFrame(0.25, 1, 0x110, False, "ENGINE", (DecodedSignal("PEDAL", 12.5, "%", ""),)))
        '0.250000  1  110  ENGINE  PEDAL 12.5 %'
    """
    values = ", ".join(f"{signal.name} {signal.text}" for signal in frame.signals)
    return f"{frame.t:.6f}  {frame.bus}  {_id(frame)}  {frame.message}  {values}".rstrip()


def _id(frame: DecodedFrame) -> str:
    return f"{frame.id:08X}" if frame.extended else f"{frame.id:03X}"


def _end(decoder: Decoder) -> int:
    """What no file describes; an exit code: files that describe nothing are those of another bus."""
    left = sum(decoder.undescribed.values())
    if not left:
        return DONE
    ids = len(decoder.undescribed)
    other = "" if decoder.frames else ": give --dbc those of this bus; `canid look` lists what came"
    info(
        f"{decoder.frames:,} frames decoded; {left:,} frames of {ids} ids are in none of the DBC files{other}"
    )
    return DONE if decoder.frames else USAGE
