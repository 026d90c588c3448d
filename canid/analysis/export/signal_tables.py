"""Every signal of DBC files in a log: a table for each message, on the message's own times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from canid.analysis.drive.signal_columns import MessageFrames, MessageKey, decode, is_wide, whole_values
from canid.analysis.export.table import Field, Table, Values
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle import j1939
from canid.signals.vehicle.database import Dbc
from canid.values.errors import ConfigError
from canid.values.types import Array


class Received(NamedTuple):
    """A message of a DBC file that came on a bus, and which of its signals are wanted."""

    name: str  # unique; with the bus where the message came on several
    message: Message
    signals: tuple[Signal, ...]
    frames: MessageFrames


def wanted(files: Sequence[Dbc], patterns: Sequence[str]) -> dict[int, set[str]]:
    """Signals that match a pattern, by the `id()` of their message; no patterns: all.

    Args:
        files: the databases.
        patterns: as of a shell (`*`, `?`), for "MESSAGE.SIGNAL", "MESSAGE" or "SIGNAL"; case does not matter.

    Raises:
        ConfigError: a pattern matches nothing.
    """
    chosen: dict[int, set[str]] = {}
    unmatched = {pattern.lower() for pattern in patterns}
    names: set[str] = set()
    for message in (message for file in files for message in file.messages.values()):
        for signal in message.signals:
            spellings = [s.lower() for s in (f"{message.name}.{signal.name}", message.name, signal.name)]
            names.update((message.name, signal.name))
            hits = {
                p for p in (each.lower() for each in patterns) if any(fnmatchcase(s, p) for s in spellings)
            }
            unmatched -= hits
            if hits or not patterns:
                chosen.setdefault(id(message), set()).add(signal.name)
    for pattern in sorted(unmatched):
        close = get_close_matches(pattern.upper(), sorted(names), n=1, cutoff=0.5)
        hint = f'did you mean "{close[0]}"?' if close else "a pattern may hold * and ?, as in WHEEL_*"
        raise ConfigError(f'--signals: "{pattern}" matches no signal of the DBC files; {hint}')
    return chosen


def ids_of(files: Sequence[Dbc], patterns: Sequence[str]) -> set[int] | None:
    """The ids of messages with wanted signals; None: any id (J1939, where the source is a part of it).

    Raises:
        ConfigError: a pattern matches nothing.
    """
    selected = wanted(files, patterns)
    messages = [m for file in files for m in file.messages.values() if id(m) in selected]
    return None if any(m.protocol == j1939.PROTOCOL for m in messages) else {m.id for m in messages}


def received(
    frames: Mapping[MessageKey, MessageFrames], files: Sequence[Dbc], patterns: Sequence[str] = ()
) -> list[Received]:
    """Match frames with the messages of DBC files.

    A file that is bound to a bus goes before one that is not; of two files that define the same id, the first counts.
    """
    selected = wanted(files, patterns)
    matched: list[tuple[MessageKey, Message]] = []
    for key in frames:
        of_bus = sorted((f for f in files if f.bus in (None, key.bus)), key=lambda file: file.bus is None)
        message = next(
            (m for file in of_bus if (m := _matching(key, file.messages.values())) is not None), None
        )
        if message is not None and id(message) in selected and len(frames[key].t):
            matched.append((key, message))
    out = []
    for key, message in matched:
        same = [other for other, other_message in matched if other_message.name == message.name]
        by_bus = len({other.bus for other in same}) > 1
        ids = sum(other.bus == key.bus for other in same) > 1
        name = message.name + (f".bus{key.bus}" if by_bus else "") + (f".{key.id:X}" if ids else "")
        here = frames[key]
        nothing = MessageFrames(here.t[:0], here.length[:0], here.data[:0])
        signals = tuple(
            s
            for s in message.signals
            if s.name in selected[id(message)] and decode(message, s, nothing) is not None
        )
        if signals:
            out.append(Received(name, message, signals, _in_time_order(here)))
    return out


def _matching(key: MessageKey, messages: Iterable[Message]) -> Message | None:
    exact = next((m for m in messages if m.id == key.id and m.extended == key.extended), None)
    return exact or next((m for m in messages if j1939.matches(m, key.id, key.extended)), None)


def _in_time_order(frames: MessageFrames) -> MessageFrames:
    # times are whole ns: their nearest floats print short
    t = np.round(frames.t, 9)
    if np.all(t[1:] >= t[:-1]):
        return frames._replace(t=t)
    order = np.argsort(t, kind="stable")
    return MessageFrames(t[order], frames.length[order], frames.data[order])


def signal_tables(messages: Sequence[Received], *, exact: bool = False) -> list[Table]:
    """One table for each message, in the order of bus and id.

    `exact`: whole numbers of more than 53 bits are Python's, in the place of the doubles next to them.

    A multiplexed signal is NaN in frames that do not carry it. A signal with a value table has a second column,
    "NAME text", with what the value means.
    """
    return [_table(message, exact) for message in messages]


def rounded(messages: Sequence[Received]) -> list[str]:
    """Signals of which a double does not hold all digits, by message and name."""
    return [
        f"{message.name}.{signal.name}"
        for message in messages
        for signal in message.signals
        if is_wide(signal)
    ]


def _table(message: Received, exact: bool) -> Table:
    fields = tuple(field for signal in message.signals for field in fields_of(signal, signal.name))

    def values(part: slice) -> list[Values]:
        frames = MessageFrames(message.frames.t[part], message.frames.length[part], message.frames.data[part])
        out: list[Values] = []
        for signal in message.signals:
            number = on_rows(message.message, signal, frames)
            whole = _whole_on_rows(message.message, signal, frames) if is_wide(signal) else None
            out.append(number if whole is None or not exact else whole)
            if signal.choices:
                out.append(texts(signal, number if whole is None else whole))
        return out

    return Table("signals", message.name, message.frames.t, fields, values, f"id 0x{message.message.id:X}")


def fields_of(signal: Signal, name: str) -> list[Field]:
    """Columns of a signal: its value, and with a value table its text."""
    meanings = signal.meanings
    field = Field(name, signal.unit, choices=meanings)
    return [field, Field(f"{name} text", "", f"meaning of {name}", "text")] if meanings else [field]


def on_rows(message: Message, signal: Signal, frames: MessageFrames) -> Array:
    """Values of a signal in all frames of its message; NaN where a frame does not carry it."""
    rows = np.arange(len(frames.t), dtype=np.float64)
    column = decode(message, signal, frames._replace(t=rows))
    if column is None:
        return np.full(len(rows), np.nan)
    if len(column.t) == len(rows):
        return column.value
    out = np.full(len(rows), np.nan)
    out[column.t.astype(np.int64)] = column.value
    return out


def _whole_on_rows(message: Message, signal: Signal, frames: MessageFrames) -> Values:
    """The same of a wide signal: Python's whole numbers, None where a frame does not carry it."""
    out = np.full(len(frames.t), None, dtype=object)
    rows = np.arange(len(frames.t), dtype=np.float64)
    column = decode(message, signal, frames._replace(t=rows))
    if column is not None:
        out[column.t.astype(np.int64)] = whole_values(signal, column)
    return out


def texts(signal: Signal, values: Values) -> Values:
    """Meaning of each value by the value table; None where there is none."""
    if values.dtype == object:
        scale, offset = int(signal.scale), int(signal.offset)
        whole = {raw * scale + offset: text for raw, text in signal.choices.items()}
        return np.array([whole.get(value) for value in values.tolist()], dtype=object)
    meanings = signal.meanings
    distinct, which = np.unique(values, return_inverse=True)
    labels = np.array([meanings.get(value) for value in distinct.tolist()], dtype=object)
    return labels[which]
