"""The last value of each signal, and how often its message comes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from canid.analysis.contents import single_frame
from canid.analysis.contents.decoded_frames import DecodedSignal, Decoder, decoded_signals
from canid.analysis.contents.single_frame import Place
from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.drive.signal_columns import MessageFrames, MessageKey, SignalColumn
from canid.signals.dbc_text.parsing import Message, Signal
from canid.values.signal_table import Row
from canid.values.types import Array, Columns

# frames that a rate is of: less than a second of most messages, so that it follows a change
FRAMES_OF_RATE = 32
# rows that are kept: 20 times the signals of a car
MAX_ROWS = 20_000
# frames that wait to be decoded: 12 s of a full bus, 3 MB (8 MB of CAN FD)
MAX_WAITING_FRAMES = 100_000
Key = tuple[MessageKey, str]  # of a message, and its name


class LastValues:
    """Takes frames in the order of time. They wait until rows are asked for: of most messages one frame is read."""

    def __init__(self, decoder: Decoder) -> None:
        """Nothing has come."""
        self._decoder = decoder
        self._waiting: list[Columns] = []
        self._held = 0  # frames in it
        self._time = RecordedTime()  # in which frames came
        self._times: dict[Key, deque[float]] = {}
        # of messages whose signals are in every frame: where they lie, and the last frame with its time
        self._places: dict[Key, tuple[Message, Sequence[Place] | None]] = {}
        self._frames: dict[Key, tuple[float, bytes]] = {}
        # of the others, whose signals come in different frames
        self._signals: dict[Key, dict[str, tuple[float, DecodedSignal]]] = {}
        self._rows = 0

    def take(self, chunks: Iterable[Columns]) -> None:
        """Take the next frames."""
        for chunk in chunks:
            self._waiting.append(chunk)
            self._held += len(chunk.t)
            self._time = self._time.after(chunk.t)
        if self._held >= MAX_WAITING_FRAMES:
            self._read()

    def rows(self, now: float) -> list[Row]:
        """By bus, id and the order in which signals came first; `now`: s, on the frames' clock.

        Example:
            >>> from canid.analysis.contents.binding import DbcFile
            >>> from canid.analysis.contents.log_survey import Wanted
            >>> from canid.signals.dbc_text.parsing import Message, Signal
            >>> from canid.values.frame_columns import columns_of
            >>> from canid.values.types import Frame
            >>> signal = Signal("B", 0, 8, False, False, False, 1.0, 0.0, None, None, "m", {}, False, None, ())
            >>> file = DbcFile("a.dbc", None, [Message("A", 7, False, 1, 0.1, (signal,))])
            >>> values = LastValues(Decoder([file], Wanted()))
            >>> values.take([columns_of([Frame(0.1 * k, 0, 7, bytes([k])) for k in range(11)])])
            >>> values.rows(1.5)
            [Row(bus=0, name='A.B', text='10 m', rate=10.0, age=0.5)]
        """
        self._read()
        return [
            Row(
                key[0].bus,
                f"{key[1]}.{signal.name}",
                signal.text,
                self._time.rate_of(np.array(self._times[key])),
                max(now - t, 0.0),
            )
            for key in sorted({*self._frames, *self._signals})
            for t, signal in self._values(key)
        ]

    def _values(self, key: Key) -> Iterable[tuple[float, DecodedSignal]]:
        if key in self._signals:
            return self._signals[key].values()
        t, data = self._frames[key]
        return ((t, signal) for signal in single_frame.read(self._places[key][1] or (), data))

    def _read(self) -> None:
        """Take over what waits."""
        if not self._held:
            return
        for of_message in self._decoder.messages(self._waiting):
            key = of_message.key, of_message.message.name
            places = self._places_of(key, of_message.message)
            rows, columns = self._decoder.columns(of_message) if places is None else (of_message.frames.t, [])
            if not len(rows):
                continue
            times = of_message.t[rows[-FRAMES_OF_RATE:].astype(int)].tolist()
            self._times.setdefault(key, deque(maxlen=FRAMES_OF_RATE)).extend(times)
            if places is not None:
                self._keep_frame(key, times[-1], of_message.frames, len(places))
            for signal, column in columns:
                self._keep(key, of_message.t, signal, column)
        self._waiting, self._held = [], 0
        # a file may fit another bus better, of which nothing had come
        for last in (self._frames, self._signals):
            for key in [key for key in last if not self._decoder.describes(*key)]:
                del last[key]

    def _places_of(self, key: Key, message: Message) -> Sequence[Place] | None:
        if self._decoder.chooses:
            return None
        known = self._places.get(key)
        if known is None or known[0] is not message:
            self._places[key] = known = message, single_frame.places(message)
        return known[1]

    def _keep_frame(self, key: Key, t: float, frames: MessageFrames, signals: int) -> None:
        if key in self._frames or self._rows + signals <= MAX_ROWS:
            self._rows += 0 if key in self._frames else signals
            self._frames[key] = t, frames.data[-1, : frames.length[-1]].tobytes()

    def _keep(self, key: Key, t: Array, signal: Signal, column: SignalColumn) -> None:
        last = self._signals.setdefault(key, {})
        if len(column.t) and (signal.name in last or self._rows < MAX_ROWS):
            self._rows += signal.name not in last
            newest = SignalColumn(column.t[-1:], column.value[-1:], column.raw[-1:])
            last[signal.name] = float(t[int(column.t[-1])]), decoded_signals(signal, newest)[0]
