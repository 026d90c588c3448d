"""Parsing of untrusted files (TOML by tomllib, DBC by cantools) in a child process with limits.

Such a file can exhaust its parser in many ways: nesting, dotted keys, ranges that are expanded, lengths of 10^8 bits,
loops of multiplexers. None of them is checked for here; the parser has limits of CPU time and memory, and returns plain
tuples. The recorder's process is not delayed by it either.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from canid import child_process
from canid.dbc_text import Container, Content, Message, Repair, Signal, containers, decoded, read_tolerantly
from canid.dbc_text.attributes import declared
from canid.dbc_text.message_lines import name_in
from canid.import_guard import without

if TYPE_CHECKING:
    from cantools.database.can import Database as CantoolsDatabase
    from cantools.database.can import Message as CantoolsMessage
    from cantools.database.can import Signal as CantoolsSignal

__all__ = ["Container", "Content", "Message", "ParseError", "Parser", "Repair", "Signal", "signal_fields"]

# s of processor time for all files of a vehicle together. 30,000 signals take 2.6 s on a laptop, the largest public
# DBC (J1939, 6,000 lines of signals) 0.3 s
CPU_S = 3.0
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


_kept: OrderedDict[tuple[str, str, bytes], bytes] = OrderedDict()
_keeping = threading.Lock()


class Parser:
    """The child process, started when it is first needed; one budget for all its requests."""

    def __init__(self) -> None:
        """The child is started when it is first needed."""
        self._child: subprocess.Popen[bytes] | None = None
        self._watch: threading.Timer | None = None

    def __enter__(self) -> Self:
        """Parse within this context."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the child."""
        if self._watch is not None:
            self._watch.cancel()
        if self._child is not None:
            self._child.kill()
            for stream in (self._child.stdin, self._child.stdout):
                if stream is not None:
                    with suppress(OSError):
                        stream.close()
            self._child.wait()
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
            each = tuple([Signal(*signal) for signal in signals])
            within = None if container is None else Container(*container)
            made.append(Message(name, id_, extended, length, period, each, protocol, within))
        return Content(
            tuple(made),
            tuple(warnings),
            tuple(overlapping),
            tuple([Repair(*one) for one in repairs]),
            tuple([Repair(*one) for one in left_out]),
        )

    def _ask(self, kind: str, suffix: str, data: bytes) -> Any:
        key = (kind, suffix, sha256(data).digest())
        with _keeping:
            answer = _kept.get(key)
        if answer is None:
            answer = self._answer(kind, suffix, data)
            if len(answer) <= MAX_KEPT_BYTES:
                with _keeping:
                    _kept[key] = answer
                    while len(_kept) > KEPT_ANSWERS:
                        _kept.popitem(last=False)
        status, content = pickle.loads(answer)
        if status == "bad":
            raise ParseError(content)
        return content

    def _answer(self, kind: str, suffix: str, data: bytes) -> bytes:
        try:
            running = self._running()
            assert running.stdin is not None
            assert running.stdout is not None
            pickle.dump((kind, suffix, data), running.stdin, protocol=5)
            running.stdin.flush()
            answer: bytes = pickle.load(running.stdout)
            return answer
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            raise ParseError(self._failure(error)) from None

    def _running(self) -> subprocess.Popen[bytes]:
        if self._child is None:
            self._child = subprocess.Popen(
                child_process.command("canid.parsing"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            self._watch = threading.Timer(WALL_S, self._child.kill)
            self._watch.daemon = True
            self._watch.start()
        return self._child

    def _failure(self, error: BaseException) -> str:
        """Why there is no answer."""
        if self._child is None:
            return f"no process can be started to parse it ({error})"
        code = self._child.wait()
        if code == -getattr(signal, "SIGPROF", 0):
            return f"it takes more than {CPU_S:g} s to parse"
        return f"its parser ended without an answer (code {code})"


# --- in the child ---------------------------------------------------------------------------------------


def main() -> int:
    """Answer requests until the input ends: ("ok", content) or ("bad", why), pickled."""
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # nothing that a parser prints gets between the answers
    sys.setrecursionlimit(1000)
    left = _budget()
    while True:
        try:
            kind, suffix, data = pickle.load(source)
        except EOFError:
            return 0
        if kind == "dbc":
            # cantools takes 0.2 s to import: not part of a file's budget. It would also import asammdf
            with without("asammdf"):
                import cantools  # noqa: F401
            left = max(left, _budget()) if left == CPU_S else left
        with _limited(left) as rest:
            answer = _answered(kind, suffix, data)
        left = max(rest[0], 0.01)
        pickle.dump(answer, sink, protocol=5)
        sink.flush()


def _budget() -> float:
    return max(CPU_S, CPU_STARTS * time.process_time())


@contextmanager
def _limited(cpu: float) -> Iterator[list[float]]:
    """End this process where it takes more; the list holds what is left of the processor time."""
    rest = [cpu]
    try:
        import resource
    except ImportError:  # no POSIX: the parent ends the child by the clock
        yield rest
        return
    with suppress(OSError, ValueError, IndexError):
        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[5]) * resource.getpagesize()
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        soft = used + MEMORY_BYTES if hard == resource.RLIM_INFINITY else min(used + MEMORY_BYTES, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
    signal.setitimer(signal.ITIMER_PROF, cpu)
    try:
        yield rest
    finally:
        rest[0] = signal.setitimer(signal.ITIMER_PROF, 0.0)[0]
        with suppress(OSError, ValueError):
            hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
            resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _answered(kind: str, suffix: str, data: bytes) -> bytes:
    try:
        content = _toml(data) if kind == "toml" else _dbc(suffix, data)
        answer = pickle.dumps(("ok", content), protocol=5)
        if len(answer) <= MAX_ANSWER_BYTES:
            return answer
        why = f"it describes more than {MAX_ANSWER_BYTES / 1e6:g} MB"
    except ParseError as error:
        why = str(error)
    except Exception as error:  # of any kind: the file is invalid
        why = _line(error)
    return pickle.dumps(("bad", why), protocol=5)


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
    messages = [tuple(of) for of in content.messages]
    return messages, (), content.overlapping, repairs[:MAX_REPAIRS], content.left_out[:MAX_REPAIRS]


def _lost_end(text: str, loaded: CantoolsDatabase) -> bool:
    """Whether cantools has dropped the signal in whose middle the file ends: it does so without a word."""
    last = text.rstrip().rpartition("\n")[2].strip()
    if not last.startswith("SG_"):
        return False
    return not loaded.messages or name_in(last) not in {signal.name for signal in loaded.messages[-1].signals}


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
        return False
    return True


def _messages(
    loaded: CantoolsDatabase, long_headers: Collection[str], long_ids: Mapping[str, int]
) -> list[tuple[Any, ...]]:
    """Fields of `Message` of each message; those in a container frame follow it."""
    file_wide = _attribute(loaded, "ProtocolType")
    out = []
    for message in loaded.messages:
        frame = (message.frame_id, message.is_extended_frame)
        own = message.dbc is not None and "VFrameFormat" in message.dbc.attributes
        frame_format = "J1939PG" if message.protocol == "j1939" else ""
        out.append(_message(message, frame, declared(frame_format, own, file_wide, frame[1]), None))
        for part in message.contained_messages:
            within = containers.container_of(message, part, long_headers, long_ids)
            out.append(_message(part, frame, "", within))
    return out


def _attribute(loaded: CantoolsDatabase, name: str) -> str:
    """An attribute of the whole file, else its default."""
    if loaded.dbc is None:
        return ""
    own = loaded.dbc.attributes.get(name)
    definition = loaded.dbc.attribute_definitions.get(name)
    return str(own.value if own is not None else (definition.default_value or "") if definition else "")


def _message(
    message: CantoolsMessage, frame: tuple[int, bool], protocol: str, container: Container | None
) -> tuple[Any, ...]:
    period = message.cycle_time / 1000 if message.cycle_time else math.nan
    signals = [signal_fields(signal) for signal in message.signals]
    return (message.name, *frame, message.length, period, signals, protocol, container)


def signal_fields(of: CantoolsSignal) -> tuple[Any, ...]:
    """Return the fields of `Signal` of a signal of cantools."""
    return (
        of.name,
        of.start,
        of.length,
        of.byte_order == "big_endian",
        of.is_signed,
        of.is_float,
        _number(of.scale),
        _number(of.offset),
        None if of.minimum is None else _number(of.minimum),
        None if of.maximum is None else _number(of.maximum),
        of.unit or "",
        {int(raw): str(text) for raw, text in (of.choices or {}).items()},
        bool(of.is_multiplexer),
        of.multiplexer_signal,
        tuple(of.multiplexer_ids or ()),
        int(of.spn or 0),
    )


def _number(value: Any) -> float:
    """A number of a file; NaN where no float holds it."""
    try:
        return float(value)
    except (OverflowError, ValueError):
        return math.nan


if __name__ == "__main__":
    sys.exit(main())
