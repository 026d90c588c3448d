"""Reads a .blf, as columns or as a stream of frames; where the file is damaged, at most the bad container is lost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from canid.errors import LogError
from canid.frames import blf_layout as blf
from canid.frames.blf_chain import Broken, chain
from canid.frames.blf_containers import Gap, Payload, containers
from canid.frames.blf_objects import first_object, walk
from canid.frames.columns import Wanted, frames_of, keep_memory
from canid.frames.read_state import ReadState
from canid.types import Columns, Damage, Frame

# Containers are walked together up to this many bytes: numpy's overhead per step is spread over eight usual
# containers, and they still fit a processor's second cache.
BATCH = 1024 * 1024


def read_blf(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file. Raises LogError where it is not a .blf at all."""
    for chunk in read_blf_columns(path, state):
        yield from frames_of(chunk)


def read_blf_columns(path: Path, state: ReadState, wanted: Wanted | None = None) -> Iterator[Columns]:
    """Columns in the order of the file. Raises LogError where it is not a .blf at all.

    `wanted`: frames with other ids may be left out.
    """
    keep_memory()
    with open(path, "rb") as file:
        header, start = _file_header(file, path, state.size)
        reading = _Reading(state, header, wanted)
        waiting: list[Payload] = []
        size = 0
        for item in containers(file, start, state.size):
            state.done = item.at
            if isinstance(item, Gap):
                yield from reading.take(waiting)
                reading.gap(item)
                waiting, size = [], 0
                continue
            waiting.append(item)
            size += len(item.data)
            if size >= BATCH or reading.first is None:
                yield from reading.take(waiting)
                waiting, size = [], 0
        yield from reading.take(waiting)
        reading.end()


class _Reading:
    """One pass over a file: what continues from payload to payload."""

    def __init__(self, state: ReadState, header: blf.FileHeader, wanted: Wanted | None):
        self.first: int | None = None  # ns of the first frame, since the header's start
        self._state = state
        self._header = header
        self._wanted = wanted
        self._objects = 0
        self._gaps: list[Gap] = []
        self._carry = b""  # an object that continues in the next container
        self._aligned = True  # the next payload begins with an object, or continues `carry`

    def take(self, payloads: list[Payload]) -> Iterator[Columns]:
        """Walk payloads that follow each other: together or, where that fails, one by one."""
        if len(payloads) > 1 and self._aligned:
            data = b"".join([self._carry, *(payload.data for payload in payloads)])
            try:
                yield from self._walk(data, 0)
            except Broken:
                pass
            else:
                return
        for payload in payloads:
            data = self._carry + payload.data if self._carry else payload.data
            begin = 0 if self._aligned else first_object(data)
            self._carry = b""
            if begin < 0:
                continue
            try:
                yield from self._walk(data, begin)
            except Broken as broken:
                single = _single(payload) if payload.bare else []
                if len(single) > 1:
                    yield from self.take(single)
                    continue
                # the container is lost whole: what looked well in it may not be
                self._gaps.append(Gap(payload.at, str(broken)))
                self._aligned = False

    def _walk(self, data: bytes, begin: int) -> Iterator[Columns]:
        walked = walk(data, begin, self.first, self._wanted)
        self._aligned = True
        self._carry = data[walked.rest :]
        self._objects += walked.objects
        if self.first is None and walked.first is not None:
            self.first = walked.first
            if self._header.start_ms is not None:
                self._state.start_ns = self._header.start_ms * 1_000_000 + self.first
        if walked.frames.t.size:
            yield walked.frames

    def gap(self, gap: Gap) -> None:
        """Something was lost in the file: whatever comes next has to be found."""
        self._gaps.append(gap)
        self._carry, self._aligned = b"", False

    def end(self) -> None:
        """Sum up."""
        size = self._state.size
        if self._carry.strip(b"\0"):
            self._gaps.append(Gap(size, "the file ends in an object"))
        self._state.done = size
        self._state.damage = _damage(self._header, size, self._objects, self._gaps)


def _single(payload: Payload) -> list[Payload]:
    """The objects of a payload without a container, one each."""
    found = chain(payload.data, 0)
    spans = zip(found.begin.tolist(), found.size.tolist(), strict=True)
    return [
        Payload(payload.at + begin, payload.data[begin : begin + size], bare=True) for begin, size in spans
    ]


def _file_header(file: BinaryIO, path: Path, size: int) -> tuple[blf.FileHeader, int]:
    """Return the header, and the byte where the first object should be."""
    head = file.read(blf.FILE_HEADER_SIZE + len(blf.SIGNATURE))
    usual = head.endswith(blf.SIGNATURE)
    if not head.startswith(blf.FILE_SIGNATURE) and not usual:
        raise LogError(f"{path} is not a BLF log: it does not begin with LOGG")
    if len(head) < blf.FILE_HEADER.size:
        raise LogError(f"{path} is cut off in its header: {size} bytes")
    header = blf.parse_file_header(head)
    # Every known writer's header has 144 bytes. Believe others within reason: `containers` finds its way.
    believable = blf.FILE_HEADER.size <= header.size <= 4096 and not usual
    return header, header.size if believable else blf.FILE_HEADER_SIZE


def _damage(header: blf.FileHeader, size: int, objects: int, gaps: list[Gap]) -> Damage | None:
    # A killed writer leaves the counts of its last checkpoint, or none. A flipped bit can leave anything.
    plausible = objects <= header.objects and header.objects * blf.OBJECT.size <= header.uncompressed_size
    total = header.objects if plausible else -1
    if not gaps and size < header.file_size and not (plausible and objects == total):
        gaps = [Gap(size, f"the file ends here, {header.file_size - size} bytes early")]
    if not gaps:
        return None
    more = f", and {len(gaps) - 1} more" if len(gaps) > 1 else ""
    of = f" of {total}" if total >= 0 else ""
    return Damage(f"read {objects}{of} objects: {gaps[0].why} (byte {gaps[0].at}{more})", objects, total)
