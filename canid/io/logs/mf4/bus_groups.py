"""Channel groups of ASAM's bus logging as columns of frames (ASAM MDF 4, Bus Logging 1.0; see docs/formats/mf4.md).

A group holds one kind of event: a structure `CAN_DataFrame`, `CAN_RemoteFrame` or `CAN_ErrorFrame`, and its members
`CAN_DataFrame.ID`, ... as channels of their own. Each member is read by itself, so that one that cannot be read, or has
fewer values than the others, as behind a power failure, costs nothing of the rest.
"""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.local_time import epoch_ns
from canid.io.logs.mf4.conversions import ConversionError
from canid.io.logs.text_lines import MAX_TIME_NS
from canid.values.frame_columns import (
    CLASSIC_BYTES,
    DLC_BYTES,
    FD_BYTES,
    MAX_EXTENDED_ID,
    MAX_STANDARD_ID,
    join_octets,
)
from canid.values.types import Flag

# by the name of the structure: the flag of its frames
KINDS = {"CAN_DataFrame": Flag.NONE, "CAN_RemoteFrame": Flag.REMOTE, "CAN_ErrorFrame": Flag.ERROR}
# events that are no frames, and what they are called
NO_FRAMES = {
    "CAN_OverloadFrame": "overload frames",
    "LIN_": "LIN events",
    "FLX_": "FlexRay events",
    "ETH_": "Ethernet frames",
    "MOST_": "MOST events",
    "K_LINE_": "K-Line events",
}
_EXTENDED_BIT = 1 << 31
# bytes of a CAN FD frame by its data length code (ISO 11898-1:2015, table 5)
_FD_LENGTHS = np.array(DLC_BYTES, np.int64)
_MARKS = {"EDL": Flag.FD, "BRS": Flag.BRS, "ESI": Flag.ESI}
# without which a frame is another one
_NEEDED = ("BusChannel", "DataLength", "DLC", "IDE")

_Ints = npt.NDArray[np.int64]
_Bools = npt.NDArray[np.bool_]
_Octets = npt.NDArray[np.uint8]
# (member, first record, records) -> its values; fewer where fewer can be read. Raises whatever asammdf raises.
Fetch = Callable[[str, int, int], Any]


class Part(NamedTuple):
    """Frames of a log, in the order of the file; what is sent to the parent."""

    ns: _Ints  # since the start that the header states
    bus: npt.NDArray[np.uint16]
    id: npt.NDArray[np.uint32]
    flags: _Octets
    length: _Octets
    data: _Octets  # (n, 8) or (n, 64)


class Start(NamedTuple):
    """The start of a measurement, as its header states it."""

    ns: int  # since 1970; 0: not stated
    is_local: bool  # the clock of a zone that the file does not name; else UTC
    buses: tuple[str, ...] = ()  # sources of the groups that have no channel number, bus by bus

    def epoch_ns(self, zone: datetime.tzinfo | None) -> int:
        """Epoch ns; a local time is read in `zone` (None: this machine's).

        >>> Start(3_600_000_000_007, True).epoch_ns(datetime.timezone(datetime.timedelta(hours=1)))
        7
        """
        if not self.is_local:
            return self.ns
        micros, rest = divmod(self.ns, 1000)
        at = epoch_ns(datetime.datetime(1970, 1, 1) + datetime.timedelta(microseconds=micros), zone)
        return self.ns if at is None else at + rest


COMPLETE, NO_ASAMMDF = "", "asammdf is missing"


class End(NamedTuple):
    """What is known when all frames are sent."""

    why: str  # `COMPLETE`, `NO_ASAMMDF`, or the reason why nothing more can be read
    incomplete: int = 0  # records of which the file does not hold all
    impossible: int = 0  # records with numbers that no frame has
    failed: int = 0  # records that cannot be read
    failure: str = ""  # its first reason
    others: tuple[tuple[str, int], ...] = ()  # events that are no frames: what they are, and how many
    signals: tuple[str, ...] = ()  # channels of groups that hold no events of a bus, the first of them
    n_signals: int = 0


@dataclass
class Group:
    """One group, and what of it cannot be read."""

    kind: str  # of `KINDS`
    members: Sequence[str]  # as "ID"; without "t", its time
    records: int  # that the file states
    fetch: Fetch
    first_channel: int = 1  # the channel that is bus 0
    source: str = ""  # the name of what acquired it
    bus: int = 0  # of frames without a channel number
    incomplete: int = 0  # records of which the file does not hold all
    impossible: int = 0  # records with numbers that no frame has
    failures: Counter[str] = field(default_factory=Counter)  # reasons why records cannot be read

    @property
    def damaged(self) -> int:
        """Records that were not read."""
        return self.incomplete + self.impossible + self.failures.total()


def first_channel(groups: Sequence[Group]) -> int:
    """The channel number that is bus 0: ASAM counts from 1, python-can's writer from 0; a channel 0 shows which."""
    for group in groups:
        try:
            channels = (
                integers(group.fetch("BusChannel", 0, group.records))
                if "BusChannel" in group.members
                else None
            )
        except (
            Exception
        ):  # asammdf raises errors of any kind; the same is met again where the frames are read
            continue
        if channels is not None and (channels == 0).any():
            return 0
    return 1


