"""Parsing of untrusted files (TOML by tomllib, DBC by cantools) in a child process with limits.

Such a file can exhaust its parser in many ways: nesting, dotted keys, ranges that are expanded, lengths of 10^8 bits,
loops of multiplexers. None of them is checked for here; the parser has limits of CPU time and memory, no rights to write,
send or start anything (`confinement`), and returns plain tuples. The recorder's process is not delayed by it either.
"""

from __future__ import annotations

import logging
import math
import re
import signal
import sys
from collections import OrderedDict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Self

from canid.signals.dbc_text import (
    Container,
    Content,
    Message,
    Repair,
    Signal,
    containers,
    decoded,
    read_tolerantly,
)
from canid.signals.dbc_text.attributes import declared
from canid.signals.dbc_text.message_lines import name_in
from canid.signals.dbc_text.overlap import overlaps
from canid.signals.dbc_text.string_ends import marked, unmarked
from canid.values.processes import child_process, limits, plain_values
from canid.values.processes.child import EXIT_S, Child, NoAnswerError
from canid.values.processes.confinement import confine
from canid.values.processes.import_guard import without
from canid.values.processes.serve import connect

if TYPE_CHECKING:
    from cantools.database.can import Database as CantoolsDatabase
    from cantools.database.can import Message as CantoolsMessage
    from cantools.database.can import Signal as CantoolsSignal

__all__ = ["Container", "Content", "Message", "ParseError", "Parser", "Repair", "Signal", "signal_fields"]

# s of processor time for all files of a vehicle together, and for each of their signals besides: on an idle laptop
# 30,000 signals take 2.6 s and 16,000 1.4 s, the largest public DBC (J1939, 6,000 lines of signals) 0.3 s
CPU_S, CPU_S_PER_SIGNAL = 3.0, 0.0002
# on a machine so slow that the child's own start takes long, this many times that: 0.2 s on a laptop
CPU_STARTS = 16.0
# bytes that parsing may take in addition to interpreter and cantools (30 MB): 20,000 signals take 65 to 90 MB
MEMORY_BYTES = 160_000_000
# signals in a file; complete vehicle networks have 10,000 to 20,000
MAX_SIGNALS = 30_000
# bytes of an answer: 30,000 signals with their texts are 10 MB
MAX_ANSWER_BYTES = 24_000_000
# repairs that are reported one by one; a file with more has the same one on every line
MAX_REPAIRS = 2_000
# s; where the system has no limit of processor time, or the child was stopped
WALL_S = 120.0
# answers kept, and the largest of them (bytes): reading a vehicle again takes no time
KEPT_ANSWERS, MAX_KEPT_BYTES = 16, 2_000_000


class ParseError(ValueError):
    """The file is invalid; the text is the reason, without the file's name."""


# each of its operations is atomic: threads share it
_kept: OrderedDict[tuple[str, str, bytes], bytes] = OrderedDict()


