"""Reads a .blf, as columns or as a stream of frames; where the file is damaged, at most the bad container is lost."""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from canid.io.logs import local_time
from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_account import Account
from canid.io.logs.blf.blf_containers import FileStart, Gap, Payload, containers
from canid.io.logs.blf.blf_groups import WRONG
from canid.io.logs.blf.blf_layout import Clock, Data
from canid.io.logs.blf.blf_marker import MarkerEvent
from canid.io.logs.blf.blf_object_chain import Broken, chain
from canid.io.logs.blf.blf_objects import Walked, first_object, walk
from canid.io.logs.blf.blf_origin import is_of_canid
from canid.io.logs.damage import DamagedSpans
from canid.io.logs.joined_logs import Axis
from canid.io.logs.reader_state import Note, ReadState
from canid.values.errors import DamagedLogError, LogError
from canid.values.frame_columns import WantedIds, keep_memory
from canid.values.types import Columns, Event

# Containers are walked together up to this many bytes: numpy's overhead per step is spread over eight usual
# containers, and they still fit a processor's second cache.
BATCH_BYTES = 1024 * 1024
# events that are kept until the first frame comes: a recorder writes a handful before it
_MAX_EARLY_EVENTS = 1000
# frames of one chunk: more than the payloads of one batch usually hold
_CHUNK_FRAMES = 64 * 1024


