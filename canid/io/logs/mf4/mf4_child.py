"""Run as `python -m canid.io.logs.mf4.mf4_child FILE`: sends the frames of an .mf4 to its parent.

A process of its own because asammdf is slow to import and needs much memory. Messages: the start of the measurement
(`bus_groups.Start`), then frames as `bus_groups.Part`, at last a `bus_groups.End`.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from typing import Any

from canid.io.logs.mf4 import bus_groups, conversions, raw_mdf
from canid.io.logs.mf4.bus_groups import COMPLETE, NO_ASAMMDF, End, Start
from canid.io.logs.mf4.raw_mdf import RawMdf, VersionError
from canid.values.processes import limits
from canid.values.processes.serve import Connection, connect

# records that are read at once: numpy's overhead is spread over them, and 64 bytes of data each are 8 MB
_RECORDS = 131_072
# records that are read first: who opens a log wants its first frame
_FIRST_RECORDS = 256
# Limit of asammdf's CPU time up to the first frames, and for each message from there: s, and s per MiB of the file. An
# undamaged log of an hour takes a tenth.
_CPU_S, _CPU_S_PER_MIB = 10.0, 1.0
# Limit of its memory: bytes beyond its own modules, and bytes per byte of the file for the unpacked columns
_EXTRA_BYTES, _BYTES_PER_FILE_BYTE = 256 << 20, 16
# names of channels that a message quotes
_NAMED = 5


def main(path: str) -> int:
    """Send all frames of `path`."""
    parent = connect(plain=True)
    parent.answer(_sent(path, parent))
    return 0


def _sent(path: str, parent: Connection) -> End:
    try:
        asammdf = raw_mdf.load()
    except ImportError:
        return End(NO_ASAMMDF)
    size = os.path.getsize(path)
    limits.limit_more_data(_EXTRA_BYTES + _BYTES_PER_FILE_BYTE * size)
    seconds = _CPU_S + _CPU_S_PER_MIB * size / (1 << 20)
    groups: list[bus_groups.Group] = []
    others: Counter[str] = Counter()
    signals: list[str] = []
    why = COMPLETE
    try:
        limits.limit_cpu(seconds)
        mdf = raw_mdf.opened(asammdf, path)
        groups, others, signals = _groups(mdf)
        first = bus_groups.first_channel(groups)
        for group in groups:
            group.first_channel = first
        parent.answer(start(mdf.file.header)._replace(buses=bus_groups.by_source(groups)))
        streams = [bus_groups.parts(group, _FIRST_RECORDS, _RECORDS) for group in groups]
        for part in bus_groups.merged(streams):
            parent.answer(part)
            limits.limit_cpu(seconds)
    except BrokenPipeError:
        raise
    except Exception as error:  # asammdf raises errors of any kind on damaged files
        limits.limit_data(None)  # what is known can still be sent
        why = failure(error)
    failures = sum((group.failures for group in groups), Counter[str]())
    return End(
        why,
        sum(group.incomplete for group in groups),
        sum(group.impossible for group in groups),
        failures.total(),
        next(iter(failures), ""),
        tuple(others.items()),
        tuple(signals[:_NAMED]),
        len(signals),
    )


def failure(error: Exception) -> str:
    """Why a file cannot be read, within a line."""
    if isinstance(error, VersionError):
        return str(error)
    return f"asammdf failed ({type(error).__name__}: {' '.join(str(error).split())[:200]})"


def start(header: Any) -> Start:
    """The start of a measurement. ASAM MDF 4, HDBLOCK: bit 0 of hd_time_flags is "local time"."""
    return Start(int(header.abs_time), bool(header.time_flags & 1))


def _groups(mdf: RawMdf) -> tuple[list[Any], Counter[str], list[str]]:
    """The groups of frames; how many events there are of other kinds; names of channels that are no events."""
    groups: list[bus_groups.Group] = []
    others: Counter[str] = Counter()
    signals: list[str] = []
    for index, group in enumerate(mdf.file.groups):
        records = int(group.channel_group.cycles_nr)
        names = [str(channel.name) for channel in group.channels]
        kind = next((kind for kind in bus_groups.KINDS if f"{kind}.ID" in names or kind in names), None)
        if kind is not None:
            members, fetch = _members(mdf, index, names, kind)
            source = group.channel_group.acq_source
            name = str(source.name or source.path) if source is not None else ""
            groups.append(bus_groups.Group(kind, members, records, fetch, source=name))
            continue
        of_bus = [
            what
            for begin, what in bus_groups.NO_FRAMES.items()
            if any(name.startswith(begin) for name in names)
        ]
        if of_bus:
            others[of_bus[0]] += records
        else:
            master = mdf.file.masters_db.get(index)
            signals += [name for k, name in enumerate(names) if k != master]
    return [group for group in groups if group.records], +others, signals


def _members(mdf: RawMdf, index: int, names: Sequence[str], kind: str) -> tuple[list[str], Any]:
    """The members of a group's frames, and how they are read."""
    places = {name.removeprefix(f"{kind}."): k for k, name in enumerate(names) if name.startswith(f"{kind}.")}

    def fetch(member: str, start: int, count: int) -> Any:
        if member == "t":
            return times(mdf, index, start, count)
        place = places[member]
        raw, _ = mdf.samples(index, place, start, count)
        return conversions.number(raw, mdf.conversions.get((index, place)), names[place])

    return list(places), fetch


def times(mdf: RawMdf, index: int, start: int = 0, count: int | None = None) -> Any:
    """(n,) s since the start, of records of a group. Raises ConversionError, and whatever asammdf raises."""
    raw = mdf.times(index, start, count)
    master = mdf.master(index)
    if master is None or master not in mdf.conversions:
        return raw
    group, channel = master
    name = str(mdf.file.groups[group].channels[channel].name)
    return conversions.number(raw, mdf.conversions[master], name)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1]))
