"""The result of `canid look` as text: what a log contains, a row for each message and each signal."""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from canid.ui.views.document.document_text import wrapped
from canid.values.bus_names import bus_text
from canid.values.log_contents import BusContents, LogContents, MessageContents, SignalContents
from canid.values.terminal_text import terminal_text
from canid.values.text.numbers import DASH, number, same_digits
from canid.values.types import Array

# characters of a line: where the output is no terminal, and what a terminal is taken for at least and at most
PLAIN_WIDTH, MIN_WIDTH, MAX_WIDTH = 100, 60, 200
# rows of a table without --all: what a reader scrolls through
MAX_ROWS = 48
# characters of a name, and of a text of a value table
NAME_CHARS, TEXT_CHARS = 24, 12
# of a line that is narrower than this, texts have fewer characters
WIDE_CHARS, NARROW_TEXT_CHARS = 130, 8
MIN_MESSAGE_CHARS = 6
MIN_SPARK_CHARS = 12
BLOCKS = "▁▂▃▄▅▆▇█"
# bit/s of the usual bus of a vehicle, for its load
USUAL_BIT_RATE = 500_000
# data bytes that are drawn one by one; of longer frames several share a character
MAX_DRAWN_BYTES = 16
# s after the start (before the end) of the log from which on the first (last) frame is shown
LATE_S = 1.0
SORTS = ("id", "rate", "changes")
DIGITS, FINE_DIGITS = 4, 8


class Head(NamedTuple):
    """What is known of a log apart from its frames."""

    path: str
    format: str
    start_utc: float  # s since the epoch; NaN: the log does not state it
    damage: str  # a sentence, or ""
    interfaces: Mapping[str, int] = MappingProxyType({})  # by name, where the format has names -> bus


def lines(
    contents: LogContents, head: Head, *, width: int = PLAIN_WIDTH, sort: str = "id", everything: bool = False
) -> list[str]:
    """All lines.

    Args:
        contents: what the log contains.
        head: of the log.
        width: characters of a line.
        sort: order of both tables, of `SORTS`.
        everything: no row is left out.
    """
    width = min(max(width, MIN_WIDTH), MAX_WIDTH)
    # the path alone in its line, whole, so that it can be copied
    out = [head.path, *(line for says in _head(contents, head) for line in wrapped(says)), ""]
    out += _messages(contents, width, sort, everything)
    if contents.signals or contents.databases:
        out += ["", *_signals(contents, width, sort, everything)]
    return out


def format_start(start_utc: float) -> str:
    """Start of a log in UTC, or that it is not known.

    Example:
        >>> format_start(1533224087.25), format_start(float("nan"))
        ('2018-08-02 15:34:47 UTC', 'start not stated')
    """
    try:
        at = datetime.datetime.fromtimestamp(start_utc, datetime.UTC)
    except (ValueError, OverflowError, OSError):
        return "start not stated"
    return f"{at:%Y-%m-%d %H:%M:%S} UTC"


def _head(contents: LogContents, head: Head) -> list[str]:
    ids = contents.ids
    paused = f" of which {number(contents.paused, 's')} without any frame" if contents.paused else ""
    out = [
        f"{head.format}, {format_start(head.start_utc)}, {number(contents.duration, 's')}{paused}, "
        f"{contents.frames:,} frames, {ids:,} id{'s' * (ids != 1)}"
    ]
    if head.interfaces:
        out.append(bus_text(head.interfaces))
    out += [_bus(bus) for bus in contents.buses]
    if head.damage:
        out.append(f"damaged: {head.damage}")
    for database in contents.databases:
        on = " and ".join(str(bus) for bus in database.buses)
        where = f"bus {on}" if on else "no bus"
        why = "as given" if database.bound else "by its ids"
        out.append(
            f"{database.file}: {where} ({why}), {database.found} of {database.messages} messages found"
        )
    if contents.frames_left_out:
        out.append(f"{contents.frames_left_out:,} frames have further ids, more than are kept")
    if contents.signals_left_out:
        out.append(f"{contents.signals_left_out:,} further signals are left out: choose some by --signals")
    return out


def _bus(bus: BusContents) -> str:
    # without stuff bits
    load = f"at least {number(bus.bits_per_s / 1000.0, 'kbit/s')}"
    # a few frames in an instant, or a faster bus: of another rate
    if not bus.fd and bus.bits_per_s <= USUAL_BIT_RATE:
        load += f" ({number(100.0 * bus.bits_per_s / USUAL_BIT_RATE, '%')} of 500 kbit/s)"
    kinds = [
        f"{n:,} {what}" for n, what in ((bus.errors, "error"), (bus.remote, "remote"), (bus.fd, "FD")) if n
    ]
    frames = f", {', '.join(kinds)} frames" if kinds else ""
    return f"bus {bus.bus}: {bus.frames:,} frames, {number(bus.rate, '1/s', DIGITS)}, {load}{frames}"


