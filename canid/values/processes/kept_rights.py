"""What a confined process keeps of its rights, because its work needs it."""

from __future__ import annotations

from typing import NamedTuple


class Kept(NamedTuple):
    """Rights that are left besides computing, reading files, and using the descriptors that are open.

    Example:
        >>> Kept() == NOTHING, Kept(children=True).writes
        (True, True)
    """

    folders: tuple[str, ...] = ()  # below these, files and folders are made, written, renamed and deleted
    children: bool = False  # Python is started, with the same rights, and what was started is ended
    connections: bool = False  # sockets that listen take connections, and those answer

    @property
    def writes(self) -> bool:
        """Whether files are opened for writing: with children /dev/null is."""
        return self.children or bool(self.folders)


NOTHING = Kept()
