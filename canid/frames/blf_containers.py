"""The outer layer of a .blf: from the file to whole, verified payloads, and gaps where there was damage.

A container is given on only if all of it inflates and its checksum holds; after damage the search goes on at
the next container. Memory is bounded by `LIMIT`, whatever the file claims.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from canid.frames import blf_layout as blf
from canid.frames.blf_chain import Broken, chain
from canid.frames.blf_layout import LIMIT, PADDING

# Read and search in pieces of this size: large against a seek, small against memory.
PIECE = 64 * 1024
# A container that is no longer than this when compressed is inflated in one go: deflate makes at most 1,032 times as
# much of it (zlib's technical details), 132 MB, before it is seen for a bomb.
SMALL = 128 * 1024

# signature, header size and version of a container
_CONTAINER_BEGINS = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT.size, 1, 0, 0)[:8]


class Payload(NamedTuple):
    """Objects, whole or continued in the next payload."""

    at: int  # byte in the file where the container begins
    end: int  # the byte behind it
    data: bytes
    bare: bool = False  # whole objects without a container: each stands for itself


class Gap(NamedTuple):
    """Something was lost here."""

    at: int
    end: int  # the byte behind it
    why: str


def containers(file: BinaryIO, start: int, size: int) -> Iterator[Payload | Gap]:
    """Payloads and gaps in the order of the file, from byte `start` to byte `size`.

    Objects that stand in the file without a container come as payloads of whole objects, see `Payload.bare`.
    """
    position = start
    bare: bool | None = None  # no containers in this file; None: not known yet
    while position < size:
        file.seek(position)
        head = file.read(blf.OBJECT.size + PADDING)
        skip = head.find(blf.SIGNATURE, 0, PADDING + len(blf.SIGNATURE) - 1)
        if skip < 0 or len(head) - skip < blf.OBJECT.size:
            if len(head) < blf.OBJECT.size and not head.strip(b"\0"):
                return  # padding at the end of the file
            why = "no object begins where one should" if skip < 0 else "the file ends in an object"
            begin, position = position, _next_object(file, position + 1, size, bare)
            yield Gap(begin, position, why)
            continue
        position += skip
        _, header_size, _, object_size, kind = blf.OBJECT.unpack_from(head, skip)
        if kind == blf.LOG_CONTAINER:
            bare = False
        elif bare is None:
            # A container's header is shorter than any other's: one whose type is damaged shows by that.
            bare = header_size in (blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
        if bare:
            got = _bare_row(file, position) or _bare(file, position, kind, object_size, size)
        elif kind == blf.LOG_CONTAINER:
            got = _unpack(file, position, object_size, size)
        else:
            got = f"an object of type {kind} stands where a container should"
        if isinstance(got, str):
            begin, position = position, _next_object(file, position + len(blf.SIGNATURE), size, bare)
            yield Gap(begin, position, got)
        else:
            data, end = got
            yield Payload(position, end, data, bare)
            position = end


def first_container(file: BinaryIO, size: int) -> int:
    """Where the first container of a file begins whose own beginning is damaged; `size` where none does."""
    return _next_object(file, 0, size, bare=False)


def _bare_row(file: BinaryIO, position: int) -> tuple[bytes, int] | None:
    """Some objects without a container that follow each other, and where they end; None: look at one at a time."""
    file.seek(position)
    data = file.read(PIECE)
    try:
        found = chain(data, 0)
    except Broken:
        return _sound(data, position)
    others = (found.kind == blf.LOG_CONTAINER).nonzero()[0]
    n = int(others[0]) if others.size else len(found.kind)
    if n < 2:
        return None
    end = int(found.begin[n - 1] + found.size[n - 1])
    return data[:end], position + end


def _sound(data: bytes, position: int) -> tuple[bytes, int] | None:
    """The objects from the beginning of `data` up to where they are broken; None: look at one at a time."""
    n = end = at = 0
    while at >= 0 and at + blf.OBJECT.size <= len(data):
        *_, size, kind = blf.OBJECT.unpack_from(data, at)
        if kind == blf.LOG_CONTAINER or not blf.believable(kind, size) or at + size > len(data):
            break
        n, end = n + 1, at + size
        at = data.find(blf.SIGNATURE, end, end + PADDING)
    return (data[:end], position + end) if n > 1 else None


def _bare(file: BinaryIO, position: int, kind: int, object_size: int, size: int) -> tuple[bytes, int] | str:
    if not blf.believable(kind, object_size):
        return f"an object of type {kind} claims a size of {object_size} bytes"
    if position + object_size > size:
        return "the file ends in an object"
    file.seek(position)
    return file.read(object_size), position + object_size


def _unpack(file: BinaryIO, position: int, object_size: int, size: int) -> tuple[bytes, int] | str:
    """Return the container's data and the byte where it ends, or what is wrong with it."""
    file.seek(position + blf.OBJECT.size)
    head = file.read(blf.CONTAINER.size)
    if len(head) < blf.CONTAINER.size:
        return "the file ends in a container"
    method, declared = blf.CONTAINER.unpack(head)
    begin = position + blf.CONTAINER_HEAD_SIZE
    if method == blf.DEFLATED:
        announced = object_size - blf.CONTAINER_HEAD_SIZE
        whole = _inflate_at_once(file, announced, declared)
        if whole is not None:
            return whole, begin + announced
        file.seek(begin)
        inflated = _inflate(file)
        if isinstance(inflated, str):
            return inflated
        data, used = inflated
        # The stream knows its own end and has a checksum: sizes beside it may be damaged, the data are not.
        return data, begin + used
    if method == blf.STORED:
        if object_size - blf.CONTAINER_HEAD_SIZE != declared or declared > LIMIT:
            return "a container's sizes do not agree"
        if position + object_size > size:
            return "the file ends in a container"
        data, behind = file.read(declared), file.read(PADDING + len(_CONTAINER_BEGINS))
        # where no container follows, but one begins within it, bytes are missing: it reaches into the next one
        if behind.strip(b"\0") and _CONTAINER_BEGINS not in behind and _CONTAINER_BEGINS in data + behind:
            return "a container is shorter than it says"
        return data, position + object_size
    return f"a container has the unknown compression method {method}"


