"""Files of a recording that another program moves, deletes, hides or changes while they are written.

The recording goes on, in the same file where it was moved and in a new one otherwise; what can still be read of the
file is kept, by a copy where no name leads to it. Each is reported as an event.
"""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING

from canid.io.files.file_location import Place, Whereabouts
from canid.io.files.held_folder import HeldFolder, Standing
from canid.io.logs.writer import Writer
from canid.io.recording.log_restoration import Restored, restore
from canid.values.errors import OutputError
from canid.values.types import Columns

if TYPE_CHECKING:
    from canid.io.recording.log_files import LogFiles


def covered(folder: HeldFolder) -> str:
    """How to see what is in a folder that another one covers; "": none does.

    >>> covered(HeldFolder(Path("/")))
    ''
    """
    if folder.standing() is not Standing.COVERED:
        return ""
    return (
        f"something is mounted over {folder.path}, or took its name, and its files are not seen there;"
        f" `umount {folder.path}` shows them"
    )


class LostFiles:
    """Reacts to what `disk_sync` and failing writes find out about the files of a recording."""

    def __init__(self, files: LogFiles):
        self._files = files
        self._displaced: tuple[Writer, Whereabouts] | None = None  # found by the syncing thread
        self._reported: list[HeldFolder] = []  # that were covered
        self._moved_to: set[Path] = set()  # folders, with what was in them
        self.restoring: list[threading.Thread] = []

    # --- the syncing thread ---

    def displaced(self, writer: Writer, where: Whereabouts, finished: bool) -> None:
        """A file no longer has its name; the one being written is left to the writing thread."""
        if where.place is Place.COVERED:
            self._report_covered(writer.disk.folder)
        elif not finished:
            self._displaced = writer, where
        elif where.lost:
            if writer.kept or self._files.path == where.path:
                self._restore(writer, where)
            else:
                writer.disk.close()
        else:
            self._report_moved(writer, where)

    def changed(self, writer: Writer) -> None:
        """A finished file was changed before its end was written."""
        self._files.report("recording_changed", writer.disk.changed)
        self._lose_changed(writer)

    # --- the writing thread ---

    def leave_displaced(self) -> None:
        """Follow the file where it was moved; go on in a new one where it is out of reach."""
        displaced, self._displaced = self._displaced, None
        if displaced is None or displaced[0] is not self._files.writer:
            return
        writer, where = displaced
        if not where.lost:
            self._report_moved(writer, where)
            return
        try:
            writer.checkpoint(sync=False)  # into the file that has no name: it is copied from there
            unsaved: list[Columns] = []
        except OutputError:
            unsaved = self._files.unsaved_of(writer)
        self._leave(
            f"{where.path.name} {where.place.value} while it was being written",
            f"recording_{where.place.name.lower()}",  # recording_deleted, recording_hidden
            unsaved,
        )

    def leave_changed(self, why: str) -> None:
        """Another program has truncated the file, or written into it: leave it as it is and go on in a new one."""
        writer = self._files.writer
        if writer is None:
            return
        self._leave(why, "recording_changed", self._files.unsaved_of(writer))
        if writer.kept:
            self._lose_changed(writer)

    def _leave(self, why: str, what: str, unsaved: list[Columns]) -> None:
        """Go on in a new file, which begins with the frames that did not reach the one before."""
        files = self._files
        try:
            writer = files.folders.open_next(anywhere=True)
        except OutputError as error:
            files.errors.leave(OutputError(f"{why}, and {error}", error.errno))
            return
        zero = files.zero_s
        files.replace(writer)
        files.renamed(files.path, zero, files.folder)
        files.report(what, f"{why}: the recording goes on in {files.path}")
        for chunk in unsaved:
            files.append(chunk)

    # --- either thread ---

    def _report_covered(self, folder: HeldFolder) -> None:
        if folder not in self._reported:
            self._reported.append(folder)
            says = f"the recording goes on where it was: {covered(folder)}"
            self._files.report("folder_covered", says)

    def _report_moved(self, writer: Writer, where: Whereabouts) -> None:
        files, path, before = self._files, where.path, writer.path
        held = writer.disk.folder
        writer.disk.moved(path)
        # a finished one may have been moved as well
        if writer is files.writer or files.path == before:
            files.renamed(path, files.zero_s, writer.disk.folder)
        if writer.disk.folder is held and path.name == before.name:  # with its folder, which is said once
            if path.parent in self._moved_to:
                return
            self._moved_to.add(path.parent)
        goes_on = "the recording goes on there" if writer is files.writer else "it is complete there"
        files.report("recording_moved", f"{before} was moved to {path} while it was being written: {goes_on}")

    def _lose_changed(self, writer: Writer) -> None:
        self._files.lose(
            writer.kept,
            f"{writer.path.name} was changed by another program: what it held, {writer.kept:,} frames, may be damaged",
        )

    # --- copying: a thread for each file, which may have many GB ---

    def _restore(self, writer: Writer, where: Whereabouts) -> None:
        """Copy a finished file that no name leads to, then close it."""

        def copy() -> None:
            folders = self._files.folders.candidates()
            self._report_restored(writer, where, restore(writer.disk, where.path, folders))
            writer.disk.close()

        thread = threading.Thread(target=copy, name="canid-restore", daemon=True)
        self.restoring.append(thread)
        thread.start()

    def _report_restored(self, writer: Writer, where: Whereabouts, restored: Restored) -> None:
        files, frames, name = self._files, writer.kept, where.path.name
        if restored.path is None or restored.folder is None:
            files.lose(
                frames,
                f"{name} {where.place.value}, and its {frames:,} frames could not be copied: {restored.why}",
            )
            return
        files.folders.adopt(restored.folder, restored.path.name)
        if files.path == where.path:  # the last one: it was found out at the end
            files.renamed(restored.path, files.zero_s, restored.folder)
        files.report(
            "recording_restored", f"{name} {where.place.value}: its {frames:,} frames are in {restored.path}"
        )