# --- messages ---------------------------------------------------------------------------------------------


def _messages(contents: LogContents, width: int, sort: str, everything: bool) -> list[str]:
    order = {
        "id": lambda message: (message.bus, message.id, message.extended),
        "rate": lambda message: -message.rate if math.isfinite(message.rate) else math.inf,
        "changes": lambda message: -message.changes,
    }[sort]
    messages = sorted(contents.messages, key=order)
    shown = messages if everything else messages[:MAX_ROWS]
    named = any(message.name for message in contents.messages)
    head = ["bus", "id", *(["message"] if named else []), "frames", "1/s", "jitter", "bytes", "bits", "notes"]
    rows = [_message(message, contents, named) for message in shown]
    out = _table(head, rows, width, left={1, 2} if named else {1}, last_left=2)
    if len(shown) < len(messages):
        out.append(f"… {len(messages) - len(shown):,} more (--all)")
    if any("█" in row[-2] or "▁" in row[-2] for row in rows):
        out.append("bits of a byte that change: · none ▁ 1 █ 8; c counter, x checksum")
    return out


def _message(message: MessageContents, contents: LogContents, named: bool) -> list[str]:
    size = (
        str(message.longest)
        if message.shortest == message.longest
        else f"{message.shortest}-{message.longest}"
    )
    notes = [f"{field.kind} {_place(field.start, field.length)}" for field in message.fields]
    # a slow message cannot come at once
    late = max(LATE_S, 1.5 / message.rate) if math.isfinite(message.rate) else LATE_S
    begins, ends = message.first > contents.start + late, message.last < contents.stop - late
    if message.frames == 1:
        notes.append(f"once, at {message.first:.1f} s")
    elif begins or ends:
        notes.append(f"{message.first:.1f}–{message.last:.1f} s")
    elif not message.changes:
        notes.append("constant")
    return [
        str(message.bus),
        f"0x{message.id:08X}" if message.extended else f"0x{message.id:03X}",
        *([_cut(message.name, NAME_CHARS)] if named else []),
        f"{message.frames:,}",
        number(message.rate),
        number(1000.0 * message.jitter, "ms", 2),
        size,
        picture(message),
        ", ".join(notes),
    ]


def _place(start: int, length: int) -> str:
    """Where a field lies: whole bytes, or bits of one.

    Example:
        >>> _place(56, 8), _place(4, 4), _place(8, 16)
        ('byte 7', 'byte 0 bits 4-7', 'bytes 1-2')
    """
    byte, bit = divmod(start, 8)
    if length > 8:
        return f"bytes {byte}-{byte + length // 8 - 1}"
    return f"byte {byte}" if length == 8 else f"byte {byte} bits {bit}-{bit + length - 1}"