def by_source(groups: Sequence[Group]) -> tuple[str, ...]:
    """Number the buses of groups without a channel number by the names of their sources; these, bus by bus.

    >>> by_source([Group("CAN_DataFrame", ["ID"], 1, print, source=name) for name in ("CAN10", "CAN2", "CAN10")])
    ('CAN2', 'CAN10')
    """
    unnumbered = [group for group in groups if "BusChannel" not in group.members]
    names = sorted({*(group.source for group in unnumbered)}, key=lambda name: (len(name), name))
    for group in unnumbered:
        group.bus = names.index(group.source)
    return tuple(names) if len(names) > 1 else ()


def parts(group: Group, first: int, size: int) -> Iterator[Part]:
    """The frames of a group: `first` records, then `size` at a time."""
    for start in [0, *range(first, group.records, size)]:
        asked = min(size if start else first, group.records - start)
        try:
            yield _part(group, start, asked)
        except (BrokenPipeError, MemoryError):
            raise
        except Exception as error:  # asammdf raises errors of any kind on damaged files
            says = " ".join(str(error).split())[:200]
            known = isinstance(error, ConversionError)
            group.failures[says if known else f"asammdf: {type(error).__name__}: {says}"] += asked


def _part(group: Group, start: int, asked: int) -> Part:
    columns: dict[str, Any] = {"t": group.fetch("t", start, asked)}
    if "ID" in group.members:
        columns["ID"] = group.fetch("ID", start, asked)
    for name in group.members:
        if name not in columns and name != "DataBytes":
            try:
                columns[name] = group.fetch(name, start, asked)
            except MemoryError:
                raise
            except Exception as error:
                # an error frame is one without its details; of others the length and the channel matter
                needed = (*_NEEDED, *_MARKS, "Dir") if isinstance(error, ConversionError) else _NEEDED
                if group.kind != "CAN_ErrorFrame" and name in needed:
                    raise
    n = min(map(len, columns.values()))
    octets = _octets(group, start, asked)
    group.incomplete += asked - n
    members = {name: values[:n] for name, values in columns.items()}
    return _frames(group, members, None if octets is None else octets[:n], n)


def _octets(group: Group, start: int, asked: int) -> _Octets | None:
    """The data bytes, (m, width); None where the group has none, or an error frame's cannot be read."""
    if "DataBytes" not in group.members:
        return None
    try:
        values = np.asarray(group.fetch("DataBytes", start, asked))
        if values.dtype.kind not in "uiSV" or not values.dtype.itemsize:
            raise ValueError("its data bytes are no bytes")
    except MemoryError:
        raise
    except Exception:
        if group.kind != "CAN_ErrorFrame":
            raise
        return None
    # bytes, or numbers whose bytes they are
    return np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1)


def _frames(group: Group, members: Mapping[str, Any], octets: _Octets | None, n: int) -> Part:
    """Frames of the members' values, without those whose numbers cannot be."""
    t = np.asarray(members["t"], np.float64)
    raw = integers(members["ID"]) if "ID" in members else np.zeros(n, np.int64)
    plain = raw & MAX_EXTENDED_ID
    # without a channel that says so, bit 31 of the id does; an id that 11 bits cannot hold has 29
    extended = integers(members["IDE"]) != 0 if "IDE" in members else plain > MAX_STANDARD_ID
    extended |= raw & _EXTENDED_BIT != 0
    kind = KINDS[group.kind]
    flags = np.full(n, int(kind), np.int64) | np.where(extended, int(Flag.EXTENDED), 0)
    flags |= np.where(_sent(members["Dir"]), int(Flag.TX), 0) if "Dir" in members else 0
    if kind == Flag.NONE:
        for name, flag in _MARKS.items():
            flags |= np.where(integers(members[name]) != 0, int(flag), 0) if name in members else 0
    channel = (
        integers(members["BusChannel"])
        if "BusChannel" in members
        else np.full(n, group.first_channel + group.bus, np.int64)
    )
    bus = np.maximum(channel - group.first_channel, 0)
    sound = np.isfinite(t) & (np.abs(t) <= MAX_TIME_NS * 1e-9) & (channel >= 0) & (bus < 0xFFFF)
    sound &= extended | (plain <= MAX_STANDARD_ID) | (kind == Flag.ERROR)
    length = _lengths(members, octets, flags, n)
    fits = (length >= 0) & (length <= FD_BYTES)
    held = np.zeros(n, np.int64)  # bytes that the file has of each frame
    if octets is not None:
        held[: len(octets)] = octets.shape[1]
    whole = np.full(n, True) if kind == Flag.REMOTE else length <= held
    if kind == Flag.ERROR:
        length, whole, fits = np.where(whole & fits, length, 0), np.full(n, True), np.full(n, True)
    group.impossible += int((~sound | ~fits).sum())
    group.incomplete += int((sound & fits & ~whole).sum())
    rows = np.flatnonzero(sound & fits & whole)
    data = None if kind == Flag.REMOTE else octets
    return Part(
        np.round(t[rows] * 1e9).astype(np.int64),
        bus[rows].astype(np.uint16),
        plain[rows].astype(np.uint32),
        flags[rows].astype(np.uint8),
        length[rows].astype(np.uint8),
        _data(data, rows, length[rows]),
    )


