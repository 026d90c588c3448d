"""Frames as their database names them: message and the value of each signal, in the order of the frames."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.contents.binding import Binding, DbcFile, bind
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.drive.signal_columns import (
    MessageFrames,
    MessageKey,
    SignalColumn,
    by_message,
    decode,
    is_wide,
    whole_values,
    with_messages,
)
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.bits import payloads
from canid.signals.vehicle.transport_protocol import Transfers, groups_of
from canid.values import frame_columns
from canid.values.types import Array, Columns

# digits of a value: more than a double of 32 bits of a bus has, fewer than show its rounding
DIGITS = 10


class DecodedSignal(NamedTuple):
    """A signal of one frame."""

    name: str
    # physical, in the database's own unit, a whole number of more than 53 bits as Python's; NaN: not in the frame, or
    # stated as not available
    value: float
    unit: str
    choice: str  # what the value table says; "": nothing

    @property
    def text(self) -> str:
        """The value in words, or as a number with its unit.

        >>> DecodedSignal("S", 12.5, "%", "").text, DecodedSignal("S", 1.0, "", "on").text
        ('12.5 %', 'on')
        >>> DecodedSignal("S", math.nan, "m", "").text
        '–'
        """
        if self.choice:
            return self.choice
        return f"{self.number} {self.unit}".rstrip() if math.isfinite(self.value) else "–"

    @property
    def number(self) -> str:
        """The value as a number.

        >>> DecodedSignal("S", 0.1 + 0.2, "%", "").number, DecodedSignal("S", 2**60 + 1, "", "").number
        ('0.3', '1152921504606846977')
        """
        return str(self.value) if isinstance(self.value, int) else f"{self.value:.{DIGITS}g}"


class DecodedFrame(NamedTuple):
    """A frame, or of a container one message in it."""

    t: float  # s since the first frame
    bus: int
    id: int
    extended: bool
    message: str
    signals: tuple[DecodedSignal, ...]


class OfMessage(NamedTuple):
    """A message in some chunks."""

    key: MessageKey
    message: Message
    t: Array  # (n,) s, of all frames of the chunks
    frames: MessageFrames  # of the message; by row instead of time


class Decoder:
    """Decodes chunk after chunk; counts what no file describes."""

    def __init__(self, files: Sequence[DbcFile], wanted: Wanted) -> None:
        """`files`: in the order of the command line."""
        self._files, self._wanted = files, wanted
        self._keys: set[MessageKey] = set()
        self._binding: Binding = bind(files, ())
        self._groups = groups_of(message for file in files for message in file.messages)
        self._transfers: Transfers = {}
        self.frames = 0  # decoded; of a container each message in it
        self.undescribed: dict[MessageKey, int] = {}  # frames

    def decoded(self, chunks: Iterable[Columns]) -> Iterator[DecodedFrame]:
        """The frames of some chunks that go together, those of the files' messages alone."""
        made: dict[int, list[DecodedFrame]] = {}
        for of_message in self.messages(chunks):
            key, message = of_message.key, of_message.message
            rows, columns = self.columns(of_message)
            signals: dict[int, list[DecodedSignal]] = {int(row): [] for row in rows}
            for signal, column in columns:
                for row, decoded in zip(column.t.tolist(), decoded_signals(signal, column), strict=True):
                    signals[int(row)].append(decoded)
            for row, some in signals.items():
                t = float(of_message.t[row])
                frame = DecodedFrame(t, key.bus, key.id, key.extended, message.name, tuple(some))
                made.setdefault(row, []).append(frame)
        for row in sorted(made):
            yield from made[row]

    def messages(self, chunks: Iterable[Columns]) -> Iterator[OfMessage]:
        """The same, message by message and not decoded."""
        self._transfers, joined = with_messages(self._transfers, list(chunks), self._groups)
        chunk = frame_columns.join(joined)
        # rows instead of times: they are the order in which frames came
        rows = chunk._replace(t=np.arange(len(chunk.t), dtype=float))
        rows = frame_columns.select(rows, np.flatnonzero(self._wanted.window.holds(chunk.t)))
        frames_by_key = by_message([rows], ids=self._wanted.ids or None)
        if new := frames_by_key.keys() - self._keys:
            self._keys |= new
            self._binding = bind(self._files, self._keys)
        for key, frames in frames_by_key.items():
            if self._wanted.buses and key.bus not in self._wanted.buses:
                continue
            described = self._binding.find(key)
            if described is None:
                self.undescribed[key] = self.undescribed.get(key, 0) + len(frames.t)
                continue
            for message in described[1]:
                self.frames += 0 if self.chooses else len(frames.t)
                yield OfMessage(key, message, chunk.t, frames)

    @property
    def chooses(self) -> bool:
        """Whether some signals are wanted, not all."""
        return self._wanted.signal is not None

    def describes(self, key: MessageKey, name: str) -> bool:
        """Whether the frames with this key are a message of this name, by all frames so far."""
        described = self._binding.find(key)
        return described is not None and any(message.name == name for message in described[1])

    def columns(self, of_message: OfMessage) -> tuple[Array, list[tuple[Signal, SignalColumn]]]:
        """The rows of a message's frames and its signals, by row, in the order of the file.

        Where signals are chosen: the rows that have one of them.
        """
        _, message, _, frames = of_message
        named, whole = self._wanted.signal, payloads(frames.data, frames.length)
        columns = (
            (signal, decode(message, signal, frames, whole))
            for signal in message.signals
            if named is None or named(f"{message.name}.{signal.name}")
        )
        known = [(signal, column) for signal, column in columns if column is not None]
        rows = frames.t
        if named is not None:
            rows = np.unique(np.concatenate([np.empty(0), *(column.t for _, column in known)]))
            self.frames += len(rows)
        return rows, known


def decoded_signals(signal: Signal, column: SignalColumn) -> list[DecodedSignal]:
    """The values of a column."""
    values: list[float] = column.value.tolist()
    if is_wide(signal):
        whole = zip(whole_values(signal, column), values, strict=True)
        values = [value if exact is None else exact for exact, value in whole]
    texts = column.texts(signal)
    return [
        DecodedSignal(signal.name, value, signal.unit, text)
        for value, text in zip(values, texts, strict=True)
    ]
