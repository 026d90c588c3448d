"""What is kept of one signal of a DBC file while a log is read."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from canid.analysis.contents import course
from canid.analysis.drive.signal_columns import MessageFrames, MessageKey, decode
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.bits import EXACT_BITS, scaled
from canid.signals.vehicle.database import bits_of
from canid.values.log_contents import Field, SignalContents
from canid.values.types import NAN, Array

# names that DBC authors give to what protects a message (openpilot, AUTOSAR E2E, Vector)
_PROTECTION_NAME = re.compile(
    r"(?P<counter>(^|_)(counter|alive|rolling|rc|bz)|(message|alive|rolling)_?(count|cnt))|checksum|chksum|(^|_)crc",
    re.IGNORECASE,
)
# entries of a value table that are counted one by one
MAX_ENTRIES = 64


@dataclass(slots=True)
class SignalTally:
    """One signal so far."""

    key: MessageKey
    message: Message
    signal: Signal
    readings: int = 0
    values: int = 0
    # raw numbers, as the next five: whole ones of more bits than a double has stay whole
    low: float = float("inf")
    high: float = -float("inf")
    sum: float = 0.0
    previous: float = NAN
    changes: int = 0
    no_values: int = 0
    entries: dict[int, int] = field(default_factory=dict)
    entry_low: float = float("inf")
    entry_high: float = -float("inf")
    # physical means of values, and of entries of the value table
    sums: Array = field(default_factory=lambda: np.zeros(course.BUCKETS))
    counts: Array = field(default_factory=lambda: np.zeros(course.BUCKETS))
    entry_sums: Array | None = None
    entry_counts: Array | None = None


def double(tally: SignalTally) -> None:
    """The grid's step has doubled."""
    tally.sums, tally.counts = course.doubled(tally.sums), course.doubled(tally.counts)
    if tally.entry_sums is not None and tally.entry_counts is not None:
        tally.entry_sums = course.doubled(tally.entry_sums)
        tally.entry_counts = course.doubled(tally.entry_counts)


def _raw(signal: Signal) -> Signal:
    """The signal in raw numbers; where it is scaled differently on other pages, in raw numbers of its first."""
    scale = signal.scale or 1.0
    others = (
        each._replace(scale=each.scale / scale, offset=(each.offset - signal.offset) / scale)
        for each in signal.elsewhere
    )
    return signal._replace(scale=1.0, offset=0.0, elsewhere=tuple(others))


def add(tally: SignalTally, frames: MessageFrames, grid: course.Grid) -> None:
    """Take the next frames of the signal's message."""
    # numbers of the file may be anything; scaled at the end
    column = decode(tally.message, _raw(tally.signal), frames)
    if column is None or not column.t.size:
        return
    t, known = column.t, np.isfinite(column.value)
    # whole numbers stay exact; those of pages that are scaled differently are comparable as doubles alone
    raw = column.value if tally.signal.elsewhere or tally.signal.length <= EXACT_BITS else column.raw
    tally.readings += raw.size
    tally.no_values += int(raw.size - known.sum())
    if not known.all():
        t, raw = t[known], raw[known]
    if not raw.size:
        return
    first, last = raw[[0, -1]].tolist()
    tally.changes += int((raw[1:] != raw[:-1]).sum()) + int(tally.previous == tally.previous != first)
    tally.previous = last
    bucket = grid.bucket(t)
    entry = _entries(tally, raw)
    if entry is not None and entry.any():
        if tally.entry_sums is None or tally.entry_counts is None:
            tally.entry_sums, tally.entry_counts = np.zeros(course.BUCKETS), np.zeros(course.BUCKETS)
        tally.entry_sums += np.bincount(bucket[entry], raw[entry].astype(np.float64), course.BUCKETS)
        tally.entry_counts += np.bincount(bucket[entry], minlength=course.BUCKETS)
        tally.entry_low, tally.entry_high = _ends(tally.entry_low, tally.entry_high, raw[entry])
        raw, bucket = raw[~entry], bucket[~entry]
    if not raw.size:
        return
    tally.values += raw.size
    tally.low, tally.high = _ends(tally.low, tally.high, raw)
    number = raw.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        tally.sum += float(number.sum())
        tally.sums += np.bincount(bucket, number, course.BUCKETS)
    tally.counts += np.bincount(bucket, minlength=course.BUCKETS)


