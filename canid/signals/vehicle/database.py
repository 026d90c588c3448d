"""DBC files (and .kcd, .sym, .arxml, as cantools reads them): messages and signals as plain values."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import NamedTuple

from canid.signals.dbc_text.parsing import Message, ParseError, Parser, Signal
from canid.signals.vehicle.bits import Bits
from canid.signals.vehicle.dbc_repair import by_name, repair_report
from canid.signals.vehicle.file_bytes import read
from canid.signals.vehicle.j1939 import PROTOCOL
from canid.signals.vehicle.mapping import Condition, MessageMap
from canid.signals.vehicle.quoting import several
from canid.values.errors import ConfigError

# bytes of all DBC files of a vehicle together; the largest public one has 0.5 MB, those of whole trucks 2 to 5 MB
MAX_DBC_BYTES = 16_000_000
# bits of a frame of 64 bytes, the longest
_FRAME_BITS = 8 * 64
# lengths of IEEE 754 numbers
_FLOAT_LENGTHS = (16, 32, 64)
# warnings of cantools on one file that are passed on
_MAX_WARNINGS = 5
# files that one file imports, as opendbc's generator knows them: of the same folder, by their bare names
_IMPORT = re.compile(rb'CM_[ \t]*"IMPORT ([A-Za-z0-9_][A-Za-z0-9_-]{0,100}\.dbc)"')
_MAX_IMPORTS = 8
# nested multiplexers; hand-written files have two
_MAX_SELECTOR_DEPTH = 16

# names that DBC authors give a number that counts up from frame to frame (openpilot, AUTOSAR E2E, Vector).
_COUNTER_NAME = re.compile(r"count|alive|rolling|sequence|(^|_)(cnt|ctr)($|_|\d)", re.IGNORECASE)
# names of counts that may rightly stand still: faults of a healthy sender, pulses of a wheel at rest
_NO_COUNTER_NAME = re.compile(r"inval|err|fault|pulse|wheel|press|trip|odo", re.IGNORECASE)


class Dbc(NamedTuple):
    """One DBC file, read."""

    file: str
    bus: int | None
    messages: dict[str, Message]


def load(
    path: Path, bus: int | None, parser: Parser, largest: int = MAX_DBC_BYTES, *, imports: bool = True
) -> tuple[Dbc, list[str], int]:
    """Read one DBC file; one that fails the strict check is read anyway.

    Args:
        path: of the file.
        bus: that it describes; None: any.
        parser: that parses it; all files of a vehicle share its limits.
        largest: bytes that it may have.
        imports: whether files are read too that its comments import (opendbc's generator).

    Returns:
        The file; warnings on what was repaired or left out, with line numbers, and on messages that overlap or do not
        fit; and the file's size in bytes.

    Raises:
        ConfigError: the file is missing, or not a DBC, or without messages, or takes too long to parse.
    """
    data = read(path, largest, "DBC file")
    try:
        content = parser.dbc(path.suffix.lower(), data)
    except ParseError as error:
        raise ConfigError(f"{path} cannot be parsed as a DBC: {brief_sentence(str(error))}") from None
    imported, of_imports, size = _imported(path, bus, data if imports else b"", parser, largest - len(data))
    size += len(data)
    messages, renamed = by_name([*imported, *content.messages])
    if not messages:
        raise ConfigError(f"{path} defines no messages")
    warnings = [f"{path.name}{brief_sentence(line)}" for line in [*repair_report(content), *renamed]]
    warnings += of_imports
    # names and ids that are given twice: said above
    others = [line for line in content.warnings if not line.startswith("Overwriting message")]
    warnings += [f"{path.name}: {brief_sentence(line)}" for line in others[:_MAX_WARNINGS]]
    if len(others) > _MAX_WARNINGS:
        warnings.append(f"{path.name}: {len(others) - _MAX_WARNINGS:,} more such warnings")
    if content.overlapping:
        bad = several(list(content.overlapping))
        warnings.append(
            f"{path.name}: signals overlap or do not fit their frame in {bad}; the file is read anyway"
        )
    far = [f"{m.name}.{s.name}" for m in messages.values() for s in m.signals if _is_far(m, s)]
    if far:
        warnings.append(
            f"{path.name}: {several(far)}: not read, of a message in packets the first {_FRAME_BITS // 8} bytes are"
        )
    return Dbc(path.name, bus, messages), warnings, size


def _is_far(message: Message, signal: Signal) -> bool:
    """Whether a signal of a J1939 message lies behind what a frame can have."""
    return message.protocol == PROTOCOL and 8 * message.length > _FRAME_BITS and not carried(signal)


def _imported(
    path: Path, bus: int | None, data: bytes, parser: Parser, largest: int
) -> tuple[list[Message], list[str], int]:
    """Read the files that opendbc's generator would put before a file: CM_ "IMPORT name.dbc", of the same folder."""
    messages: list[Message] = []
    warnings: list[str] = []
    size = 0
    for name in list(dict.fromkeys(_IMPORT.findall(data)))[:_MAX_IMPORTS]:
        other = path.with_name(name.decode("ascii"))
        if other.name == path.name or not os.path.isfile(other):
            warnings.append(
                f"{path.name}: imports {other.name}, which is not in its folder; its messages are missing"
            )
            continue
        dbc, more, n = load(other, bus, parser, largest - size, imports=False)
        messages += dbc.messages.values()
        warnings += more
        size += n
    return messages, warnings, size


def with_protocol(dbc: Dbc, protocol: str) -> Dbc:
    """The same file, whose messages with 29-bit ids are "j1939", or "can" where the file declares that wrongly."""
    protocol = protocol if protocol == PROTOCOL else ""
    messages = {
        name: message._replace(protocol=protocol if message.extended else "")
        for name, message in dbc.messages.items()
    }
    return dbc._replace(messages=messages)


def brief_sentence(text: str) -> str:
    """Cut a parser's sentence to a line of 200 characters.

    Example:
        >>> brief_sentence("syntax error" + chr(10) + "in line 3"), len(brief_sentence("x" * 10**6))
        ('syntax error in line 3', 200)
    """
    line = " ".join(text[:1000].split())[:200]
    return line if line.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)


