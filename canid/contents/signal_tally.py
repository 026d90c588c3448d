"""What is kept of one signal of a DBC file while a log is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from canid.contents import course
from canid.log_contents import Field, SignalContents
from canid.parsing import Message, Signal
from canid.signal_columns import MessageFrames, MessageKey, decode
from canid.types import NAN, Array
from canid.vehicle.database import bits_of

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
    low: float = float("inf")  # raw numbers, as the next four
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


def add(tally: SignalTally, frames: MessageFrames, grid: course.Grid) -> None:
    """Take the next frames of the signal's message."""
    # numbers of the file may be anything; scaled at the end
    column = decode(tally.message, tally.signal._replace(scale=1.0, offset=0.0), frames)
    if column is None or not column.t.size:
        return
    t, raw = column
    tally.readings += raw.size
    known = np.isfinite(raw)
    tally.no_values += int(raw.size - known.sum())
    if not known.all():
        t, raw = t[known], raw[known]
    if not raw.size:
        return
    tally.changes += int((raw[1:] != raw[:-1]).sum()) + int(tally.previous == tally.previous != raw[0])
    tally.previous = float(raw[-1])
    bucket = grid.bucket(t)
    entry = _entries(tally, raw)
    if entry is not None and entry.any():
        if tally.entry_sums is None or tally.entry_counts is None:
            tally.entry_sums, tally.entry_counts = np.zeros(course.BUCKETS), np.zeros(course.BUCKETS)
        tally.entry_sums += np.bincount(bucket[entry], raw[entry], course.BUCKETS)
        tally.entry_counts += np.bincount(bucket[entry], minlength=course.BUCKETS)
        tally.entry_low = min(tally.entry_low, float(raw[entry].min()))
        tally.entry_high = max(tally.entry_high, float(raw[entry].max()))
        raw, bucket = raw[~entry], bucket[~entry]
    if not raw.size:
        return
    tally.values += raw.size
    tally.low, tally.high = min(tally.low, float(raw.min())), max(tally.high, float(raw.max()))
    with np.errstate(over="ignore", invalid="ignore"):
        tally.sum += float(raw.sum())
        tally.sums += np.bincount(bucket, raw, course.BUCKETS)
    tally.counts += np.bincount(bucket, minlength=course.BUCKETS)


def _entries(tally: SignalTally, raw: Array) -> npt.NDArray[np.bool_] | None:
    """Which numbers are entries of the value table; counts them."""
    choices = tally.signal.choices
    if not choices:
        return None
    entry = np.isin(raw, np.fromiter(choices, np.float64, len(choices)))
    numbers, counts = np.unique(raw[entry], return_counts=True)
    for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number in tally.entries or len(tally.entries) < MAX_ENTRIES:
            tally.entries[int(number)] = tally.entries.get(int(number), 0) + count
    return entry


def _text(tally: SignalTally, raw: float) -> str:
    if not np.isfinite(raw) or raw != int(raw):
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
        physical = [x * scale + offset for x in ends]
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
        last=tally.previous * scale + offset,
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
    for one in fields:
        if (one.start, one.length) == (first, bits.length):
            return one.kind
    return ""