def _ends(low: float, high: float, raw: npt.NDArray[Any]) -> tuple[float, float]:
    """The range so far, with these; whole numbers stay whole."""
    least, most = np.array([raw.min(), raw.max()], raw.dtype).tolist()
    return min(low, least), max(high, most)


def _entries(tally: SignalTally, raw: npt.NDArray[Any]) -> npt.NDArray[np.bool_] | None:
    """Which numbers are entries of the value table; counts them."""
    choices = tally.signal.choices
    if not choices:
        return None
    if raw.dtype.kind in "iu":
        span = np.iinfo(raw.dtype)
        listed = [number for number in choices if span.min <= number <= span.max]
    else:
        listed = list(choices)
    entry = np.isin(raw, np.array(listed, raw.dtype))
    numbers, counts = np.unique(raw[entry], return_counts=True)
    for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number in tally.entries or len(tally.entries) < MAX_ENTRIES:
            tally.entries[int(number)] = tally.entries.get(int(number), 0) + count
    return entry


def _physical(signal: Signal, raw: float) -> float:
    """Raw · scale + offset."""
    return float(scaled(bits_of(signal), np.array([raw], object), signal.scale, signal.offset)[0])


def _text(tally: SignalTally, raw: float) -> str:
    if not math.isfinite(raw) or raw != int(raw):
        return ""
    return tally.signal.choices.get(int(raw), "")


def contents(tally: SignalTally, used: int, fields: Mapping[MessageKey, tuple[Field, ...]]) -> SignalContents:
    """What a signal was; `used`: buckets of the grid that the log fills; `fields`: recognised in its message."""
    scale, offset = tally.signal.scale, tally.signal.offset
    is_state = tally.values == 0 and bool(tally.entries)
    sums, counts, low, high = tally.sums, tally.counts, tally.low, tally.high
    values, total = tally.values, tally.sum
    if is_state and tally.entry_sums is not None and tally.entry_counts is not None:
        sums, counts, low, high = tally.entry_sums, tally.entry_counts, tally.entry_low, tally.entry_high
        values, total = int(counts.sum()), float(sums.sum())
    ends = (low, high) if low <= high else (NAN, NAN)
    texts: dict[str, int] = {}
    for raw, count in tally.entries.items():
        text = _text(tally, raw)
        texts[text] = texts.get(text, 0) + count
    with np.errstate(over="ignore", invalid="ignore"):
        physical = [_physical(tally.signal, x) for x in ends]
        along = course.means(sums, counts, used) * scale + offset
    return SignalContents(
        bus=tally.key.bus,
        id=tally.key.id,
        message=tally.message.name,
        signal=tally.signal.name,
        unit=tally.signal.unit,
        readings=tally.readings,
        # a negative scale turns the order round
        low=min(physical),
        high=max(physical),
        mean=total / values * scale + offset if values else NAN,
        last=_physical(tally.signal, tally.previous),
        changes=tally.changes,
        low_text=_text(tally, ends[0] if scale >= 0 else ends[1]),
        high_text=_text(tally, ends[1] if scale >= 0 else ends[0]),
        last_text=_text(tally, tally.previous),
        entries=texts,
        no_values=tally.no_values + (0 if is_state else sum(tally.entries.values())),
        is_state=is_state,
        protects=_protects(tally, fields.get(tally.key, ())),
        course=along,
    )


def _protects(tally: SignalTally, fields: tuple[Field, ...]) -> str:
    """Counter, checksum or selector: by what the frames show at its place, or by its name."""
    if tally.signal.is_multiplexer:
        return "selector"
    named = _PROTECTION_NAME.search(tally.signal.name)
    if named:
        return "counter" if named["counter"] else "checksum"
    bits = bits_of(tally.signal)
    first = bits.start - bits.length + 1 if bits.motorola else bits.start  # of a signal within one byte
    for bit_field in fields:
        if (bit_field.start, bit_field.length) == (first, bits.length):
            return bit_field.kind
    return ""
