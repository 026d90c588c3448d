"""MDF 4 opened by asammdf for its raw values alone: nothing that a file says is evaluated, and nothing is written by name.

asammdf gives the text of a formula to numexpr, else to sympy; it makes a copy of a file that was not closed, and one of
unsorted records. Here the two evaluators cannot be imported, conversions are taken off the channels before any value is
read (`conversions` applies them), and both copies are made without a name: it runs in a process that cannot write.
"""

from __future__ import annotations

import io
import mmap
import struct
import sys
import tempfile
import types
from typing import Any, NamedTuple, NoReturn

from canid.values.processes.confinement import confine

# bytes of the identification; its flags of what is not written yet (ASAM MDF 4.1, IDBLOCK)
_IDENTIFICATION, _UNFINISHED_AT = 64, 60
_SIGNATURES, _VERSION = (b"MDF     ", b"UnFinMF "), slice(8, 16)
_MASTER_ELSEWHERE = 8  # flag of a channel group


class VersionError(ValueError):
    """A file of another version of MDF; the text says which."""


class RawMdf(NamedTuple):
    """A file, and what was taken off its channels."""

    file: Any  # asammdf's MDF; its channels have no conversions
    conversions: dict[tuple[int, int], Any]  # (group, channel)

    def samples(self, group: int, channel: int, start: int = 0, count: int | None = None) -> tuple[Any, Any]:
        """Raw values of some records, and which are invalid (None: not known). Raises whatever asammdf raises."""
        samples, invalid = self.file.get(
            group=group,
            index=channel,
            raw=True,
            samples_only=True,
            ignore_invalidation_bits=True,
            record_offset=start,
            record_count=count,
        )
        return samples, invalid

    def master(self, group: int) -> tuple[int, int] | None:
        """The group and channel that hold the times of a group; None: it has none."""
        block = self.file.groups[group].channel_group
        group = int(block.cg_master_index) if int(block.flags) & _MASTER_ELSEWHERE else group
        channel = self.file.masters_db.get(group)
        return None if channel is None else (group, channel)

    def times(self, group: int, start: int = 0, count: int | None = None) -> Any:
        """Raw times of some records, as floats; the numbers of the records where nothing else is stored."""
        return self.file.get_master(group, record_offset=start, record_count=count)


def load() -> Any:
    """Import asammdf, without what could evaluate a text, for good. Raises ImportError where it is missing."""
    sys.modules["sympy"] = None  # type: ignore[assignment]
    stand_in = types.ModuleType("numexpr")
    stand_in.__dict__.update(evaluate=_refused, __version__="0")
    sys.modules["numexpr"] = stand_in
    import asammdf
    import asammdf.blocks.mdf_v4

    return asammdf


def opened(asammdf: Any, path: str) -> RawMdf:
    """Open a file; before its first byte this process gives up its rights to write, send and start anything.

    Raises:
        VersionError: it is MDF, of another version.
        Exception: whatever asammdf raises.
    """
    if sys.platform == "linux":
        scratch: Any = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        scratch.raw.name = f"/proc/self/fd/{scratch.fileno()}"  # asammdf opens it by its name as well
        asammdf.blocks.mdf_v4.NamedTemporaryFile = lambda **_: scratch
    confine()
    file = asammdf.MDF(_source(path), process_bus_logging=False)
    conversions = {}
    for k, group in enumerate(file.groups):
        for j, channel in enumerate(group.channels):
            if channel.conversion is not None:
                conversions[k, j] = channel.conversion
                channel.conversion = None
    return RawMdf(file, conversions)


def _source(path: str) -> Any:
    """What asammdf is to open: a file that was not closed is completed in memory, in the pages that change."""
    with open(path, "rb") as file:
        head = file.read(_IDENTIFICATION)
        version = head[_VERSION].rstrip(b"\0 ").decode("latin-1") if head[:8] in _SIGNATURES else ""
        if version and not version.startswith("4"):
            raise VersionError(f"it is MDF {version}; canid reads MDF 4: convert it, with asammdf for one")
        if len(head) == _IDENTIFICATION and any(struct.unpack_from("<H", head, _UNFINISHED_AT)):
            return _WorkingCopy(file.fileno(), 0, access=mmap.ACCESS_COPY)
    return path


class _WorkingCopy(mmap.mmap):
    """A file whose changes stay in this process."""

    def __iter__(self) -> Any:
        return iter(self.readline, b"")


# asammdf takes a file for one where it is of this class
io.BufferedIOBase.register(_WorkingCopy)


def _refused(*_: Any, **__: Any) -> NoReturn:
    raise ValueError("canid evaluates no text of a file")
