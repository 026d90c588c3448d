"""The outer layer of a .blf: from the file to whole, verified payloads, and gaps where there was damage.

A container is given on only if all of it inflates and its checksum holds; after damage the search goes on at
the next container. Memory is bounded by `LIMIT`, whatever the file claims.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from canid.frames import blf_layout as blf

# The usual container holds 128 kB; 128 times that is no container but damage or a zip bomb.
LIMIT = 16 * 1024 * 1024
# Read and search in pieces of this size: large against a seek, small against memory.
PIECE = 64 * 1024
# Objects are padded by at most 3 bytes; look a little further, as python-can and Vector's library do.
PADDING = 8


class Payload(NamedTuple):
    """Objects, whole or continued in the next payload."""

    at: int  # byte in the file where the container begins
    data: bytes


class Gap(NamedTuple):
    """Something was lost here."""

    at: int
    why: str


def containers(file: BinaryIO, start: int, size: int) -> Iterator[Payload | Gap]:
    """Payloads and gaps in the order of the file, from byte `start` to byte `size`.

    Objects that stand in the file without a container (written with compression off) come one payload each.
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
            yield Gap(
                position, "no object begins where one should" if skip < 0 else "the file ends in an object"
            )
            position = _next_object(file, position + 1, size, bare)
            continue
        position += skip
        _, header_size, _, object_size, kind = blf.OBJECT.unpack_from(head, skip)
        if kind == blf.LOG_CONTAINER:
            bare = False
        elif bare is None:
            # A container's header is shorter than any other's: one whose type is damaged shows by that.
            bare = header_size in (blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
        if bare:
            got = _bare(file, position, object_size, size)
        elif kind == blf.LOG_CONTAINER:
            got = _unpack(file, position, object_size, size)
        else:
            got = f"an object of type {kind} stands where a container should"
        if isinstance(got, str):
            yield Gap(position, got)
            position = _next_object(file, position + len(blf.SIGNATURE), size, bare)
        else:
            data, end = got
            yield Payload(position, data)
            position = end


def _bare(file: BinaryIO, position: int, object_size: int, size: int) -> tuple[bytes, int] | str:
    if not blf.OBJECT.size <= object_size <= LIMIT:
        return f"an object claims a size of {object_size} bytes"
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
        inflated = _inflate(file)
        if isinstance(inflated, str):
            return inflated
        data, used = inflated
        # The stream knows its own end and has a checksum: sizes beside it may be damaged, the data are not.
        announced = object_size - blf.CONTAINER_HEAD_SIZE
        return data, begin + (announced if used <= announced <= used + PADDING else used)
    if method == blf.STORED:
        if object_size - blf.CONTAINER_HEAD_SIZE != declared or declared > LIMIT:
            return "a container's sizes do not agree"
        if position + object_size > size:
            return "the file ends in a container"
        return file.read(declared), position + object_size
    return f"a container has the unknown compression method {method}"


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
            plausible = kind == blf.LOG_CONTAINER or bare is not False
            if plausible and blf.OBJECT.size <= object_size <= 2 * LIMIT:
                return position + found
            found = window.find(blf.SIGNATURE, found + 1)
        if not piece:
            return size
        keep = window[found:] if found >= 0 else window[-len(blf.SIGNATURE) + 1 :]
        position += len(window) - len(keep)
        window = keep