class Parser:
    """The child process, started when it is first needed; one budget for all its requests."""

    def __init__(self) -> None:
        """The child is started when it is first needed."""
        self._child: Child | None = None

    def __enter__(self) -> Self:
        """Parse within this context."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the child."""
        if self._child is not None:
            self._child.end()
        self._child = None

    def toml(self, data: bytes) -> dict[str, Any]:
        """Parse TOML.

        Raises:
            ParseError: it is none, or takes too long.

        Example:
            >>> with Parser() as parser:
            ...     parser.toml(b"a = [1]")
            {'a': [1]}
        """
        table: dict[str, Any] = self._ask("toml", "", data)
        return table

    def dbc(self, suffix: str, data: bytes) -> Content:
        """Parse a DBC, or another format that cantools reads by its suffix.

        Raises:
            ParseError: it is none, or takes too long.
        """
        messages, warnings, overlapping, repairs, left_out = self._ask("dbc", suffix, data)
        made = []
        for name, id_, extended, length, period, signals, protocol, container in messages:
            each = tuple([_unmarked(Signal(*signal)) for signal in signals])
            within = None if container is None else Container(*container)
            made.append(Message(name, id_, extended, length, period, each, protocol, within))
        return Content(
            tuple(made),
            tuple(warnings),
            tuple(overlapping),
            tuple([Repair(fields[0], fields[1], unmarked(fields[2]), *fields[3:]) for fields in repairs]),
            tuple([Repair(fields[0], fields[1], unmarked(fields[2]), *fields[3:]) for fields in left_out]),
        )

    def _ask(self, kind: str, suffix: str, data: bytes) -> Any:
        key = (kind, suffix, sha256(data).digest())
        answer = _kept.get(key)
        if answer is None:
            answer = self._answer(kind, suffix, data)
            if len(answer) <= MAX_KEPT_BYTES:
                _kept[key] = answer
                while len(_kept) > KEPT_ANSWERS:
                    _kept.popitem(last=False)
        try:
            status, content = plain_values.loads(answer, (Signal, Message, Container, Repair))
        except Exception as error:  # of a parser that a file has taken over: pickle raises errors of any kind
            raise ParseError(f"its parser answers nonsense ({type(error).__name__})") from None
        if status == "bad":
            raise ParseError(content)
        return content

    def _answer(self, kind: str, suffix: str, data: bytes) -> bytes:
        try:
            if self._child is None:
                self._child = Child(child_process.command("canid.signals.dbc_text.parsing"), answers=())
            answer: bytes = self._child.ask((kind, suffix, data), WALL_S)
            return answer
        except OSError as error:
            raise ParseError(f"no process can be started to parse it ({error})") from None
        except NoAnswerError:
            assert self._child is not None
            code = self._child.end(EXIT_S)
        if code == -getattr(signal, "SIGPROF", 0):
            raise ParseError(f"it takes more than {CPU_S + _signals_s(data):.2g} s to parse")
        raise ParseError(f"its parser ended without an answer (code {code})")


def _unmarked(signal: Signal) -> Signal:
    if not any(unmarked(text) != text for text in (signal.unit, *signal.choices.values())):
        return signal
    return signal._replace(
        unit=unmarked(signal.unit), choices={raw: unmarked(text) for raw, text in signal.choices.items()}
    )


# --- in the child ---------------------------------------------------------------------------------------


def main() -> int:
    """Answer requests until the input ends: ("ok", content) or ("bad", why), pickled."""
    parent = connect(plain=True)
    sys.setrecursionlimit(1000)
    left = _budget()
    of_signals = CPU_S_PER_SIGNAL * MAX_SIGNALS
    confined = False
    for kind, suffix, data in parent.messages():
        if kind == "dbc":
            # cantools takes 0.2 s to import: not part of a file's budget. It would also import asammdf
            with without("asammdf"):
                import cantools  # noqa: F401
            left = max(left, _budget()) if left == CPU_S else left
            more = min(_signals_s(data), of_signals)
            left, of_signals = left + more, of_signals - more
        if not confined:
            confine()
            confined = True
        limits.limit_more_data(MEMORY_BYTES)
        limits.limit_cpu(left)
        answer = _answered(kind, suffix, data)
        left = max(limits.limit_cpu(0.0), 0.01)
        limits.limit_data(None)
        parent.answer(answer)
    return 0


def _budget() -> float:
    return max(CPU_S, CPU_STARTS * limits.cpu_used_s())


_A_SIGNAL = re.compile(rb"(?m)^[ \t]*(?:SG_[ \t]|Sig=)|<(?:Signal|I-SIGNAL)[ >]")


def _signals_s(data: bytes) -> float:
    """The time that the signals of a file are worth, in s of processor time."""
    return CPU_S_PER_SIGNAL * min(len(_A_SIGNAL.findall(data.replace(b"\0", b""))), MAX_SIGNALS)


