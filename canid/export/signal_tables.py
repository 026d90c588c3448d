"""Every signal of DBC files in a log: a table for each message, on the message's own times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from canid.errors import ConfigError
from canid.export.table import Field, Table, Values
from canid.parsing import Message, Signal
from canid.signal_columns import MessageFrames, MessageKey, decode
from canid.types import Array
from canid.vehicle import j1939
from canid.vehicle.database import Dbc


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
    found: dict[int, set[str]] = {}
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
                found.setdefault(id(message), set()).add(signal.name)
    for pattern in sorted(unmatched):
        close = get_close_matches(pattern.upper(), sorted(names), n=1, cutoff=0.5)
        hint = f'did you mean "{close[0]}"?' if close else "a pattern may hold * and ?, as in WHEEL_*"
        raise ConfigError(f'--signals: "{pattern}" matches no signal of the DBC files; {hint}')
    return found


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
    found: list[tuple[MessageKey, Message]] = []
    for key in frames:
        of_bus = sorted((f for f in files if f.bus in (None, key.bus)), key=lambda file: file.bus is None)
        message = next(
            (m for file in of_bus if (m := _matching(key, file.messages.values())) is not None), None
        )
        if message is not None and id(message) in selected and len(frames[key].t):
            found.append((key, message))
    out = []
    for key, message in found:
        same = [other for other, of in found if of.name == message.name]
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


def signal_tables(messages: Sequence[Received]) -> list[Table]:
    """One table for each message, in the order of bus and id.

    A multiplexed signal is NaN in frames that do not carry it. A signal with a value table has a second column,
    "NAME text", with what the value means.
    """
    return [_table(of) for of in messages]


def _table(of: Received) -> Table:
    fields = tuple(field for signal in of.signals for field in fields_of(signal, signal.name))

    def values(part: slice) -> list[Values]:
        frames = MessageFrames(of.frames.t[part], of.frames.length[part], of.frames.data[part])
        out: list[Values] = []
        for signal in of.signals:
            number = on_rows(of.message, signal, frames)
            out.append(number)
            if signal.choices:
                out.append(texts(signal, number))
        return out

    return Table("signals", of.name, of.frames.t, fields, values, f"id 0x{of.message.id:X}")


def fields_of(signal: Signal, name: str) -> list[Field]:
    """Columns of a signal: its value, and with a value table its text."""
    meanings = {raw * signal.scale + signal.offset: text for raw, text in signal.choices.items()}
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


def texts(signal: Signal, values: Array) -> Values:
    """Meaning of each value by the value table; None where there is none."""
    meanings = {raw * signal.scale + signal.offset: text for raw, text in signal.choices.items()}
    distinct, which = np.unique(values, return_inverse=True)
    labels = np.array([meanings.get(value) for value in distinct.tolist()], dtype=object)
    return labels[which]
