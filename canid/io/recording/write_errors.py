"""A write that fails ends a file, not the recording.

The file is closed where it is whole. The recording goes on in a new one: in the same folder, where a full disk's ring may
give its oldest files, else in the nearest other folder that takes it. Frames that no file takes wait in memory
(`log_writer_thread`) while that is tried again.
"""

from __future__ import annotations

import errno
import time
from typing import TYPE_CHECKING

from canid.io.files.held_folder import HeldFolder
from canid.values.errors import OutputError
from canid.values.frame_columns import join
from canid.values.types import Columns

if TYPE_CHECKING:
    from canid.io.recording.log_files import LogFiles

# errors that the deletion of a file may end
_FULL = (errno.ENOSPC, errno.EDQUOT)
# s between two trials; the first comes at once. A disk that fails now and then gets no more than a file per second.
_MIN_PAUSE_S, _MAX_PAUSE_S = 0.125, 1.0
# Files of a ring that a full disk may cost at once, and s until it may cost more: where their room does not help, because
# another program takes it or a quota counts otherwise, the ring must not be gone within a second.
_MAX_DELETIONS, _DELETION_PAUSE_S = 2, 5.0
# s without an error after which the next one counts as the first
_QUIET_S = 10.0


class WriteErrors:
    """Reacts to writes and syncs that fail, in the writing thread."""

    def __init__(self, files: LogFiles):
        self._files = files
        self.count = 0
        self.first = ""  # the first error
        self.held: list[Columns] = []  # frames that no file took yet, in session time
        self._latest_at = -_QUIET_S
        self._pause = 0.0
        self._retry_at = 0.0
        self._deletions_from = 0.0  # s, monotonic clock: when the ring may be asked for room again
        self._progress = False  # the latest file took some frames
        self._waits = False  # it was reported that no file can be written

    @property
    def says(self) -> str:
        """The errors so far in one line; "": none.

        >>> errors = WriteErrors(None)
        >>> errors.first, errors.count = "cannot write x.blf: Input/output error", 3
        >>> errors.says
        '3 write errors, the first: cannot write x.blf: Input/output error'
        """
        return self.first if self.count < 2 else f"{self.count:,} write errors, the first: {self.first}"

    @property
    def waiting(self) -> int:
        """Frames that no file took yet."""
        return sum(len(chunk.t) for chunk in self.held)

    def leave(self, error: Exception, *rest: Columns) -> None:
        """The current file has failed: end it, and go on in another one; `rest`: frames that it did not take."""
        writer = self._files.writer
        self.held += [*(self._files.unsaved_of(writer) if writer is not None else ()), *rest]
        if writer is None:
            return
        self._files.end_broken(writer)
        self.note(error, f"; {writer.path.name} ends after {writer.kept:,} frames" if writer.kept else "")
        now = time.monotonic()
        quiet, self._latest_at = now - self._latest_at > _QUIET_S, now
        self._wait(0.0 if quiet else self._longer())
        self.resume()

    def note(self, error: Exception, what_follows: str = "") -> None:
        """Count an error and report it."""
        self.count += 1
        self.first = self.first or str(error)
        self._files.report("write_error", f"{error}{what_follows}")

    def resume(self, *, at_once: bool = False) -> bool:
        """Whether frames can be appended: where the file has ended, another one is begun, if that is due."""
        files = self._files
        if files.writer is not None:
            return True
        if not at_once and time.monotonic() < self._retry_at:
            return False
        ended = files.path.name
        for folder in files.folders.candidates():
            if self._begin_with_room(folder):
                self._waits = False
                says = f"{ended} could not be written: the recording goes on in {files.path}"
                files.report("recording_resumed", says)
                return True
        self._wait(self._longer())
        if not self._waits:
            self._waits = True
            says = f"no folder takes a file ({self.first}): frames wait in memory, and it is tried again"
            files.report("recording_waits", says)
        return False

    def _begin_with_room(self, folder: HeldFolder) -> bool:
        """Begin a file in a folder; where that is full, the ring's oldest files are deleted for it."""
        deleted = 0
        while (error := self._begin_in(folder)) is not None:
            if error.errno not in _FULL:
                if self._progress:
                    continue  # as where a file may not grow beyond a limit
                return False
            if time.monotonic() < self._deletions_from:
                return False
            deleted += 1
            if deleted > _MAX_DELETIONS or not self._files.folders.delete_oldest(folder):
                self._deletions_from = time.monotonic() + _DELETION_PAUSE_S
                return False
        return True

    def _begin_in(self, folder: HeldFolder) -> OutputError | None:
        """Begin a file in a folder and write into it what waits; the error where that fails."""
        files, self._progress = self._files, False
        try:
            files.replace(files.folders.open_in(folder))
        except OutputError as error:
            return error
        held = join(self.held) if self.held else None
        self.held = []
        try:
            if held is not None:
                files.append_rows(held)
            files.write_out()
        except OutputError as error:
            assert files.writer is not None
            self.held = [*files.unsaved_of(files.writer), *([] if held is None else files.rest_of(held))]
            self._progress = files.writer.kept > 0
            files.end_broken(files.writer)
            return error
        return None

    def _longer(self) -> float:
        return min(max(2 * self._pause, _MIN_PAUSE_S), _MAX_PAUSE_S)

    def _wait(self, pause: float) -> None:
        self._pause, self._retry_at = pause, time.monotonic() + pause
