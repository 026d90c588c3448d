"""A .blf that can be killed at any time: `checkpoint()` makes everything appended so far a complete file.

The header's start has milliseconds only. The rest of the start goes into every object's time, so the UTC
start is kept to the nanosecond and the times between frames are kept exactly.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from types import TracebackType

import deflate
import numpy as np

from canid.errors import OutputError
from canid.files.new_file import ChangedError, Disk
from canid.frame_columns import columns_of
from canid.logs.blf import blf_encoding
from canid.logs.blf import blf_layout as blf
from canid.logs.blf.blf_marker import marker
from canid.types import Columns, Event, Frame

# Vector's and python-can's container size; bigger gains nothing, and a damaged container is lost whole.
CONTAINER_BYTES = 128 * 1024
# libdeflate's default: a third of zlib's time at its own default, and no larger; not configurable, so that equal frames
# give equal bytes.
_LEVEL = 6
# Application id of python-can and API version 2.6.8.1: what other tools have seen most.
_APPLICATION = (5, 0, 0, 0, 2, 6, 8, 1)

# inside the class the name means the property
_Bytes = bytes


class BlfWriter:
    """Appends frames to a new .blf.

    Every write may raise OutputError; what the last `checkpoint()` wrote stays readable.
    """

    def __init__(self, path: str | os.PathLike[str], start_ns: int | None = None):
        """Create the file; it holds a header at once.

        `start_ns`: epoch ns of t = 0; None: unknown yet, assign `self.start_ns` before the first `append`.
        """
        self.start_ns = start_ns
        self.lead_ns = 0
        self.frames = 0
        self._buffer: list[bytes | memoryview] = []
        self._buffered = self._buffered_frames = 0
        self._uncompressed = self._size = blf.FILE_HEADER_SIZE
        self._last = 0  # ns, the latest frame's
        self.disk = Disk(Path(path), head=self._header())

    @property
    def path(self) -> Path:
        """The file."""
        return self.disk.path

    @property
    def kept(self) -> int:
        """Frames that are in the file, not waiting for their container."""
        return self.frames - self._buffered_frames

    @property
    def bytes(self) -> int:
        """Bytes in the file so far, without what waits for its container."""
        return self.disk.size

    @property
    def waiting(self) -> int:
        """Bytes that wait for their container, uncompressed."""
        return self._buffered

    def append(self, frame: Frame) -> None:
        """Take one frame."""
        self.append_columns(columns_of([frame]))

    def append_columns(self, chunk: Columns) -> None:
        """Take frames; full containers are written at once, the rest at the next `checkpoint()`.

        Where that fails, `frames` says how many were taken. Raises ValueError, before any is taken, where one of them
        fits no object.
        """
        if not len(chunk.t):
            return
        ns = np.rint(chunk.t * 1e9).astype(np.int64)
        encoded = blf_encoding.encode(chunk, ns + self._rest())
        octets, ends = encoded.octets.data, encoded.ends
        latest = np.maximum.accumulate(ns)
        row = begin = 0
        while row < len(ns):
            # as many as the container has room for; where that is none, it is full
            end = int(np.searchsorted(ends, begin + CONTAINER_BYTES - self._buffered, "right"))
            if end == row:
                self._write_container()
                continue
            self._buffer.append(octets[begin : int(ends[end - 1])])
            self._buffered += int(ends[end - 1]) - begin
            self.frames += end - row
            self._buffered_frames += end - row
            self._last = max(self._last, int(latest[end - 1]))
            row, begin = end, int(ends[end - 1])

    def note(self, event: Event) -> None:
        """Write an event between the frames, as a global marker; other readers show it or skip it.

        The header's count is of frames: readers that skip markers find as many as it states.
        """
        self._add(marker(event, round(event.t * 1e9) + self._rest()))

    def checkpoint(self, *, sync: bool = True) -> None:
        """Make the file complete as it stands: container, header, and (`sync`) down to the disk itself."""
        self._write_container()
        self.disk.put(0, self._header())
        if sync:
            self.sync()

    def sync(self) -> None:
        """Sync what was written to the disk itself; another thread may call this at any time."""
        self.disk.sync()

    def complete(self) -> None:
        """Checkpoint; the file stays open."""
        self.checkpoint()

    def close(self) -> None:
        """Checkpoint and close; a second call does nothing."""
        if self.disk.closed:
            return
        try:
            self.checkpoint()
        finally:
            self.disk.close()

    def abandon(self) -> None:
        """Close without writing any more: the disk has failed, what was written whole stands."""
        # the header needs no more space, and counts the containers that were written since the last checkpoint
        with contextlib.suppress(OutputError):
            self.disk.put(0, self._header())
        self.disk.close()

    def __enter__(self) -> BlfWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _rest(self) -> int:
        """Ns of the start that the header cannot keep: it has whole milliseconds."""
        return 0 if self.start_ns is None else (self.start_ns - self.lead_ns) % 1_000_000 + self.lead_ns

    def _add(self, item: _Bytes) -> None:
        if self._buffered + len(item) > CONTAINER_BYTES:
            self._write_container()
        self._buffer.append(item)
        self._buffered += len(item)

    def _write_container(self) -> None:
        if not self._buffer:
            return
        data = b"".join(self._buffer)
        packed = deflate.zlib_compress(data, _LEVEL)
        size = blf.CONTAINER_HEAD_SIZE + len(packed)
        head = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT.size, 1, size, blf.LOG_CONTAINER)
        # size % 4 zeros, not up to the next multiple of 4: the format has it so
        try:
            self.disk.append(head + blf.CONTAINER.pack(blf.DEFLATED, len(data)) + packed + b"\0" * (size % 4))
        except ChangedError:
            raise
        except OutputError:
            self.disk.keep(0)  # half a container is none
            raise
        self._uncompressed += blf.CONTAINER_HEAD_SIZE + len(data)
        self._size = self.disk.size
        self._buffer.clear()
        self._buffered = self._buffered_frames = 0

    def _header(self) -> _Bytes:
        stop = None if self.start_ns is None else self.start_ns + self._last
        header = blf.FILE_HEADER.pack(
            blf.FILE_SIGNATURE,
            blf.FILE_HEADER_SIZE,
            *_APPLICATION,
            self._size,
            self._uncompressed,
            self.kept,
            0,
            *blf.system_time(None if self.start_ns is None else self.start_ns - self.lead_ns),
            *blf.system_time(stop),
        )
        return header.ljust(blf.FILE_HEADER_SIZE, b"\0")