def picture(message: MessageContents) -> str:
    """One character for each byte: how many of its bits have changed, c for a counter, x for a checksum.

    Example:
        >>> changed = np.zeros(64, np.uint8)
        >>> changed[1:3] = 1, 255
        >>> picture(MessageContents(0, 1, False, "", "", 9, 1.0, 0.0, 1.0, 0.0, 9.0, 4, 4, 8, changed, ()))
        '·▁█·'
    """
    each = max(1, -(-message.longest // MAX_DRAWN_BYTES))
    bits = [int(byte).bit_count() for byte in message.changed[: message.longest]]
    cells = ["·" if not n else BLOCKS[n - 1] for n in bits]
    for field in message.fields:
        for byte in range(field.start // 8, (field.start + field.length - 1) // 8 + 1):
            # half a byte that counts next to half a byte of a quantity: the quantity is what matters
            if field.length >= 8 or bits[byte] <= field.length:
                cells[byte] = field.kind[0] if field.kind == "counter" else "x"
    if each == 1:
        return "".join(cells)
    groups = [bits[k : k + each] for k in range(0, len(bits), each)]
    return "".join("·" if not any(group) else BLOCKS[max(group) - 1] for group in groups)


# --- signals ----------------------------------------------------------------------------------------------


def _signals(contents: LogContents, width: int, sort: str, everything: bool) -> list[str]:
    rates = {(message.bus, message.id): message.rate for message in contents.messages}
    order = {
        "id": lambda signal: (signal.bus, signal.id),
        "rate": lambda signal: -rates.get((signal.bus, signal.id), 0.0),
        "changes": lambda signal: -signal.changes,
    }[sort]
    ordered = sorted(contents.signals, key=order)
    constant = [signal for signal in ordered if not signal.changes]
    protecting = [signal for signal in ordered if signal.changes and signal.protects]
    moving = (
        ordered if everything else [signal for signal in ordered if signal.changes and not signal.protects]
    )
    shown = moving if everything else moving[:MAX_ROWS]
    two_buses = len({signal.bus for signal in contents.signals}) > 1
    chars = TEXT_CHARS if width >= WIDE_CHARS else NARROW_TEXT_CHARS
    rows = [_signal(signal, chars) for signal in shown]
    head = ["unit", "low", "high", "last", "changes"]
    used = sum(max(len(row[k]) for row in (head, *rows)) + 2 for k in range(len(head)))
    # half of what is left is for the course, and more of it where names are short
    names = [_name(signal, two_buses, max(width - used - 2, MIN_SPARK_CHARS) // 2) for signal in shown]
    spark = max(width - used - 2 - max(map(len, names), default=0), MIN_SPARK_CHARS)
    rows = [
        [name, *row, sparkline(signal.course, spark)]
        for name, row, signal in zip(names, rows, shown, strict=True)
    ]
    out = _table(["signal", *head, "over time"], rows, width, left={0, 1}, last_left=1)
    left = [
        (len(moving) - len(shown), "more"),
        (0 if everything else len(constant), "that never changed"),
        (0 if everything else len(protecting), "counters, checksums and selectors"),
    ]
    if any(n for n, _ in left):
        out.append("… " + ", ".join(f"{n:,} {what}" for n, what in left if n) + " (--all)")
    if not contents.signals:
        out = ["signals: none of these files' messages came"]
    return out


def _signal(signal: SignalContents, chars: int) -> list[str]:
    # a position hardly moves: as many digits as show how it does
    digits = min(DIGITS + same_digits(signal.low, signal.high), FINE_DIGITS)
    texts = [
        _cut(text, chars) or number(value, digits=digits)
        for text, value in (
            (signal.low_text, signal.low),
            (signal.high_text, signal.high),
            (signal.last_text, signal.last),
        )
    ]
    return [_cut(signal.unit, chars), *texts, f"{signal.changes:,}"]


def _name(item: SignalContents, with_bus: bool, chars: int) -> str:
    """MESSAGE.SIGNAL in so many characters: the message is cut first, the signal is what is read."""
    bus = f"{item.bus}:" if with_bus else ""
    signal = _cut(item.signal, max(chars - len(bus) - MIN_MESSAGE_CHARS - 1, MIN_MESSAGE_CHARS))
    message = _cut(item.message, max(chars - len(bus) - len(signal) - 1, MIN_MESSAGE_CHARS))
    return f"{bus}{message}.{signal}"


def sparkline(course: Array, chars: int) -> str:
    """A course as blocks between its smallest and largest value; a blank where nothing came.

    Example:
        >>> sparkline(np.array([0.0, 1.0, 2.0, np.nan, 7.0]), 20)
        '▁▂▃ █'
        >>> sparkline(np.arange(8.0), 4), sparkline(np.array([3.0, 3.0]), 9)
        ('▁▃▆█', '▁▁')
    """
    n = course.size
    chars = min(chars, n)
    if not chars:
        return ""
    edges = np.linspace(0, n, chars + 1).round().astype(int)
    parts = [course[a:b] for a, b in pairwise(edges)]
    means = np.array(
        [part[np.isfinite(part)].mean() if np.isfinite(part).any() else np.nan for part in parts]
    )
    known = means[np.isfinite(means)]
    if not known.size:
        return " " * chars
    low = float(known.min())
    span = float(known.max()) - low
    if not math.isfinite(span):
        return DASH * chars
    top = len(BLOCKS) - 1
    level = np.zeros(chars) if span <= 0.0 else (means - low) / span * top
    return "".join(
        BLOCKS[round(x)] if math.isfinite(m) else " " for x, m in zip(level.tolist(), means, strict=True)
    )


# --- tables -----------------------------------------------------------------------------------------------


def _cut(text: str, chars: int) -> str:
    """A name of a file, escaped first: what is cut must not be half an escape of a terminal."""
    text = terminal_text(text)
    return text if len(text) <= chars else text[: chars - 1] + "…"


def _table(
    head: Sequence[str], rows: Sequence[Sequence[str]], width: int, *, left: set[int], last_left: int
) -> list[str]:
    """Columns, those of `left` and the last ones to the left; the last column is cut at the line's end."""
    cells = [head, *rows]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    to_left = left | set(range(len(head) - last_left, len(head)))
    out = []
    for row in cells:
        line = "  ".join(
            cell.ljust(size) if k in to_left else cell.rjust(size)
            for k, (cell, size) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        out.append(line if len(line) <= width else line[: width - 1] + "…")
    return out
