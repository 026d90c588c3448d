"""All signals of DBC files in a log: the frames of each message as columns, and the values of any signal in them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs import Log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.samples import session_clock
from canid.signals.vehicle import transport_protocol
from canid.signals.vehicle.bits import EXACT_BITS, Payloads, payloads, raws_of, scaled
from canid.signals.vehicle.containers import contained
from canid.signals.vehicle.database import bits_of, carried, condition_of
from canid.signals.vehicle.j1939 import first_no_value
from canid.signals.vehicle.transport_protocol import Transfers
from canid.values.frame_columns import join_octets
from canid.values.types import Array, Columns, Flag
from canid.values.window import WHOLE, Window

NO_DATA = int(Flag.REMOTE | Flag.ERROR)
# frames that are sorted by message at once: numpy's overhead is spread over them
FRAMES_PER_ROUND = 262_144


class MessageKey(NamedTuple):
    """What makes frames the same message."""

    bus: int
    id: int
    extended: bool


class MessageFrames(NamedTuple):
    """All data frames of one message on one bus, in the order of the log."""

    t: Array  # (n,) s since the log's first frame
    length: npt.NDArray[np.uint8]  # (n,) bytes
    data: npt.NDArray[np.uint8]  # (n, 8) or (n, 64)


class SignalColumn(NamedTuple):
    """A signal as it came."""

    t: Array  # (n,) s
    value: Array  # (n,) physical, in the DBC's own unit; NaN: the frame was too short for it
    raw: npt.NDArray[
        Any
    ]  # (n,) as in the frame, whole numbers exactly; where the value is NaN it means nothing

    def texts(self, signal: Signal) -> list[str]:
        """What the value table says of each; "": nothing."""
        choices = signal.choices
        known = np.isfinite(self.value).tolist()
        return [
            choices.get(raw, "") if there else "" for raw, there in zip(self.raw.tolist(), known, strict=True)
        ]


def frames_by_message(
    log: Log,
    *,
    ids: Collection[int] | None = None,
    within: Window = WHOLE,
    progress: Callable[[float], None] | None = None,
    groups: Collection[int] = (),
) -> dict[MessageKey, MessageFrames]:
    """Read a log once; the data frames of each message, on each bus (no remote and no error frames).

    Args:
        log: from `open_log`.
        ids: only these; None: all.
        within: the part of the log.
        progress: called now and then with the fraction that was read.
        groups: J1939 parameter groups whose messages may come in packets, see `transport_protocol`.

    Returns:
        in the order of bus and id. Memory: 17 bytes for each frame (73 where a frame of the log is longer than 8 bytes).

    Raises:
        LogError: the log cannot be read.

    Example:
        >>> from canid.io.logs import open_log
        >>> from canid.values.shipped_files import shipped
        >>> frames = frames_by_message(open_log(shipped().parent / "replay_logs" / "following_lost_lead.blf"))
        >>> key = MessageKey(0, 0x110, False)
        >>> frames[key].data.shape == (len(frames[key].t), 8)
        True
    """
    parts: dict[MessageKey, list[MessageFrames]] = {}
    transfers: Transfers = {}
    for chunks in rounds(log, ids=ids, progress=progress):
        transfers, chunks = with_messages(transfers, chunks, groups)
        for key, part in by_message(chunks, ids=ids, within=within).items():
            parts.setdefault(key, []).append(part)
    return {key: joined(parts[key]) for key in sorted(parts)}


def with_messages(
    transfers: Transfers, chunks: Sequence[Columns], groups: Collection[int]
) -> tuple[Transfers, list[Columns]]:
    """Some chunks, and in them the J1939 messages whose packets they hold; the transfers go on to the next chunks."""
    out = []
    for chunk in chunks:
        transfers, made = transport_protocol.step(transfers, chunk, groups)
        out.append(transport_protocol.inserted(chunk, made))
    return transfers, out


def rounds(
    log: Log, *, ids: Collection[int] | None = None, progress: Callable[[float], None] | None = None
) -> Iterator[list[Columns]]:
    """Read a log once, some 260,000 frames at a time: memory is bounded however long it is.

    Args:
        log: from `open_log`.
        ids: that are wanted; others may be left out.
        progress: called now and then with the fraction that was read.

    Yields:
        the columns of a round, in the order of the log.

    Raises:
        LogError: the log cannot be read.
    """
    waiting: list[Columns] = []
    n = 0
    for chunk in session_clock.unwrapped(log.columns(ids)):
        waiting.append(chunk)
        n += len(chunk.t)
        if progress is not None:
            progress(log.progress)
        if n >= FRAMES_PER_ROUND:
            yield waiting
            waiting, n = [], 0
    if waiting:
        yield waiting


def by_message(
    chunks: Iterable[Columns],
    *,
    ids: Collection[int] | None = None,
    within: Window = WHOLE,
) -> dict[MessageKey, MessageFrames]:
    """Sort frames by message: data frames alone, the rows of each in the order of the log.

    Args:
        chunks: of a log.
        ids: only these; None: all.
        within: the part of the log.

    Returns:
        in the order of bus and id.

    Example:
        >>> from canid.values.frame_columns import columns_of
        >>> from canid.values.types import Frame
        >>> chunk = columns_of([Frame(0.0, 1, 7, b"ab"), Frame(0.1, 0, 9, b""), Frame(0.2, 1, 7, b"cd")])
        >>> [(key.bus, key.id, frames.t.tolist()) for key, frames in by_message([chunk]).items()]
        [(0, 9, [0.1]), (1, 7, [0.0, 0.2])]
    """
    wanted = None if ids is None else list(ids)
    parts: dict[MessageKey, list[MessageFrames]] = {}
    for chunk in chunks:
        kept = (chunk.flags & NO_DATA == 0) & within.holds(chunk.t)
        if wanted is not None:
            kept &= np.isin(chunk.id, wanted)
        rows = np.flatnonzero(kept)
        if not rows.size:
            continue
        # bus, id and the flag of an extended id (1) in one number
        key = chunk.bus[rows].astype(np.uint64) << np.uint64(32)
        key |= (chunk.id[rows].astype(np.uint64) << np.uint64(1)) | (chunk.flags[rows] & 1).astype(np.uint64)
        order = np.argsort(key, kind="stable")
        sorted_key = key[order]
        edges = np.flatnonzero(np.diff(sorted_key)) + 1
        for piece in np.split(order, edges):
            number = int(key[piece[0]])
            name = MessageKey(number >> 32, (number >> 1) & 0x1FFFFFFF, bool(number & 1))
            at = rows[piece]
            parts.setdefault(name, []).append(MessageFrames(chunk.t[at], chunk.length[at], chunk.data[at]))
    return {key: joined(parts[key]) for key in sorted(parts)}


def joined(parts: Sequence[MessageFrames]) -> MessageFrames:
    """Frames of one message, one part after the other."""
    if len(parts) == 1:
        return parts[0]
    t, length, data = zip(*parts, strict=True)
    return MessageFrames(np.concatenate(t), np.concatenate(length), join_octets(data))


def decode(
    message: Message, signal: Signal, frames: MessageFrames, whole: Payloads | None = None
) -> SignalColumn | None:
    """Decode one signal: raw · scale + offset. A multiplexed signal has the rows of its own pages alone.

    Args:
        message: that has the signal.
        signal: to decode.
        frames: of the message.
        whole: `payloads` of the frames, for those who decode several signals of them; None: made here.

    Returns:
        None where no frame can carry the signal. NaN where the frame is too short, or a J1939 parameter is in error, not
        available or reserved. Value-table entries are numbers as all others: `signal.choices`
        says what they mean.
    """
    whole = payloads(frames.data, frames.length) if whole is None else whole
    if not signal.elsewhere:
        return _decode_place(message, signal, frames, whole)
    columns = [_decode_place(message, each, frames, whole) for each in (signal, *signal.elsewhere)]
    known = [column for column in columns if column is not None]
    if not known:
        return None
    t, value = (np.concatenate(parts) for parts in list(zip(*known, strict=True))[:2])
    # whole numbers of different types would become doubles
    kinds = {column.raw.dtype for column in known}
    raw = np.concatenate([column.raw if len(kinds) == 1 else column.raw.astype(object) for column in known])
    order = np.argsort(t, kind="stable")
    return SignalColumn(t[order], value[order], raw[order])


def is_wide(signal: Signal) -> bool:
    """Whether a signal is a whole number that may need more digits than a double has: of 54 bits and more.

    Example:
        >>> plain = Signal("S", 0, 64, False, False, False, 1.0, 0.0, None, None, "", {}, False, None, ())
        >>> is_wide(plain), is_wide(plain._replace(scale=0.5)), is_wide(plain._replace(length=53))
        (True, False, False)
    """
    whole = not signal.floating and signal.scale.is_integer() and signal.offset.is_integer()
    return whole and signal.length > EXACT_BITS and not signal.elsewhere


def whole_values(signal: Signal, column: SignalColumn) -> list[int | None]:
    """The values of a wide signal to the last digit; None where there is none."""
    scale, offset = int(signal.scale), int(signal.offset)
    known = np.isfinite(column.value).tolist()
    return [
        int(raw) * scale + offset if there else None
        for raw, there in zip(column.raw.tolist(), known, strict=True)
    ]


def _decode_place(
    message: Message, signal: Signal, frames: MessageFrames, whole: Payloads
) -> SignalColumn | None:
    """The same, of the pages on which a signal lies and is scaled in one way."""
    condition = condition_of(message, signal) if carried(signal) else None
    if condition is None:
        return None
    t = frames.t
    if message.container is not None:
        holding, data, length = contained(message.container, frames.data, frames.length)
        t, whole = t[holding], payloads(data, length)
    if condition:
        rows = np.ones(len(t), bool)
        for bits, pages in condition:
            raw, long_enough = raws_of(bits, whole)
            rows &= np.isin(raw, list(pages))
            if long_enough is not None:
                rows &= long_enough
        t, whole = t[rows], payloads(whole.data[rows], whole.length[rows])
    bits = bits_of(signal)
    raw, long_enough = raws_of(bits, whole)
    value = scaled(bits, raw, signal.scale, signal.offset)
    if long_enough is not None:
        value[~long_enough] = np.nan
    reserved = first_no_value(message, signal)
    if reserved is not None:
        value[raw >= reserved[0]] = np.nan
    return SignalColumn(t, value, raw)
