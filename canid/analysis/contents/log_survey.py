"""One pass over a log: what its frames are, and what the signals of DBC files do in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.contents import course, message_tally, signal_tally
from canid.analysis.contents.binding import Binding, DbcFile, bind, databases
from canid.analysis.contents.message_tally import Tally
from canid.analysis.contents.signal_tally import SignalTally
from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.drive.signal_columns import MessageFrames, MessageKey, by_message, rounds, with_messages
from canid.io.logs import Log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import carried
from canid.signals.vehicle.transport_protocol import Transfers, groups_of
from canid.values.log_contents import BusContents, LogContents
from canid.values.types import Array, Columns, Flag
from canid.values.window import WHOLE, Window

# ids of which a sample of frames is kept (0.5 kB to 16 kB each): complete vehicle networks have some 1000 on all buses
MAX_IDS = 8192
# signals of which a course is kept (2 kB each)
MAX_SIGNALS = 20_000
# bits of a frame around its data, with 3 between two frames: CAN 2.0 of 11 and 29 bits, CAN FD about as many
_FRAME_BITS, _EXTENDED_BITS = 47, 67


class Wanted(NamedTuple):
    """What of a log is shown; the buses are always those of the whole log."""

    window: Window = WHOLE
    buses: frozenset[int] = frozenset()  # empty: all
    ids: frozenset[int] = frozenset()
    signal: Callable[[str], bool] | None = None  # by "MESSAGE.SIGNAL"; None: all


def survey(
    log: Log,
    files: Sequence[DbcFile] = (),
    wanted: Wanted | None = None,
    progress: Callable[[float], None] | None = None,
) -> LogContents:
    """Read a log once, and say what it contains. Memory is bounded however long it is.

    Files without a bus are bound to buses by the ids of the first 260,000 frames.

    Args:
        log: from `open_log`.
        files: DBC files.
        wanted: a part of it; None: all.
        progress: called now and then with the fraction that was read.

    Returns:
        messages by bus and id; signals in the order of their files' messages.

    Raises:
        LogError: the log cannot be read.

    Example:
        >>> from canid.io.logs import open_log
        >>> from canid.values.shipped_files import shipped
        >>> contents = survey(open_log(shipped().parent / "replay_logs" / "following_lost_lead.blf"))
        >>> contents.frames, len(contents.messages), contents.messages[0].fields[0].says
        (40486, 7, 'counts up by 1')
    """
    asked = wanted or Wanted()
    buses: dict[int, Counter[str]] = {}
    time = RecordedTime()
    tallies: dict[MessageKey, Tally] = {}
    signals: dict[MessageKey, list[SignalTally]] = {}
    bound: Binding | None = None
    grid: course.Grid | None = None
    left_out = signals_left_out = kept_signals = 0
    came: set[MessageKey] = set()
    groups = groups_of(message for file in files for message in file.messages)
    transfers: Transfers = {}
    for chunks in rounds(log, progress=progress):
        for chunk in chunks:
            time = time.after(_count(chunk, asked, buses))
        transfers, chunks = with_messages(transfers, chunks, groups)
        sorted_frames = by_message(chunks, within=asked.window)
        came.update(list(sorted_frames)[: max(MAX_IDS - len(came), 0)])
        if bound is None:
            bound = bind(files, sorted_frames)
        kept: dict[MessageKey, MessageFrames] = {}
        for key, frames in sorted_frames.items():
            if (asked.buses and key.bus not in asked.buses) or (asked.ids and key.id not in asked.ids):
                continue
            if key not in tallies:
                if len(tallies) >= MAX_IDS:
                    left_out += len(frames.t)
                    continue
                signals[key] = _signals(key, bound, asked)
                room = MAX_SIGNALS - kept_signals
                signals_left_out += max(len(signals[key]) - room, 0)
                signals[key] = signals[key][:room]
                kept_signals += len(signals[key])
            tallies[key] = message_tally.add(tallies.get(key), frames, time)
            if signals[key]:
                kept[key] = frames
        if kept:
            newest = max(float(frames.t.max()) for frames in kept.values())
            if grid is None:
                grid = course.grid(time.first if asked.window.is_whole else asked.window.begin)
            for _ in range(course.doublings(grid, newest)):
                grid = grid._replace(step=2.0 * grid.step)
                for signal in (
                    signal for of_message in signals.values() for signal in of_message if signal.readings
                ):
                    signal_tally.double(signal)
            for key, frames in kept.items():
                for signal in signals[key]:
                    signal_tally.add(signal, frames, grid)
    bound = bound or bind(files, ())
    start, stop = (time.first, time.last) if buses else (0.0, 0.0)
    used = min(int((stop - grid.start) / grid.step) + 1, course.BUCKETS) if grid is not None else 0
    named = {key: bound.find(key) for key in tallies}
    messages = tuple(
        message_tally.contents(key, tally, *_names(named[key])) for key, tally in sorted(tallies.items())
    )
    fields = {key: message.fields for key, message in zip(sorted(tallies), messages, strict=True)}
    seen = [signal for key in sorted(signals) for signal in signals[key] if signal.readings]
    return LogContents(
        start,
        stop,
        sum(counts["frames"] for counts in buses.values()),
        tuple(_bus(bus, counts, time) for bus, counts in sorted(buses.items())),
        messages,
        tuple(signal_tally.contents(signal, used, fields) for signal in seen),
        databases(bound, tallies),
        len(came),
        left_out,
        signals_left_out,
        time.paused,
    )


def _names(described: tuple[str, list[Message]] | None) -> tuple[str, str]:
    """Message (of a container all that are in it) and file, as they are shown."""
    return (
        ("", "") if described is None else ("+".join(message.name for message in described[1]), described[0])
    )


def _signals(key: MessageKey, bound: Binding, asked: Wanted) -> list[SignalTally]:
    described = bound.find(key)
    if described is None:
        return []

    def is_wanted(message: Message, signal: Signal) -> bool:
        name = f"{message.name}.{signal.name}"
        return carried(signal) and (asked.signal is None or asked.signal(name))

    return [
        SignalTally(key, message, signal)
        for message in described[1]
        for signal in message.signals
        if is_wanted(message, signal)
    ]


def _count(chunk: Columns, asked: Wanted, buses: dict[int, Counter[str]]) -> Array:
    """Count a chunk's frames of all kinds, by bus; their times."""
    inside = asked.window.holds(chunk.t)
    t = chunk.t[inside]
    if not t.size:
        return t
    bus, flags = chunk.bus[inside], chunk.flags[inside]
    data = np.where(flags & int(Flag.REMOTE), 0, chunk.length[inside])
    bits = 8 * data.astype(np.int64) + np.where(flags & int(Flag.EXTENDED), _EXTENDED_BITS, _FRAME_BITS)
    numbers, which = np.unique(bus, return_inverse=True)
    sums = {
        "frames": np.ones(len(bus), bool),
        "errors": flags & int(Flag.ERROR) != 0,
        "remote": flags & int(Flag.REMOTE) != 0,
        "fd": flags & int(Flag.FD) != 0,
        "bits": np.where(flags & int(Flag.ERROR), 0, bits),
    }
    counts = {
        name: np.bincount(which, weights, len(numbers)).astype(np.int64) for name, weights in sums.items()
    }
    for k, number in enumerate(numbers.tolist()):
        total = buses.setdefault(number, Counter())
        for name, count in counts.items():
            total[name] += int(count[k])
    return t


def _bus(bus: int, counts: Counter[str], time: RecordedTime) -> BusContents:
    return BusContents(
        bus,
        counts["frames"],
        time.rate(counts["frames"]),
        time.rate(counts["bits"]),
        counts["errors"],
        counts["remote"],
        counts["fd"],
    )