def _lengths(members: Mapping[str, Any], octets: _Octets | None, flags: _Ints, n: int) -> _Ints:
    """Bytes of each frame: as it states, else by its data length code, else all that the group has."""
    remote = bool(n) and bool(flags[0] & int(Flag.REMOTE))
    code = integers(members["DLC"]) if "DLC" in members else None
    # a remote frame has no bytes, and asks for as many as its code says
    if "DataLength" in members and not (remote and code is not None):
        return integers(members["DataLength"])
    if code is not None:
        fd = flags & int(Flag.FD) != 0
        known = (code >= 0) & (code < len(_FD_LENGTHS))
        by_code = np.where(fd, _FD_LENGTHS[np.where(known, code, 0)], np.minimum(code, CLASSIC_BYTES))
        return np.where(known, by_code, -1)
    return np.full(n, 0 if octets is None or remote else octets.shape[1], np.int64)


def _data(octets: _Octets | None, rows: _Ints, length: _Ints) -> _Octets:
    """The bytes of these rows, zero behind each frame's length."""
    longest = int(length.max()) if len(length) and octets is not None else 0
    width = CLASSIC_BYTES if longest <= CLASSIC_BYTES else FD_BYTES
    data = np.zeros((len(rows), width), np.uint8)
    if octets is not None and len(octets):
        held = min(width, octets.shape[1])
        there = rows < len(octets)
        data[there, :held] = octets[rows[there], :held]
        data[np.arange(width) >= length[:, None]] = 0
    return data


def integers(values: Any) -> _Ints:
    """Whole numbers of a member; −1 where it holds none.

    >>> integers(np.array([1.0, 2.5])).tolist(), integers(np.array([True])).tolist()
    ([1, -1], [1])
    """
    numbers = np.asarray(values)
    if numbers.ndim == 2 and numbers.shape[1] == 1:
        numbers = numbers[:, 0]
    if numbers.ndim != 1 or numbers.dtype.kind not in "buif":
        raise ValueError("a member of its frames is no number")
    if numbers.dtype.kind == "f":
        whole = (np.abs(numbers) < 2.0**53) & (numbers == np.round(numbers))
        return np.where(whole, np.where(whole, numbers, 0.0), -1).astype(np.int64)
    return numbers.astype(np.int64)


def _sent(values: Any) -> _Bools:
    """Which frames the recording device has sent: 1, or a text such as "Tx"."""
    marks = np.asarray(values)
    if marks.dtype.kind in "SUO":
        return np.array(
            [
                str(mark.decode("latin-1") if isinstance(mark, bytes) else mark).lower().startswith("tx")
                for mark in marks.tolist()
            ],
            bool,
        )
    sent: _Bools = integers(marks) == 1
    return sent


def merged(streams: Sequence[Iterator[Part]]) -> Iterator[Part]:
    """Frames of several groups in the order of time; a group that is in no order keeps its own."""
    waiting: dict[int, Part] = {}
    open_ = dict(enumerate(streams))
    while True:
        for k in [k for k in open_ if k not in waiting]:
            part = next((piece for piece in open_[k] if len(piece.ns)), None)
            if part is None:
                del open_[k]
            else:
                waiting[k] = part
        if not waiting:
            return
        # what follows in a group is not earlier than its latest frame
        limit = min((int(waiting[k].ns.max()) for k in open_), default=None)
        taken, waiting_next = [], {}
        for k, part in sorted(waiting.items()):
            n = (
                len(part.ns)
                if limit is None
                else int(np.searchsorted(np.maximum.accumulate(part.ns), limit, "right"))
            )
            taken.append(_rows(part, slice(None, n)))
            if n < len(part.ns):
                waiting_next[k] = _rows(part, slice(n, None))
        waiting = waiting_next
        yield _sorted(taken)


def _rows(part: Part, rows: slice) -> Part:
    ns, bus, id_, flags, length, data = part
    return Part(ns[rows], bus[rows], id_[rows], flags[rows], length[rows], data[rows])


def _sorted(taken: Sequence[Part]) -> Part:
    if len(taken) == 1:
        return taken[0]
    *others, data = zip(*taken, strict=True)
    ns, bus, id_, flags, length = map(np.concatenate, others)
    # by the latest time so far of each group, so that groups keep their own order
    key = np.concatenate([np.maximum.accumulate(part.ns) for part in taken])
    order = np.argsort(key, kind="stable")
    return Part(ns[order], bus[order], id_[order], flags[order], length[order], join_octets(data)[order])