def _answered(kind: str, suffix: str, data: bytes) -> bytes:
    try:
        content = _toml(data) if kind == "toml" else _dbc(suffix, data)
        answer = plain_values.dumps(("ok", content))
        if len(answer) <= MAX_ANSWER_BYTES:
            return answer
        why = f"it describes more than {MAX_ANSWER_BYTES / 1e6:g} MB"
    except ParseError as error:
        why = str(error)
    except Exception as error:  # of any kind: the file is invalid
        why = _line(error)
    return plain_values.dumps(("bad", why))


def _line(error: BaseException) -> str:
    # cantools wraps other exceptions
    causes = (error, error.__cause__, error.__context__)
    if any(isinstance(cause, MemoryError) for cause in causes):
        return f"it takes more than {MEMORY_BYTES / 1e6:g} MB to parse"
    if any(isinstance(cause, RecursionError) for cause in causes):
        return "it is nested too deeply"
    line = " ".join(str(error).split())[:160]
    # cantools marks the place with signs of its own, inside the quoted line
    place = re.search(r"line \d+, column \d+", line)
    return f"syntax error in {place[0]}" if place else line or type(error).__name__


def _toml(data: bytes) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(data.decode("utf-8"))


_FORMATS = (".dbc", ".sym", ".kcd", ".arxml", ".cdd")


def _dbc(suffix: str, data: bytes) -> Any:
    import cantools

    text = decoded(data)
    if suffix == ".dbc":
        text = marked(text)
    lines = len(re.findall(r"(?m)^[ \t]*SG_[ \t]", text))
    if lines > MAX_SIGNALS:
        raise ParseError(f"it has {lines:,} signals, more than {MAX_SIGNALS:,}")
    long_headers = containers.long_headers(text) if suffix == ".arxml" else frozenset()
    with _collected("cantools") as warnings:
        try:
            loaded = cantools.database.load_string(
                containers.with_short_headers(text) if long_headers else text,
                suffix[1:] if suffix in _FORMATS else None,
                strict=False,
            )
        except Exception as error:
            if suffix != ".dbc" or _of_limits(error):
                raise
            return _tolerant(text, error)
    if not isinstance(loaded, cantools.database.can.Database):
        raise ParseError("it is a diagnostics file, not a DBC")
    if suffix == ".dbc" and _lost_end(text, loaded):
        return _tolerant(text, ValueError("the file ends within a signal"))
    if suffix == ".dbc" and _without_selector(text, loaded):
        return _tolerant(text, ValueError("multiplexed signals of which nothing says what selects them"))
    every = [*loaded.messages, *(part for message in loaded.messages for part in message.contained_messages)]
    if sum(len(message.signals) for message in every) > MAX_SIGNALS:
        raise ParseError(f"it has more than {MAX_SIGNALS:,} signals")
    messages = _messages(loaded, long_headers, containers.long_ids(text) if long_headers else {})
    return messages, warnings, [message.name for message in every if not _is_strict(message)], (), ()


def _tolerant(text: str, error: Exception) -> Any:
    """Read a DBC that cantools refuses."""
    content = read_tolerantly(text)
    if not content.messages:
        first = content.left_out[0] if content.left_out else None
        raise ParseError(_line(error) if first is None else f"line {first.line}, {first.was!r}: {first.now}")
    repairs = content.repairs
    if not repairs and not content.left_out:
        repairs = (Repair(1, "other", _line(error), "read line by line"),)
    messages = [tuple(message) for message in content.messages]
    return messages, (), content.overlapping, repairs[:MAX_REPAIRS], content.left_out[:MAX_REPAIRS]


def _lost_end(text: str, loaded: CantoolsDatabase) -> bool:
    """Whether cantools has dropped the signal in whose middle the file ends: it does so without a word."""
    last = text.rstrip().rpartition("\n")[2].strip()
    if not last.startswith("SG_"):
        return False
    return not loaded.messages or name_in(last) not in {signal.name for signal in loaded.messages[-1].signals}


_PAGED = re.compile(r"(?m)^[ \t]*(?:BO_[ \t]+(\d{1,10})[ \t]|SG_[ \t]+(\S{1,128})[ \t]+m\d+M?[ \t]*:)")


