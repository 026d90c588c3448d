"""Where each file of a recording is created: in the wanted folder, or in the nearest one that takes it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from canid.logs.log_writer import open_new
from canid.logs.writer import Writer
from canid.recording.file_series import Series
from canid.recording.rotation import Rotation
from canid.values.errors import OutputError


class LogFolders:
    """Opens the files of one recording, one after the other; a recording with `rotation` has a `Series` of them.

    `report(what, says)` takes events. Raises OutputError, or ConfigError for an unknown suffix.
    """

    def __init__(self, wanted: Path, rotation: Rotation | None, report: Callable[[str, str], object]):
        self._wanted = wanted
        # resolved now: later the process's own folder may be gone
        self._parents = Path(os.path.abspath(wanted)).parent.parents
        self._rotation = rotation or Rotation()
        self._report = report
        self._series = Series(wanted, rotation, report) if rotation else None

    @property
    def rotates(self) -> bool:
        """Whether the recording goes on in new files by size or time."""
        return self._series is not None

    def open_first(self) -> Writer:
        """Open the first file. Raises OutputError."""
        return _first_of(self._series) if self._series else open_new(self._wanted)

    def open_next(self, current: Path, *, anywhere: bool) -> Writer:
        """Open the file that follows `current`; where its folder is gone, in the nearest one above.

        `anywhere`: also where the folder is there and cannot be written. Raises OutputError.
        """
        first: OutputError | None = None
        for folder in self.candidates(current):
            try:
                return self.open_in(folder)
            except OutputError as error:
                first = first or error
                if not anywhere and os.path.isdir(folder):
                    break
        assert first is not None
        raise first

    def candidates(self, current: Path) -> Iterator[Path]:
        """Folders for the next file or for a copy of `current`, the best first."""
        yield self._wanted.parent
        if current.parent != self._wanted.parent:
            yield current.parent
        yield from self._parents

    def open_in(self, folder: Path) -> Writer:
        """Open the next file in a folder. Raises OutputError."""
        if self._series is None:
            here = folder == self._wanted.parent
            return open_new(folder / self._wanted.name, 2 if here else 1)
        if folder == self._wanted.parent:
            return self._series.open_next()
        series = Series(folder / self._wanted.name, self._rotation, self._report)
        writer = _first_of(series)
        before, self._series = self._series, series
        before.close()
        return writer

    def own_journal(self, path: Path, fd: int) -> None:
        """Note a new journal: it is deleted with its log."""
        if self._series is not None:
            self._series.own(path, fd)

    def adopt(self, path: Path) -> None:
        """Note a copy of one of the files: it is deleted in its turn."""
        if self._series is not None:
            self._series.adopt(path)

    def prune(self) -> None:
        """Delete what the ring does not keep."""
        for path in self._series.prune() if self._series else ():
            self._report("file_deleted", f"the ring is full: {path.name} is deleted")

    def delete_oldest(self, folder: Path) -> bool:
        """Make room for a file in a folder: delete the ring's oldest file there, where there is one; whether it was."""
        path = self._series.delete_oldest(folder) if self._series else None
        if path is not None:
            self._report("file_deleted", f"the disk is full: {path.name} is deleted, the oldest of the ring")
        return path is not None

    def close(self) -> None:
        """Release the series' list and folder."""
        if self._series is not None:
            self._series.close()


def _first_of(series: Series) -> Writer:
    """Begin the first file; a series without one holds no list."""
    try:
        return series.open_next()
    except OutputError:
        series.close()
        raise
