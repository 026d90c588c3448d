"""Messages of python-can as frames of one session: bus numbers, and one clock for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from canid.io.buses import messages
from canid.io.buses.frame_check import MAX_STAMP_NS, ImpossibleFrameError, why_impossible
from canid.values import timestamps
from canid.values.types import Frame

_EPOCH_FLOOR_NS = timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S


class MessageStamps:
    """Makes frames of messages, with times since the first one.

    Args:
        channels: `Message.channel` of bus 0, 1, ...; further channels are numbered as they come.

    >>> from canid.io.buses import python_can
    >>> stamps, message = MessageStamps(), python_can.load().Message
    >>> stamps.frame(message(1.6e9, 7, is_extended_id=False, channel="can0"), 0)
    Frame(t=0.0, bus=0, id=7, data=b'', flags=0, length=-1)
    >>> stamps.frame(message(1.6e9 + 0.25, 8, is_extended_id=False, channel="can1"), 0)[:3]
    (0.25, 1, 8)
    """

    def __init__(self, channels: Sequence[Any] = ()) -> None:
        """Begin without a frame."""
        self._numbers: dict[Any, int] = {_key(channel): k for k, channel in enumerate(channels)}
        self._offsets: dict[int, int] = {}  # bus -> ns, of a clock that does not count from 1970
        self._first_ns: int | None = None

    def frame(self, message: Any, arrived_ns: int) -> Frame:
        """Make a frame; `arrived_ns`: when it came, ns since 1970.

        A clock with a zero of its own (some drivers count from the start of the measurement) is set against the time
        at which its first message came, so that two buses with different clocks are one session.

        Raises:
            ImpossibleFrameError: no bus can carry it. Other exceptions where it is no message.
        """
        got = messages.received_of(message, arrived_ns)
        why = why_impossible(got)
        if why:
            raise ImpossibleFrameError(why)
        key = _key(message.channel)
        bus = self._numbers.get(key)
        if bus is None:
            bus = self._numbers[key] = len(self._numbers)
        ns = got.ns
        if ns < _EPOCH_FLOOR_NS:
            ns += self._offsets.setdefault(bus, arrived_ns - ns)
        if not 0 <= ns <= MAX_STAMP_NS:
            raise ImpossibleFrameError("a time stamp that no log can hold")
        if self._first_ns is None:
            self._first_ns = ns
        return Frame((ns - self._first_ns) * 1e-9, bus, got.id, got.data, got.flags, got.length)


def _key(channel: Any) -> Any:
    """A channel as a key: python-can gives numbers, names, or what a back end happens to have."""
    return channel if isinstance(channel, str | int | None) else repr(channel)
