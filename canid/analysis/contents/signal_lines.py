"""Signals as lines over time, each decoded when it is asked for, with a gap where its message stayed away."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from canid.analysis.contents.binding import DbcFile, bind
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.drive.signal_columns import MessageFrames, MessageKey, decode, frames_by_message
from canid.io.logs import Log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import carried
from canid.signals.vehicle.transport_protocol import groups_of
from canid.values.types import NAN, Array

# a step from reading to reading that is longer than so many usual ones is a gap: a receiver times out after as many
# (AUTOSAR COM deadline monitoring: 2 to 5 periods)
GAP_STEPS = 5.0
# the usual step: messages that are sent on change have no period, and 19 of 20 of their steps are no gaps
USUAL_SHARE = 0.95


class Line(NamedTuple):
    """Values over time."""

    t: Array  # (n,) s, ascending
    value: Array  # (n,) NaN: no value, or the beginning of a gap


class NamedLine(NamedTuple):
    """A line that can be asked for."""

    name: str  # "ENGINE_DATA.PedalPosition"
    group: str  # what it is listed under
    unit: str
    meanings: Mapping[float, str]  # what values mean: a state; of a quantity none
    read: Callable[[], Line]
    at_first: bool = False  # a page that shows few lines begins with it


def lines_of_log(
    log: Log,
    files: Sequence[DbcFile],
    wanted: Wanted,
    progress: Callable[[float], None] | None = None,
) -> tuple[NamedLine, ...]:
    """The signals of DBC files that came in a log; the log is read once, and its frames are kept.

    Args:
        log: from `open_log`.
        files: DBC files, in the order of the command line.
        wanted: which part of the log.
        progress: called now and then with the fraction that was read.

    Returns:
        in the order of bus, id and the files' signals. Memory: 17 bytes for each frame (CAN FD: 73).

    Raises:
        LogError: the log cannot be read.

    Example:
        >>> from pathlib import Path
        >>> from canid.signals.dbc_text.parsing import Parser
        >>> from canid.io.logs import open_log
        >>> from canid.values.shipped_files import shipped
        >>> from canid.signals.vehicle import database
        >>> with Parser() as parser:
        ...     read, _, _ = database.load(shipped() / "generic.dbc", None, parser)
        >>> files = [DbcFile(read.file, None, tuple(read.messages.values()))]
        >>> log = open_log(shipped().parent / "replay_logs" / "following_lost_lead.blf")
        >>> first = lines_of_log(log, files, Wanted())[0]
        >>> first.name, first.group, first.unit, len(first.read().t)
        ('ENGINE_DATA.PedalPosition', '0x110 ENGINE_DATA', '%', 8998)
    """
    groups = groups_of(message for file in files for message in file.messages)
    frames = frames_by_message(
        log, ids=wanted.ids or None, within=wanted.window, progress=progress, groups=groups
    )
    kept = {
        key: message_frames
        for key, message_frames in frames.items()
        if not wanted.buses or key.bus in wanted.buses
    }
    bound = bind(files, kept.keys())
    out: list[NamedLine] = []
    for key, message_frames in kept.items():
        described = bound.find(key)
        for message in described[1] if described else ():
            group = group_name(key, message.name, kept.keys())
            out += [
                NamedLine(
                    name,
                    group,
                    signal.unit,
                    signal.meanings,
                    partial(_decoded, message, signal, message_frames),
                )
                for signal in message.signals
                if carried(signal)
                and (wanted.signal is None or wanted.signal(f"{message.name}.{signal.name}"))
                for name in (f"{message.name}.{signal.name}",)
            ]
    return tuple(out)


def group_name(key: MessageKey, message: str, keys: Collection[MessageKey]) -> str:
    """Id and message, and the bus where there are several."""
    identity = f"0x{key.id:08X}" if key.extended else f"0x{key.id:03X}"
    several = len({other.bus for other in keys}) > 1
    return f"{f'bus {key.bus} · ' if several else ''}{identity} {message}"


def _decoded(message: Message, signal: Signal, frames: MessageFrames) -> Line:
    column = decode(message, signal, frames)
    return Line(np.array([]), np.array([])) if column is None else with_gaps(column.t, column.value)


def with_gaps(t: Array, value: Array) -> Line:
    """A line in the order of time; a reading of NaN one usual step after the last one before each gap.

    Example:
        >>> line = with_gaps(np.array([0.0, 1.0, 2.0, 9.0, 10.0]), np.arange(5.0))
        >>> line.t.tolist(), line.value.tolist()
        ([0.0, 1.0, 2.0, 3.0, 9.0, 10.0], [0.0, 1.0, 2.0, nan, 3.0, 4.0])
    """
    if len(t) > 1 and (np.diff(t) < 0.0).any():
        order = np.argsort(t, kind="stable")
        t, value = t[order], value[order]
    if len(t) < 3:
        return Line(t, value)
    steps = np.diff(t)
    # the step below which 19 of 20 are, no mean of two steps: of a few readings it would be half of the gap
    usual = float(np.quantile(steps, USUAL_SHARE, method="lower"))
    gaps = np.flatnonzero(steps > GAP_STEPS * usual) if usual > 0.0 else np.array([], np.intp)
    return Line(np.insert(t, gaps + 1, t[gaps] + usual), np.insert(value, gaps + 1, NAN))
