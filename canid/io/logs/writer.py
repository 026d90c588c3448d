"""A log that is being written: what the writers of all formats have and share."""

from __future__ import annotations

from pathlib import Path

from canid.io.files.new_file import Disk
from canid.values import timestamps
from canid.values.frame_columns import columns_of
from canid.values.types import Columns, Event, Frame


class Writer:
    """A writer of any format; all methods but `abandon` raise OutputError where the disk fails."""

    disk: Disk  # the file on the disk

    def __init__(self, start_ns: int | None):
        """`start_ns`: epoch ns of t = 0; None: unknown yet."""
        # both may be assigned until the first `append`; the second: how far the file's own zero lies before t = 0
        self.start_ns = start_ns
        self.lead_ns = 0
        self.frames = 0  # appended
        self.kept = 0  # frames that are in the file already
        # bytes that were appended and not written yet; in the file they are no more than that, but for a header
        self.waiting = 0

    @property
    def path(self) -> Path:
        """The file."""
        return self.disk.path

    @property
    def earliest_ns(self) -> int:
        """The earliest t that the file holds, ns: no format has times before its zero. Mostly negative."""
        return -timestamps.log_zero(self.start_ns, self.lead_ns)[1]

    @property
    def bytes(self) -> int:
        """Bytes in the file so far."""
        return self.disk.size

    def append(self, frame: Frame) -> None:
        """Take one frame."""
        self.append_columns(columns_of([frame]))

    def append_columns(self, chunk: Columns) -> None:
        """Take frames; where that fails, `frames` says how many were taken.

        Raises ValueError, before any is taken, where the format cannot hold one of them, such as a time before
        `earliest_ns`.
        """
        raise NotImplementedError

    def note(self, event: Event) -> None:
        """Write an event between the frames, where the format can."""
        raise NotImplementedError

    def checkpoint(self, *, sync: bool = True) -> None:
        """Make the file complete as it stands, and (`sync`) have it on the disk itself."""
        self._write()
        if sync:
            self.sync()

    def sync(self) -> None:
        """Sync what was written to the disk itself; another thread may call this at any time."""
        self.disk.sync()

    def complete(self) -> None:
        """Write the end, and have all of it on the disk; the file stays open."""
        self.checkpoint()

    def close(self) -> None:
        """Write the end and close; a second call does nothing."""
        if self.disk.closed:
            return
        try:
            self.complete()
        finally:
            self.disk.close()

    def abandon(self) -> None:
        """Close without writing any more."""
        self.disk.close()

    def _write(self) -> None:
        """Write what waits."""
        raise NotImplementedError
