"""One pass over a log: what its frames are, and what the signals of DBC files do in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.contents import course, message_tally, signal_tally
from canid.contents.binding import Binding, DbcFile, bind, databases
from canid.contents.message_tally import Tally
from canid.contents.signal_tally import SignalTally
from canid.log_contents import BusContents, LogContents
from canid.logs import Log
from canid.parsing import Message, Signal
from canid.signal_columns import MessageFrames, MessageKey, by_message, rounds
from canid.types import Columns, Flag
from canid.vehicle.database import carried

# ids of which a sample of frames is kept (0.5 kB to 16 kB each): complete vehicle networks have some 1000 on all buses
MAX_IDS = 8192
# signals of which a course is kept (2 kB each)
MAX_SIGNALS = 20_000
# bits of a frame around its data, with 3 between two frames: CAN 2.0 of 11 and 29 bits, CAN FD about as many
_FRAME_BITS, _EXTENDED_BITS = 47, 67


class Wanted(NamedTuple):
    """What of a log is shown; the buses are always those of the whole log."""

    start: float = 0.0  # s
    stop: float = float("inf")
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
        >>> from canid.logs import open_log
        >>> from canid.vehicle.vehicle_file import shipped
        >>> found = survey(open_log(shipped().parent / "replay_logs" / "following_lost_lead.blf"))
        >>> found.frames, len(found.messages), found.messages[0].fields[0].says
        (40486, 7, 'counts up by 1')
    """
    asked = wanted or Wanted()
    buses: dict[int, Counter[str]] = {}
    ends: list[float] = []
    tallies: dict[MessageKey, Tally] = {}
    signals: dict[MessageKey, list[SignalTally]] = {}
    bound: Binding | None = None
    grid = course.grid(asked.start)
    left_out = signals_left_out = 0
    came: set[MessageKey] = set()
    for chunks in rounds(log, progress=progress):
        for chunk in chunks:
            _count(chunk, asked, buses, ends)
        sorted_frames = by_message(chunks, start=asked.start, stop=asked.stop)
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
                room = MAX_SIGNALS - sum(len(of) for of in signals.values())
                if room < 0:
                    signals_left_out -= room
                    signals[key] = signals[key][:room]
            tallies[key] = message_tally.add(tallies.get(key), frames)
            if signals[key]:
                kept[key] = frames
        if kept:
            newest = max(float(frames.t.max()) for frames in kept.values())
            for _ in range(course.doublings(grid, newest)):
                grid = grid._replace(step=2.0 * grid.step)
                for one in (one for of in signals.values() for one in of if one.readings):
                    signal_tally.double(one)
            for key, frames in kept.items():
                for one in signals[key]:
                    signal_tally.add(one, frames, grid)
    bound = bound or bind(files, ())
    start, stop = (min(ends), max(ends)) if ends else (0.0, 0.0)
    used = min(int((stop - grid.start) / grid.step) + 1, course.BUCKETS)
    named = {key: bound.find(key) for key in tallies}
    messages = tuple(
        message_tally.contents(key, tally, *_names(named[key])) for key, tally in sorted(tallies.items())
    )
    fields = {key: message.fields for key, message in zip(sorted(tallies), messages, strict=True)}
    seen = [one for key in sorted(signals) for one in signals[key] if one.readings]
    return LogContents(
        start,
        stop,
        sum(of["frames"] for of in buses.values()),
        tuple(_bus(bus, of, stop - start) for bus, of in sorted(buses.items())),
        messages,
        tuple(signal_tally.contents(one, used, fields) for one in seen),
        databases(bound, tallies),
        len(came),
        left_out,
        signals_left_out,
    )


def _names(found: tuple[str, list[Message]] | None) -> tuple[str, str]:
    """Message (of a container all that are in it) and file, as they are shown."""
    return ("", "") if found is None else ("+".join(message.name for message in found[1]), found[0])


def _signals(key: MessageKey, bound: Binding, asked: Wanted) -> list[SignalTally]:
    found = bound.find(key)
    if found is None:
        return []

    def is_wanted(message: Message, signal: Signal) -> bool:
        name = f"{message.name}.{signal.name}"
        return carried(signal) and (asked.signal is None or asked.signal(name))

    return [
        SignalTally(key, message, signal)
        for message in found[1]
        for signal in message.signals
        if is_wanted(message, signal)
    ]


def _count(chunk: Columns, asked: Wanted, buses: dict[int, Counter[str]], ends: list[float]) -> None:
    """Count a chunk's frames of all kinds, by bus; `ends`: their earliest and latest times."""
    inside = (chunk.t >= asked.start) & (chunk.t <= asked.stop)
    if not inside.any():
        return
    t = chunk.t[inside]
    ends[:] = [min([*ends[:1], float(t.min())]), max([*ends[1:], float(t.max())])]
    bus, flags = chunk.bus[inside], chunk.flags[inside]
    data = np.where(flags & int(Flag.REMOTE), 0, chunk.length[inside])
    bits = 8 * data.astype(np.int64) + np.where(flags & int(Flag.EXTENDED), _EXTENDED_BITS, _FRAME_BITS)
    for number in np.unique(bus).tolist():
        rows = bus == number
        of = buses.setdefault(number, Counter())
        of["frames"] += int(rows.sum())
        for name, flag in (("errors", Flag.ERROR), ("remote", Flag.REMOTE), ("fd", Flag.FD)):
            of[name] += int((flags[rows] & int(flag) != 0).sum())
        of["bits"] += int(bits[rows & (flags & int(Flag.ERROR) == 0)].sum())


def _bus(bus: int, of: Counter[str], duration: float) -> BusContents:
    per_s = 1.0 / duration if duration > 0.0 else float("nan")
    return BusContents(
        bus, of["frames"], of["frames"] * per_s, of["bits"] * per_s, of["errors"], of["remote"], of["fd"]
    )
