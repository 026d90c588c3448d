"""The signals of a single frame, without arrays: for one frame they take ten times as long as the numbers themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from canid.analysis.contents.decoded_frames import DecodedSignal
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.bits import EXACT_BITS, Bits, raw_of
from canid.signals.vehicle.database import bits_of, carried
from canid.signals.vehicle.j1939 import first_no_value
from canid.values.types import NAN


class Place(NamedTuple):
    """Where a signal lies in every frame of its message."""

    signal: Signal
    bits: Bits
    no_value: float  # raw numbers from here on are no measurement


def places(message: Message) -> tuple[Place, ...] | None:
    """Where the signals of a message lie; None: not in every frame, or a number needs more digits than a double has.

    Example:
        >>> signal = Signal("S", 4, 12, False, False, False, 0.5, 1.0, None, None, "m", {8: "eight"}, False, None, ())
        >>> message = Message("M", 7, False, 8, 0.1, (signal,))
        >>> read(places(message), bytes([0x30, 0x01]))[0].text, read(places(message), bytes([0x80, 0x00]))[0].text
        ('10.5 m', 'eight')
        >>> places(message._replace(signals=(signal._replace(multiplexer="P", pages=(1,)),))) is None
        True
    """
    signals = [signal for signal in message.signals if carried(signal)]
    if message.container is not None or any(
        signal.multiplexer is not None or signal.elsewhere for signal in message.signals
    ):
        return None
    if any(signal.length > EXACT_BITS and not signal.floating for signal in signals):
        return None
    reserved = {signal.name: first_no_value(message, signal) for signal in signals}
    return tuple(
        Place(signal, bits_of(signal), math.inf if (first := reserved[signal.name]) is None else first[0])
        for signal in signals
    )


def read(signals: Sequence[Place], data: bytes) -> list[DecodedSignal]:
    """The same values as `signal_columns.decode` gives, of one frame."""
    out = []
    for signal, bits, no_value in signals:
        raw: Any = raw_of(bits, data)
        value = NAN if raw is None or raw >= no_value else raw * signal.scale + signal.offset
        choice = "" if raw is None or not math.isfinite(value) else signal.choices.get(raw, "")
        out.append(DecodedSignal(signal.name, value, signal.unit, choice))
    return out
