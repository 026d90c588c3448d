"""Where each file of a recording is created: in the wanted folder, or in the nearest one that takes it."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from pathlib import Path

from canid.io.files.held_folder import HeldFolder, Standing
from canid.io.logs.log_writer import check_suffix, open_new
from canid.io.logs.writer import Writer
from canid.io.recording.file_series import Series, folder_of
from canid.io.recording.rotation import Rotation
from canid.values.errors import OutputError


class LogFolders:
    """Opens the files of one recording, one after the other; a recording with `rotation` has a `Series` of them.

    Folders are held: what is mounted over one, or takes its name, changes nothing. One that is gone is left for the next.
    `report(what, says)` takes events. Raises OutputError, or ConfigError for an unknown suffix.
    """

    def __init__(self, wanted: Path, rotation: Rotation | None, report: Callable[[str, str], object]):
        self._wanted = wanted
        # resolved now: later the process's own folder may be gone
        self._parents = Path(os.path.abspath(wanted)).parent.parents
        self._rotation = rotation or Rotation()
        self._report = report
        check_suffix(wanted)
        # in which the wanted name is; and of the latest file, which may be another one
        self._home = self._current = folder_of(wanted)
        self._series = Series(wanted, rotation, report, self._home) if rotation else None
        self._journals_in_use: Callable[[], Collection[str]] = lambda: ()

    @property
    def rotates(self) -> bool:
        """Whether the recording goes on in new files by size or time."""
        return self._series is not None

    def open_first(self) -> Writer:
        """Open the first file. Raises OutputError."""
        return _first_of(self._series) if self._series else open_new(self._wanted, folder=self._home)

    def open_next(self, *, anywhere: bool) -> Writer:
        """Open the file that follows; where its folder is gone, in the next one that is there.

        `anywhere`: also where the folder is there and cannot be written. Raises OutputError.
        """
        first: OutputError | None = None
        for folder in self.candidates():
            try:
                return self.open_in(folder)
            except OutputError as error:
                first = first or error
                if not anywhere and folder.usable:
                    break
        raise first or OutputError(f"cannot create a file in {self._home.path}: the folder is gone")

    def candidates(self) -> Iterator[HeldFolder]:
        """Folders for the next file or for a copy, the best first: that of the latest file, the wanted one, those above."""
        offered: list[HeldFolder] = []
        for folder in self._folders():
            if folder.usable and not any(folder.is_same(other) for other in offered):
                offered.append(folder)
                yield folder

    def _folders(self) -> Iterator[HeldFolder]:
        yield self._current
        yield self._home
        yield from _opened(self._wanted.parent)
        for path in self._parents:
            yield from _opened(path)

    def open_in(self, folder: HeldFolder) -> Writer:
        """Open the next file in a folder. Raises OutputError."""
        here = folder is self._home or folder.path == self._wanted.parent
        if self._series is None:
            writer = open_new(folder.path / self._wanted.name, 2 if here else 1, folder)
        elif folder is self._series.folder:
            writer = self._series.open_next()
        else:
            series = Series(folder.path / self._wanted.name, self._rotation, self._report, folder)
            series.in_use = self._journals_in_use
            writer = _first_of(series)
            self._series.close()
            self._series = series
        before, self._current = self._current, folder
        if before is not folder and not before.usable:
            says = f"{before.path} {Standing.GONE.value}: the recording goes on in {folder.path}"
            self._report("folder_gone", says)
        if here:
            self._home = folder
        return writer

    def keep_journals(self, in_use: Callable[[], Collection[str]]) -> None:
        """Names of journals that are written now, which no ring deletes."""
        self._journals_in_use = in_use
        if self._series is not None:
            self._series.in_use = in_use

    def own_journal(self, folder: HeldFolder, name: str, fd: int) -> None:
        """Note a new journal: it is deleted with its log."""
        if self._series is not None and folder.is_same(self._series.folder):
            self._series.own(name, fd)

    def adopt(self, folder: HeldFolder, name: str) -> None:
        """Note a copy of one of the files: it is deleted in its turn."""
        if self._series is not None and folder.is_same(self._series.folder):
            self._series.adopt(name)

    def prune(self) -> None:
        """Delete what the ring does not keep."""
        for path in self._series.prune() if self._series else ():
            self._report("file_deleted", f"the ring is full: {path.name} is deleted")

    def delete_oldest(self, folder: HeldFolder) -> bool:
        """Make room for a file in a folder: delete the ring's oldest file there, where there is one; whether it was."""
        series = self._series
        path = series.delete_oldest() if series is not None and folder is series.folder else None
        if path is not None:
            self._report("file_deleted", f"the disk is full: {path.name} is deleted, the oldest of the ring")
        return path is not None

    def close(self) -> None:
        """Release the series' list."""
        if self._series is not None:
            self._series.close()


def _opened(path: Path) -> Iterator[HeldFolder]:
    """The folder at a path, where there is one."""
    with suppress(OSError):
        yield HeldFolder(path)


def _first_of(series: Series) -> Writer:
    """Begin the first file; a series without one holds no list."""
    try:
        return series.open_next()
    except OutputError:
        series.close()
        raise
