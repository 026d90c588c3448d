"""A .blf that can be killed at any time: `checkpoint()` makes everything appended so far a complete file.

The header's start has milliseconds only. The rest of the start goes into every object's time (`timestamps.log_zero`),
so the UTC start is kept to the nanosecond and the times between frames are kept exactly.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import deflate
import numpy as np

from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import ChangedError, Disk
from canid.io.logs.blf import blf_encoding
from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_marker import marker
from canid.io.logs.own_times import check_own_times
from canid.io.logs.writer import Writer
from canid.values.errors import OutputError
from canid.values.types import Columns, Event

# Vector's and python-can's container size; bigger gains nothing, and a damaged container is lost whole.
CONTAINER_BYTES = 128 * 1024
# libdeflate's default: a third of zlib's time at its own default, and no larger; not configurable, so that equal frames
# give equal bytes.
_LEVEL = 6
# times that the header of a file whose disk fails is written
_HEADER_TRIES = 10
# Application id of python-can and API version 2.6.8.1: what other tools have seen most.
_APPLICATION = (5, 0, 0, 0, 2, 6, 8, 1)


class BlfWriter(Writer):
    """Appends frames to a new .blf.

    Every write may raise OutputError; what the last `checkpoint()` wrote stays readable.
    """

    def __init__(
        self, path: str | os.PathLike[str], start_ns: int | None = None, folder: HeldFolder | None = None
    ):
        """Create the file; it holds a header at once.

        `start_ns`: epoch ns of t = 0; None: unknown yet, assign `self.start_ns` before the first `append`. `folder`: as of
        `canid.io.files.new_file.Disk`.
        """
        super().__init__(start_ns)
        self._buffer: list[bytes | memoryview] = []
        self._uncompressed = self._size = blf.FILE_HEADER_SIZE
        self._last = 0  # ns, the latest frame's
        self.disk = Disk(Path(path), head=self._header(), folder=folder)

    def append_columns(self, chunk: Columns) -> None:
        """Take frames; full containers are written at once, the rest at the next `checkpoint()`.

        Where that fails, `frames` says how many were taken. Raises ValueError, before any is taken, where one of them
        fits no object or is earlier than `earliest_ns`.
        """
        if not len(chunk.t):
            return
        ns = np.rint(chunk.t * 1e9).astype(np.int64)
        encoded = blf_encoding.encode(chunk, ns - self.earliest_ns)
        octets, ends = encoded.octets.data, encoded.ends
        latest = np.maximum.accumulate(ns)
        row = begin = 0
        while row < len(ns):
            # as many as the container has room for; where that is none, it is full
            end = int(np.searchsorted(ends, begin + CONTAINER_BYTES - self.waiting, "right"))
            if end == row:
                self._write_container()
                continue
            self._buffer.append(octets[begin : int(ends[end - 1])])
            self.waiting += int(ends[end - 1]) - begin
            self.frames += end - row
            self._last = max(self._last, int(latest[end - 1]))
            row, begin = end, int(ends[end - 1])

    def note(self, event: Event) -> None:
        """Write an event between the frames, as a global marker; other readers show it or skip it.

        The header's count is of frames: readers that skip markers find as many as it states.
        """
        stamp = round(event.t * 1e9) - self.earliest_ns
        check_own_times(np.array([stamp]))
        self._add(marker(event, stamp))

    def abandon(self) -> None:
        """Close without writing any more: the disk has failed, what was written whole stands."""
        # the header needs no more space, and counts the containers that were written since the last checkpoint; errors
        # that come and go must not leave one that contradicts them
        for _ in range(_HEADER_TRIES):
            with contextlib.suppress(OutputError, ValueError):
                self.disk.put(0, self._header())
                break
        super().abandon()

    def _add(self, item: bytes) -> None:
        if self.waiting + len(item) > CONTAINER_BYTES:
            self._write_container()
        self._buffer.append(item)
        self.waiting += len(item)

    def _write(self) -> None:
        """Write container and header."""
        self._write_container()
        self.disk.put(0, self._header())

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
        self.waiting = 0
        self.kept = self.frames

    def _header(self) -> bytes:
        stop = None if self.start_ns is None else self.start_ns + self._last
        header = blf.FILE_HEADER.pack(
            blf.FILE_SIGNATURE,
            blf.FILE_HEADER_SIZE,
            *_APPLICATION,
            self._size,
            self._uncompressed,
            self.kept,
            0,
            *blf.system_time(None if self.start_ns is None else self.start_ns + self.earliest_ns),
            *blf.system_time(stop),
        )
        return (header.ljust(blf.UTC_MARK_AT, b"\0") + blf.UTC_MARK).ljust(blf.FILE_HEADER_SIZE, b"\0")