def _without_selector(text: str, loaded: CantoolsDatabase) -> bool:
    """Whether a signal is on a page, and nothing says of which selector: cantools decodes it in every frame.

    So it is where a message has two selectors (m0M) or none, and no SG_MUL_VAL_ says which one is meant.
    """
    free = {
        (message.frame_id | message.is_extended_frame << 31, signal.name)
        for message in loaded.messages
        for signal in message.signals
        if signal.multiplexer_signal is None
    }
    id_ = 0
    for begins, name in _PAGED.findall(text):
        id_ = int(begins or id_)
        if name and (id_, name) in free:
            return True
    return False


def _of_limits(error: BaseException) -> bool:
    causes = (error, error.__cause__, error.__context__)
    return any(isinstance(cause, MemoryError | RecursionError) for cause in causes)


@contextmanager
def _collected(logger_name: str) -> Iterator[list[str]]:
    """Collect what a library logs as a warning, instead of printing it."""
    warnings: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            warnings.append(record.getMessage())

    logger, handler = logging.getLogger(logger_name), Collect(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield warnings
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagate


def _is_strict(message: CantoolsMessage) -> bool:
    import cantools

    try:
        message.refresh(strict=True)
    except cantools.Error:
        names = {signal.name for signal in message.signals}
        if len(names) == len(message.signals):
            return False
        # by its names cantools cannot distinguish the pages of one signal
        name, id_, extended, length, period, signals, *_ = _message(message, (0, False), "", None)
        return not overlaps(
            Message(name, id_, extended, length, period, tuple(Signal(*fields) for fields in signals))
        )
    return True


def _messages(
    loaded: CantoolsDatabase, long_headers: Collection[str], long_ids: Mapping[str, int]
) -> list[tuple[Any, ...]]:
    """Fields of `Message` of each message; those in a container frame follow it."""
    file_wide = _attribute(loaded, "ProtocolType")
    out = []
    for message in loaded.messages:
        frame = (message.frame_id, message.is_extended_frame)
        by_message = message.dbc is not None and "VFrameFormat" in message.dbc.attributes
        frame_format = "J1939PG" if message.protocol == "j1939" else ""
        out.append(_message(message, frame, declared(frame_format, by_message, file_wide, frame[1]), None))
        for part in message.contained_messages:
            within = containers.container_of(message, part, long_headers, long_ids)
            out.append(_message(part, frame, "", within))
    return out


def _attribute(loaded: CantoolsDatabase, name: str) -> str:
    """An attribute of the whole file, else its default."""
    if loaded.dbc is None:
        return ""
    attribute = loaded.dbc.attributes.get(name)
    definition = loaded.dbc.attribute_definitions.get(name)
    return str(
        attribute.value if attribute is not None else (definition.default_value or "") if definition else ""
    )


def _message(
    message: CantoolsMessage, frame: tuple[int, bool], protocol: str, container: Container | None
) -> tuple[Any, ...]:
    period = message.cycle_time / 1000 if message.cycle_time else math.nan
    signals = [signal_fields(signal) for signal in message.signals]
    return (message.name, *frame, message.length, period, signals, protocol, container)


def signal_fields(signal: CantoolsSignal) -> tuple[Any, ...]:
    """Return the fields of `Signal` of a signal of cantools."""
    return (
        signal.name,
        signal.start,
        signal.length,
        signal.byte_order == "big_endian",
        signal.is_signed,
        signal.is_float,
        _number(signal.scale),
        _number(signal.offset),
        None if signal.minimum is None else _number(signal.minimum),
        None if signal.maximum is None else _number(signal.maximum),
        signal.unit or "",
        {int(raw): str(text) for raw, text in (signal.choices or {}).items()},
        bool(signal.is_multiplexer),
        signal.multiplexer_signal,
        tuple(signal.multiplexer_ids or ()),
        int(signal.spn or 0),
    )


def _number(value: Any) -> float:
    """A number of a file; NaN where no float holds it."""
    try:
        return float(value)
    except (OverflowError, ValueError):
        return math.nan


if __name__ == "__main__":
    sys.exit(main())