def carried(signal: Signal) -> bool:
    """Whether a frame can carry a signal.

    Example:
        >>> one = Signal("S", 0, 8, False, False, False, 1.0, 0.0, None, None, "", {}, False, None, ())
        >>> carried(one), carried(one._replace(length=10**8)), carried(one._replace(start=-1))
        (True, False, False)
    """
    if not 1 <= signal.length <= _FRAME_BITS or not 0 <= signal.start < _FRAME_BITS:
        return False
    if not (math.isfinite(signal.scale) and math.isfinite(signal.offset)):  # 1e999
        return False
    return bits_of(signal).end <= _FRAME_BITS and (not signal.floating or signal.length in _FLOAT_LENGTHS)


def bits_of(signal: Signal) -> Bits:
    """Return the place of a signal in its frame."""
    return Bits(signal.start, signal.length, signal.motorola, signal.signed, signal.floating)


def condition_of(message: Message, signal: Signal) -> Condition | None:
    """Return the selector values for which a multiplexed signal is present, the innermost multiplexer first.

    Returns:
        None where no frame can carry the selectors: they lie outside it, or select each other.
    """
    known = {other.name: other for other in message.signals}
    selectors: list[tuple[Bits, frozenset[int]]] = []
    while signal.multiplexer is not None and signal.pages:
        parent = known.get(signal.multiplexer)
        if parent is None or not carried(parent) or len(selectors) == _MAX_SELECTOR_DEPTH:
            return None
        selectors.append((bits_of(parent), frozenset(signal.pages)))
        signal = parent
    return tuple(selectors)


def message_map(message: Message, bus: int | None, source: int | None = None) -> MessageMap:
    """Describe what decoding and encoding need of a message, apart from its mapped signals."""
    pages: dict[str, set[int]] = {}
    for signal in message.signals:
        for each in (signal, *signal.elsewhere):
            if each.multiplexer is not None:
                pages.setdefault(each.multiplexer, set()).update(each.pages)
    carriers = [signal for signal in message.signals if carried(signal)]
    selectors = tuple(
        (signal.name, bits_of(signal), frozenset(pages.get(signal.name, ())))
        for signal in carriers
        if signal.is_multiplexer
    )
    # A counter under a multiplexer counts its own page only: it does not show that the message is alive.
    counters = [signal for signal in carriers if _COUNTER_NAME.search(signal.name) and not signal.pages]
    # One bit may be a flag, which may rightly stand still.
    counters = [
        signal for signal in counters if signal.length > 1 and not _NO_COUNTER_NAME.search(signal.name)
    ]
    needed_bits = [where.end for _, where, _ in selectors] + [bits_of(signal).end for signal in counters[:1]]
    return MessageMap(
        name=message.name,
        id=message.id,
        extended=message.extended,
        bus=bus,
        length=max(message.length, *[-(-end // 8) for end in needed_bits], 0),
        period=message.period,
        counter=bits_of(counters[0]) if counters else None,
        selectors=selectors,
        protocol=message.protocol,
        source=source,
        container=message.container,
    )
