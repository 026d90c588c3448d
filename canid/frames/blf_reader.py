"""Reads a .blf as a stream of frames; where the file is damaged, at most the bad container is lost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from canid.errors import LogError
from canid.frames import blf_layout as blf
from canid.frames.blf_containers import Gap, containers
from canid.frames.blf_objects import Broken, first_object, walk
from canid.frames.read_state import ReadState
from canid.types import Damage, Frame


def read_blf(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file. Raises LogError where it is not a .blf at all."""
    with open(path, "rb") as file:
        header, start = _file_header(file, path, state.size)
        gaps: list[Gap] = []
        objects = 0
        first: int | None = None  # ns of the first frame, since the header's start
        carry = b""  # an object that continues in the next container
        aligned = True  # the next payload begins with an object, or continues `carry`
        for item in containers(file, start, state.size):
            state.done = item.at
            if isinstance(item, Gap):
                gaps.append(item)
                carry, aligned = b"", False
                continue
            data = carry + item.data if carry else item.data
            begin = 0 if aligned else first_object(data)
            carry = b""
            if begin < 0:
                continue
            try:
                walked = walk(data, begin, first)
            except Broken as broken:
                # the container is lost whole: what looked well in it may not be
                gaps.append(Gap(item.at, str(broken)))
                aligned = False
                continue
            aligned = True
            carry = data[walked.rest :]
            objects += walked.objects
            if first is None and walked.first is not None:
                first = walked.first
                if header.start_ms is not None:
                    state.start_ns = header.start_ms * 1_000_000 + first
            yield from walked.frames
        if carry.strip(b"\0"):
            gaps.append(Gap(state.size, "the file ends in an object"))
        state.done = state.size
        state.damage = _damage(header, state.size, objects, gaps)


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