def _inflate_at_once(file: BinaryIO, announced: int, declared: int) -> bytes | None:
    """Inflate a container whose sizes are both right, which is usual; None: it needs a closer look."""
    if not (0 < announced <= SMALL and 0 < declared <= LIMIT):
        return None
    packed = file.read(announced)
    behind = file.read(PADDING)
    if len(packed) < announced or (behind.strip(b"\0") and blf.SIGNATURE not in behind):
        return None
    if blf.SIGNATURE in packed:
        return None  # the announced size may reach over other containers, and inflating stops where it should
    try:
        # room for one byte more, so that the stream's end is reached in one go
        data = zlib.decompress(packed, bufsize=declared + 1)
    except zlib.error:
        return None
    return data if len(data) == declared else None


def _inflate(file: BinaryIO) -> tuple[bytes, int] | str:
    """Inflate the zlib stream at the file's position: data and length of the stream, or what is wrong."""
    stream = zlib.decompressobj()
    parts: list[bytes] = []
    total = fed = 0
    while not stream.eof:
        piece = file.read(PIECE)
        if not piece:
            return "the file ends in a container"
        fed += len(piece)
        try:
            part = stream.decompress(piece, LIMIT + 1 - total)
        except zlib.error:
            return "a container's compressed data are damaged"
        total += len(part)
        if total > LIMIT:
            return f"a container inflates to more than {LIMIT >> 20} MiB"
        parts.append(part)
    return b"".join(parts), fed - len(stream.unused_data)


def _next_object(file: BinaryIO, position: int, size: int, bare: bool | None) -> int:
    """Where the next object begins (in a file with containers: the next container), or `size`."""
    file.seek(position)
    window = b""
    while True:
        piece = file.read(PIECE)
        window += piece
        found = window.find(blf.SIGNATURE)
        while found >= 0 and found + blf.OBJECT.size <= len(window):
            _, _, _, object_size, kind = blf.OBJECT.unpack_from(window, found)
            container = kind == blf.LOG_CONTAINER and blf.OBJECT.size <= object_size <= 2 * LIMIT
            if container or (bare is not False and blf.believable(kind, object_size)):
                return position + found
            found = window.find(blf.SIGNATURE, found + 1)
        if not piece:
            return size
        keep = window[found:] if found >= 0 else window[-len(blf.SIGNATURE) + 1 :]
        position += len(window) - len(keep)
        window = keep
