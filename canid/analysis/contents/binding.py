"""Which DBC file describes which bus: as the command line says, or where its messages occur."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from canid.analysis.drive.signal_columns import MessageKey
from canid.signals.dbc_text.parsing import Message
from canid.signals.vehicle.j1939 import PROTOCOL, pgn_of
from canid.values.log_contents import Database

# share of the messages of a file's best bus that another bus must have, for the file to be used there too: a mirrored
# bus has all, a bus of another kind a few ids by chance
SECOND_BUS_SHARE = 0.5


class DbcFile(NamedTuple):
    """A DBC file as the command line names it."""

    file: str
    bus: int | None  # it is bound to; None: where it fits
    messages: Sequence[Message]


class _Index(NamedTuple):
    by_id: dict[tuple[int, bool], list[Message]]
    by_group: dict[int, list[Message]]  # J1939: parameter group -> messages

    def find(self, key: MessageKey) -> list[Message] | None:
        messages = self.by_id.get((key.id, key.extended))
        if messages is None and key.extended and self.by_group:
            messages = self.by_group.get(pgn_of(key.id))
        return messages


class Binding(NamedTuple):
    """Files on buses."""

    files: tuple[DbcFile, ...]
    indices: tuple[_Index, ...]
    order: dict[int, tuple[int, ...]]  # bus -> numbers of the files that describe it, the best one first

    def find(self, key: MessageKey) -> tuple[str, list[Message]] | None:
        """The message of an id (of a container: those in it), and the file that describes it; None: no file does.

        Where no frame had come yet from a bus when files were bound, it has no file but those that are bound to it.
        """
        for number in self.order.get(key.bus, ()):
            messages = self.indices[number].find(key)
            if messages is not None:
                return self.files[number].file, messages
        return None


def bind(files: Sequence[DbcFile], keys: Collection[MessageKey]) -> Binding:
    """Bind files to buses.

    Args:
        files: in the order of the command line.
        keys: ids that occur.

    Example:
        >>> from canid.signals.dbc_text.parsing import Message
        >>> dbc = DbcFile("a.dbc", None, [Message("A", 1, False, 8, 0.1, ()), Message("B", 2, False, 8, 0.1, ())])
        >>> bound = bind([dbc], [MessageKey(0, 1, False), MessageKey(3, 1, False), MessageKey(3, 2, False)])
        >>> bound.order
        {0: (0,), 3: (0,)}
    """
    indices = tuple(_index(dbc.messages) for dbc in files)
    buses = sorted({key.bus for key in keys})
    matches = [Counter(dict.fromkeys(buses, 0)) for _ in indices]
    for index, on in zip(indices, matches, strict=True):
        on.update(key.bus for key in keys if index.find(key) is not None)
    order: dict[int, list[tuple[bool, int, int]]] = {}
    for number, (dbc, on) in enumerate(zip(files, matches, strict=True)):
        best = max(on.values(), default=0)
        fits = [bus for bus in buses if on[bus] and on[bus] >= SECOND_BUS_SHARE * best]
        for bus in fits if dbc.bus is None else [dbc.bus]:
            order.setdefault(bus, []).append((dbc.bus is None, -on.get(bus, 0), number))
    ranked = {bus: tuple(number for *_, number in sorted(entries)) for bus, entries in sorted(order.items())}
    return Binding(tuple(files), indices, ranked)


def databases(bound: Binding, keys: Iterable[MessageKey]) -> tuple[Database, ...]:
    """The files, on which buses they are used, and how many of their messages occur there."""
    keys = list(keys)
    out = []
    for number, dbc in enumerate(bound.files):
        on = {bus: None for bus, numbers in bound.order.items() if number in numbers}
        names = {
            message.name for key in keys if key.bus in on for message in bound.indices[number].find(key) or ()
        }
        out.append(Database(dbc.file, tuple(on), dbc.bus is not None, len(dbc.messages), len(names)))
    return tuple(out)


def _index(messages: Iterable[Message]) -> _Index:
    by_id: dict[tuple[int, bool], list[Message]] = {}
    by_group: dict[int, list[Message]] = {}
    for message in messages:
        _enter(by_id.setdefault((message.id, message.extended), []), message)
        if message.protocol == PROTOCOL and message.extended:
            _enter(by_group.setdefault(pgn_of(message.id), []), message)
    return _Index(by_id, by_group)


def _enter(known: list[Message], message: Message) -> None:
    """Messages in a container follow it and share its id; of others with the same id the first one counts."""
    if not known or message.container is not None:
        known.append(message)
