"""Reads DBC files (by cantools: also .kcd, .sym, .arxml) and describes their signals as plain values."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from canid.errors import ConfigError
from canid.imports import without
from canid.vehicle.bits import Bits
from canid.vehicle.mapping import Condition, MessageMap

if TYPE_CHECKING:
    from cantools.database.can import Database, Message, Signal

# What DBC authors call a number that counts up from frame to frame (openpilot, AUTOSAR E2E, Vector).
_COUNTER = re.compile(r"count|alive|rolling|sequence|(^|_)(cnt|ctr)($|_|\d)", re.IGNORECASE)
# Counts something that may rightly stand still: faults of a healthy sender, pulses of a wheel at rest.
_NOT_ALIVE = re.compile(r"inval|err|fault|pulse|wheel|press|trip|odo", re.IGNORECASE)


class Dbc(NamedTuple):
    """One DBC file, read."""

    file: str
    bus: int | None
    messages: dict[str, Message]


def load(path: Path, bus: int | None) -> tuple[Dbc, list[str]]:
    """Read one DBC file; one that fails the strict check is read all the same.

    Returns:
        The file, and at most one warning that names the messages which overlap or do not fit.

    Raises:
        ConfigError: the file is missing, or no DBC at all, or without messages.
    """
    if path.is_dir():
        raise ConfigError(f"{path} is a folder: name a DBC file in it")
    if not path.is_file():
        raise ConfigError(f"DBC file {path} does not exist")
    database, warnings = _parse(path)
    messages = {message.name: message for message in database.messages}
    if not messages:
        raise ConfigError(f"{path} holds no messages")
    bad = [name for name, message in messages.items() if not _is_strict(message)]
    if bad:
        warnings.append(
            f"{path.name}: signals overlap or do not fit their frame in {', '.join(bad)}; read all the same"
        )
    return Dbc(path.name, bus, messages), warnings


def _parse(path: Path) -> tuple[Database, list[str]]:
    # cantools takes 0.2 s to import: only who reads a vehicle pays for it, and nobody for what its own imports drag in
    with without("asammdf"):
        import cantools

    with _collected("cantools") as said:
        try:
            loaded = cantools.database.load_file(path, strict=False)
        except (cantools.Error, ValueError, KeyError, OSError, UnicodeError) as error:
            line = " ".join(str(error).split())[:160]
            # cantools marks the place with signs of its own, inside the quoted line
            place = re.search(r"line \d+, column \d+", line)
            what = f"syntax error in {place[0]}" if place else line
            raise ConfigError(f"{path} is no DBC that can be read: {what}") from error
    if not isinstance(loaded, cantools.database.can.Database):
        raise ConfigError(f"{path} is a diagnostics file, not a DBC")
    return loaded, [f"{path.name}: {line}" for line in said]


@contextmanager
def _collected(logger_name: str) -> Iterator[list[str]]:
    """Collect what a library logs as a warning, instead of printing it."""
    said: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    logger, handler = logging.getLogger(logger_name), Collect(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagate


def _is_strict(message: Message) -> bool:
    import cantools

    try:
        message.refresh(strict=True)
    except cantools.Error:
        message.refresh(strict=False)
        return False
    return True


def bits_of(signal: Signal) -> Bits:
    """Tell where a signal lies."""
    motorola = signal.byte_order == "big_endian"
    return Bits(signal.start, signal.length, motorola, signal.is_signed, signal.is_float)


def condition_of(message: Message, signal: Signal) -> Condition:
    """Tell which selectors must hold what for `signal` to be there, the innermost multiplexer first."""
    found: list[tuple[Bits, frozenset[int]]] = []
    while signal.multiplexer_signal is not None and signal.multiplexer_ids:
        parent = message.get_signal_by_name(signal.multiplexer_signal)
        found.append((bits_of(parent), frozenset(signal.multiplexer_ids)))
        signal = parent
    return tuple(found)


def message_map(message: Message, bus: int | None) -> MessageMap:
    """Describe what decoding and encoding need of a message beside its mapped signals."""
    selectors = tuple(
        (
            s.name,
            bits_of(s),
            frozenset(
                i for o in message.signals if o.multiplexer_signal == s.name for i in o.multiplexer_ids or ()
            ),
        )
        for s in message.signals
        if s.is_multiplexer
    )
    # A counter under a multiplexer counts its own page only: not a sign of life of the message.
    counters = [s for s in message.signals if _COUNTER.search(s.name) and not s.multiplexer_ids]
    # One bit may be a flag: two states that stand still prove nothing.
    counters = [s for s in counters if s.length > 1 and not _NOT_ALIVE.search(s.name)]
    return MessageMap(
        name=message.name,
        id=message.frame_id,
        extended=message.is_extended_frame,
        bus=bus,
        length=message.length,
        period=message.cycle_time / 1000 if message.cycle_time else math.nan,
        counter=bits_of(counters[0]) if counters else None,
        selectors=selectors,
    )