def read_blf(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file. Raises LogError where it is not a .blf at all.

    `wanted`: frames with other ids may be left out.
    """
    keep_memory()
    with open(path, "rb") as file:
        header, start = _file_header(file, path, state.size)
        if header is not None and header.file_size > state.size:
            # a recorder may have completed the file since it was asked for its size; the header comes after what it counts
            state.size = os.fstat(file.fileno()).st_size
        reading = _Reading(state, header, wanted)
        if header is None:
            reading.lose(0, start, "the file's own header is damaged")
        elif start != header.size:
            reading.contradiction((Gap(0, start, f"the file's header claims a size of {header.size} bytes"),))
        waiting: list[Payload] = []
        size = 0
        nothing = True
        for item in containers(file, start, state.size, bare=None if start else False):
            state.done = item.at
            nothing = nothing and isinstance(item, Gap)
            if not isinstance(item, Payload):
                yield from reading.take(waiting)
                waiting, size = [], 0
                if isinstance(item, Gap):
                    reading.lose(*item)
                else:
                    reading.next_file(item)
                continue
            waiting.append(item)
            size += len(item.data)
            if size >= BATCH_BYTES or reading.first is None:
                yield from reading.take(waiting)
                waiting, size = [], 0
        if nothing and not start:
            raise LogError(f"{path} is not a BLF log: it does not begin with LOGG, and no container is in it")
        yield from reading.take(waiting)
        reading.end()


class _Reading:
    """State of one pass over a file, from payload to payload."""

    def __init__(self, state: ReadState, header: blf.FileHeader | None, wanted: WantedIds | None):
        self.first: int | None = None  # ns of the first frame, since the first header's start
        self._state = state
        self._account = Account()
        self._axis = Axis(state)
        self._start = _start_ns(header, state)
        self._shift = self._axis.begin(self._start, "")  # of this file's times
        self._header = header
        self._wanted = wanted
        self._rows = 0  # frames given so far
        self._early_events: list[tuple[int, MarkerEvent]] = []  # events that wait for the first frame
        self._damaged = DamagedSpans()
        self._carry: Data = b""  # an object that continues in the next container
        self._middle = bytearray()  # what follows it, in containers that hold nothing else
        self._missing = 0  # bytes that it still lacks; 0: it is whole, or that is not known yet
        self._source = (0, 0)  # the bytes of the container that it began in
        self._checked = True  # a checksum confirms what is carried over
        self._aligned = True  # the next payload begins with an object, or continues `carry`

    def take(self, payloads: list[Payload]) -> Iterator[Columns]:
        """Walk payloads that follow each other: together or, where that fails, one by one."""
        self._account.inflated += sum(
            len(p.data) + (0 if p.bare else blf.CONTAINER_HEAD_SIZE) for p in payloads
        )
        for payload in payloads:
            self.contradiction(payload.contradictions)
        checked = self._checked and all(payload.checked for payload in payloads)
        if len(payloads) > 1 and self._aligned and self._missing <= len(payloads[0].data):
            data = b"".join([self._carry, *(payload.data for payload in payloads)])
            last = payloads[-1]
            try:
                walked = walk(data, 0, self._own_first(), self._wanted, checked=checked)
            except Broken:
                pass
            else:
                if not (walked.contradiction or walked.wrong) and _begins_in_each(
                    walked, len(self._carry), payloads
                ):
                    yield from self._advance(walked, data, last)
                    return
        for payload in payloads:
            yield from self._walk_one(payload)

    def _walk_one(self, payload: Payload) -> Iterator[Columns]:
        """Walk one payload; a broken one is lost whole, since its plausible parts may be damaged as well."""
        why = ""
        begun = bool(self._carry.strip(b"\0"))
        if begun and self._reaches_over(payload.data):
            why = "an object claims to be so long that others would stand in it"
        elif self._missing > len(payload.data):
            self._middle += payload.data
            self._missing -= len(payload.data)
            return
        elif self._carry:
            data = b"".join([self._carry, self._middle, payload.data])
            try:
                walked = walk(
                    data, 0, self._own_first(), self._wanted, checked=self._checked and payload.checked
                )
                if begun and not len(walked.begin) and self._holds_frames(payload.data):
                    raise Broken("an object claims to be so long that others would stand in it")
            except Broken as broken:
                why = str(broken)
            else:
                yield from self._advance(walked, data, payload)
                return
        if not why and len(payload.data) <= blf.MAX_PADDING_BYTES and not payload.data.strip(b"\0"):
            return  # nothing but padding
        begin = 0
        missing = (
            len(payload.data) > blf.MAX_PADDING_BYTES
            and blf.SIGNATURE not in payload.data[: blf.MAX_PADDING_BYTES]
        )
        if missing or not self._aligned or why:
            begin = first_object(payload.data)
            why = why or ("a container begins within an object" if self._aligned else "")
        try:
            if begin < 0:
                raise Broken("no object begins where one should")
            walked = walk(payload.data, begin, self._own_first(), self._wanted, checked=payload.checked)
        except Broken as broken:
            singles = _singles(payload) if payload.bare else []
            if len(singles) > 1:
                yield from self.take(singles)
                return
            self.lose(payload.at, payload.end, why or str(broken))
            return
        if why:
            # this payload is intact: what precedes it is damaged or missing
            self.lose(*self._source, why)
        yield from self._advance(walked, payload.data, payload)

    def _reaches_over(self, data: Data) -> bool:
        """Whether the unfinished object would extend over a payload that is a row of frames."""
        # it should end within the payload: an intact row from the payload's first byte on contradicts that
        if self._missing <= len(data) and not (data.startswith(blf.SIGNATURE) and first_object(data) == 0):
            return False
        return self._holds_frames(data)

    def _holds_frames(self, data: Data) -> bool:
        """Whether a payload that should be the middle of one long object is a row of frames."""
        begin = first_object(data)
        try:
            return begin >= 0 and walk(data, begin, self._own_first()).frames.t.size > 0
        except Broken:
            return False

    def _advance(self, walked: Walked, data: Data, last: Payload) -> Iterator[Columns]:
        """Update the state after a walk that ends with the payload `last`, and yield its frames."""
        self._aligned = True
        carry = self._carry = data[walked.rest :]
        begun = len(carry) >= blf.OBJECT.size and carry.startswith(blf.SIGNATURE)
        self._missing = blf.OBJECT.unpack_from(carry)[3] - len(carry) if begun else 0
        self._checked = last.checked
        self._middle = bytearray()
        if walked.wrong:
            self._damaged.add(last.at, last.end, WRONG, walked.wrong)
        if walked.contradiction:
            self.contradiction((Gap(last.at, last.end, walked.contradiction),))
        self._source = last.at, last.end
        self._account.objects += walked.objects
        self._state.frames += walked.frames_read
        self._state.events += len(walked.notes)
        self._state.other_kinds.update(walked.kinds)
        if self.first is None and walked.first is not None:
            self.first = walked.first + self._shift
            self._state.start_ns = None if self._start is None else self._start + walked.first
        if walked.last is not None:
            self._axis.last = walked.last + self._shift
        if self._state.notes is not None:
            self._hand_out(self._state.notes, walked.notes)
        self._rows += walked.frames.t.size
        # in parts, so that progress is seen within a very large container too
        t, bus, id_, flags, length, payload = walked.frames
        for begin in range(0, t.size, _CHUNK_FRAMES):
            self._state.unpacked += _CHUNK_FRAMES
            k = slice(begin, begin + _CHUNK_FRAMES)
            yield Columns(t[k], bus[k], id_[k], flags[k], length[k], payload[k])

    def _hand_out(self, notes: list[Note], events: list[tuple[int, MarkerEvent]]) -> None:
        """Hand out the events, once there is a first frame that their times can count from."""
        shift = self._shift
        events = [
            (self._rows + before, event._replace(stamp=event.stamp + shift)) for before, event in events
        ]
        if self.first is None:
            self._early_events = (self._early_events + events)[:_MAX_EARLY_EVENTS]
            return
        for row, (stamp, what, says) in self._early_events + events:
            notes.append(Note(row, Event((stamp - self.first) * 1e-9, what, says)))
        self._early_events = []

    def contradiction(self, contradictions: Iterable[Gap]) -> None:
        """Report inconsistencies that cost no data."""
        for begin, end, why in contradictions:
            self._damaged.add(begin, end, why)

    def lose(self, begin: int, end: int, why: str) -> None:
        """Report lost bytes; the next object has to be searched for."""
        self._damaged.add(begin, end, why)
        self._carry, self._middle, self._missing, self._aligned = b"", bytearray(), 0, False

    def next_file(self, further: FileStart) -> None:
        """A further file begins: its times continue at its own date."""
        self._end_of_objects(further.at)
        self._account.close(self._header, further.at, self._damaged, at_end=False)
        self._carry, self._middle, self._missing, self._aligned, self._checked = (
            b"",
            bytearray(),
            0,
            True,
            True,
        )
        self._header = further.header
        self._start = _start_ns(further.header, self._state)
        self._shift = self._axis.begin(self._start, f"byte {further.at}")

    def end(self) -> None:
        """Sum up."""
        size = self._state.size
        self._end_of_objects(size)
        self._state.done = size
        self._account.close(self._header, size, self._damaged, at_end=True)
        self._state.damage = self._account.damage(self._damaged)
        self._state.damaged = self._damaged.count

    def _own_first(self) -> int | None:
        """Ns of the first frame, since this file's header's start."""
        return None if self.first is None else self.first - self._shift

    def _end_of_objects(self, at: int) -> None:
        if self._carry.strip(b"\0"):
            self._damaged.add(self._source[0], at, "the file ends in an object")


def _start_ns(header: blf.FileHeader | None, state: ReadState) -> int | None:
    """Epoch ns of a header's start, by the rule of `local_time`; None where it states none."""
    if header is None or header.start is None:
        return None
    zone = state.zone
    if header.clock is Clock.UTC:
        zone = datetime.UTC
    elif header.clock is Clock.UNSTATED:
        if zone is not datetime.UTC:
            state.start_says = local_time.UNSTATED if zone is None else local_time.NAMED
        zone = zone or datetime.UTC
    return local_time.epoch_ns(header.start, zone)


def _begins_in_each(walked: Walked, begin: int, payloads: list[Payload]) -> bool:
    """Whether objects begin in each payload, and at its first byte where it begins with a signature.

    `begin`: where the first payload begins in what was walked.
    """
    for payload in payloads:
        end = begin + len(payload.data)
        k = int(walked.begin.searchsorted(begin))
        at = int(walked.begin[k]) if k < len(walked.begin) else walked.rest
        if not begin <= at < end or (at > begin and payload.data.startswith(blf.SIGNATURE)):
            return False
        begin = end
    return True


def _singles(payload: Payload) -> list[Payload]:
    """The objects of a payload without a container, one each."""
    objects = chain(payload.data, 0)
    spans = zip(objects.begin.tolist(), objects.size.tolist(), strict=True)
    return [
        Payload(payload.at + begin, payload.at + begin + size, payload.data[begin : begin + size], bare=True)
        for begin, size in spans
    ]


def _file_header(file: BinaryIO, path: Path, size: int) -> tuple[blf.FileHeader | None, int]:
    """Return the header, None where it is damaged, and the byte where the first object should be; 0: anywhere."""
    head = file.read(blf.FILE_HEADER_SIZE + len(blf.SIGNATURE))
    usual = head.endswith(blf.SIGNATURE)
    if not head.startswith(blf.FILE_SIGNATURE) and not usual:
        return None, 0  # perhaps there are containers somewhere
    if len(head) < blf.FILE_HEADER.size:
        raise DamagedLogError(f"{path} is cut off in its header: {size} bytes")
    early = head.find(blf.SIGNATURE)
    if 0 < early < blf.FILE_HEADER.size:
        return None, early
    header = blf.parse_file_header(head)
    if header.clock is Clock.UNSTATED and is_of_canid(file):
        header = header._replace(clock=Clock.UTC)
    if usual:
        return header, blf.FILE_HEADER_SIZE
    if early > 0:
        return header, early
    # Every known writer's header has 144 bytes. Others are accepted within limits: `containers` finds the objects.
    is_plausible = blf.FILE_HEADER.size <= header.size <= blf.MAX_FILE_HEADER_SIZE
    return header, header.size if is_plausible else blf.FILE_HEADER_SIZE
