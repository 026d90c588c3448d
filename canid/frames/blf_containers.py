"""The outer layer of a .blf: from the file to whole, verified payloads, and gaps where there was damage.

A container is given on only if all of it inflates and its checksum holds; after damage the search goes on at
the next container. What contradicts itself in a container that can be read nevertheless (a size that is another
than that of its data, bytes before it that are no padding) comes with it, as its contradictions. Memory is bounded by
`LIMIT`, whatever the file claims, and work by the file's length: each attempt costs no more than `VAIN`, and a
stretch that takes more than `BREAKS` of them is given up.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import deflate

from canid.frames import blf_layout as blf
from canid.frames.blf_chain import Broken, chain
from canid.frames.blf_layout import LIMIT, PADDING, Data

# padding is shorter than this
_ALIGNMENT = 4
# Read and search in pieces of this size: large against a seek, small against memory.
PIECE = 64 * 1024
# A container that is no longer than this when compressed is read and inflated in one go. Usual ones hold 128 kB, and
# where an announced size is wrong no more than this was read in vain.
SMALL = 128 * 1024
# Search so far, about 20 ms, before telling how far.
SEARCH = 16 * 1024 * 1024
# Damage is a place or a few. A piece of a file that breaks more often, or in which more was unpacked for nothing
# than two of the largest containers hold, was made to keep us busy: what is left of it is passed over.
BREAKS, VAIN = 64, 2 * LIMIT

# signature, header size and version of a container
_CONTAINER_BEGINS = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT.size, 1, 0, 0)[:8]
# these, a size that a container may have, and its type
_CONTAINER = re.compile(re.escape(_CONTAINER_BEGINS) + rb".{3}[\0-\2]\n\0\0\0", re.DOTALL)
# what may be one though its header's size or version is damaged; and any object that `blf_layout.believable` may hold
_LIKE_CONTAINER = re.compile(rb"LOBJ(?=.{7}[\0-\2]\n\0\0\0)", re.DOTALL)
_LIKE_OBJECT = re.compile(rb"LOBJ(?=.{7}[\0\1].[\0-\3]\0\0)", re.DOTALL)


class Payload(NamedTuple):
    """Objects, whole or continued in the next payload."""

    at: int  # byte in the file where the container begins
    end: int  # the byte behind it
    data: Data
    bare: bool = False  # whole objects without a container: each stands for itself
    checked: bool = False  # a checksum says that the data are as they were written
    contradictions: tuple[Gap, ...] = ()  # what contradicts itself about it, though nothing is lost


class Gap(NamedTuple):
    """Something was lost here."""

    at: int
    end: int  # the byte behind it
    why: str


# data that a checksum has been held against, and the byte behind their container
_Checked = tuple[Data, int, bool]


class _Vain(NamedTuple):
    """What could not be read."""

    why: str
    spent: int = 0  # bytes that were read and unpacked before that was known


def containers(file: BinaryIO, start: int, size: int, bare: bool | None = None) -> Iterator[Payload | Gap]:
    """Payloads and gaps in the order of the file, from byte `start` to byte `size`.

    Objects that stand in the file without a container come as payloads of whole objects, see `Payload.bare`.
    `bare`: there are no containers in this file; None: not known yet.
    """
    position = start
    stretch, breaks, vain = start, 0, 0
    while position < size:
        file.seek(position)
        head = file.read(blf.OBJECT.size + PADDING)
        skip = head.find(blf.SIGNATURE, 0, PADDING + len(blf.SIGNATURE) - 1)
        if skip < 0 or len(head) - skip < blf.OBJECT.size:
            if len(head) < blf.OBJECT.size and not head.strip(b"\0"):
                if len(head) > PADDING:
                    yield Gap(position, size, "there are more zeros at the end than padding has")
                return  # padding at the end of the file
            got: tuple[Data, int] | _Checked | _Vain = _Vain(
                "no object begins where one should" if skip < 0 else "the file ends in an object"
            )
            behind = position + 1
        else:
            contradictions: list[Gap] = []
            if head[:skip].strip(b"\0"):
                contradictions.append(
                    Gap(position, position + skip, "what stands before an object is no padding")
                )
            position += skip
            behind = position + len(blf.SIGNATURE)
            _, header_size, version, object_size, kind = blf.OBJECT.unpack_from(head, skip)
            if kind == blf.LOG_CONTAINER:
                bare = False
                if (header_size, version) != (blf.OBJECT.size, 1):
                    end = position + blf.OBJECT.size
                    contradictions.append(
                        Gap(position, end, "the size or version of a container's header is damaged")
                    )
            elif bare is None:
                # A container's header is shorter than any other's: one whose type is damaged shows by that.
                bare = header_size in (blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
            if bare:
                got = _bare_row(file, position) or _bare(file, position, kind, object_size, size)
            elif kind == blf.LOG_CONTAINER:
                got = _unpack(file, position, object_size, size, contradictions)
            else:
                got = _Vain(f"an object of type {kind} stands where a container should")
        if isinstance(got, _Vain):
            if position >= stretch + PIECE:
                stretch, breaks, vain = position, 0, 0
            breaks, vain = breaks + 1, vain + got.spent
            if breaks > BREAKS or vain > VAIN:
                behind = max(behind, stretch + PIECE)
            begin, position = position, _next_object(file, behind, size, bare)
            yield Gap(begin, position, got.why)
        else:
            data, end, *checked = got
            yield Payload(position, end, data, bool(bare), bool(checked), tuple(contradictions))
            position = end


def _bare_row(file: BinaryIO, position: int) -> tuple[bytes, int] | None:
    """Some objects without a container that follow each other, and where they end; None: look at one at a time."""
    file.seek(position)
    data, behind = file.read(PIECE), file.read(blf.OBJECT.size - 1)
    stop = _container_in(data + behind)
    stop = len(data) if stop < 0 else stop
    try:
        found = chain(data, 0)
    except Broken:
        return _sound(data, position, stop)
    # a container ends the row, though an object that is cut off may claim to reach over its beginning
    n = int((found.begin + found.size).searchsorted(stop, "right"))
    if n < 2:
        return None
    end = int(found.begin[n - 1] + found.size[n - 1])
    return data[:end], position + end


def _sound(data: bytes, position: int, stop: int) -> tuple[bytes, int] | None:
    """The objects from the beginning of `data` up to where they are broken; None: look at one at a time."""
    n = end = at = 0
    while at >= 0 and at + blf.OBJECT.size <= len(data):
        *_, size, kind = blf.OBJECT.unpack_from(data, at)
        if not blf.believable(kind, size) or at + size > stop:
            break
        n, end = n + 1, at + size
        at = data.find(blf.SIGNATURE, end, end + PADDING)
    return (data[:end], position + end) if n > 1 else None


def _bare(file: BinaryIO, position: int, kind: int, object_size: int, size: int) -> tuple[bytes, int] | _Vain:
    if not blf.believable(kind, object_size):
        return _Vain(f"an object of type {kind} claims a size of {object_size} bytes")
    if position + object_size > size:
        return _Vain("the file ends in an object")
    file.seek(position)
    data = file.read(object_size + blf.OBJECT.size - 1)
    if _container_in(data) >= 0:
        return _Vain("an object reaches into a container", object_size)
    return data[:object_size], position + object_size


def _container_in(data: Data) -> int:
    """Where a container's header stands in `data`, -1 if none does whole."""
    if _CONTAINER_BEGINS not in data:
        return -1  # the usual case, and much faster
    found = _CONTAINER.search(data)
    return found.start() if found else -1


def _unpack(
    file: BinaryIO, position: int, object_size: int, size: int, contradictions: list[Gap]
) -> tuple[Data, int] | _Checked | _Vain:
    """Return the container's data and the byte where it ends, or what is wrong with it; adds to `contradictions`."""
    file.seek(position + blf.OBJECT.size)
    head = file.read(blf.CONTAINER.size)
    if len(head) < blf.CONTAINER.size:
        return _Vain("the file ends in a container")
    method, declared = blf.CONTAINER.unpack(head)
    begin = position + blf.CONTAINER_HEAD_SIZE
    if method == blf.DEFLATED:
        announced = object_size - blf.CONTAINER_HEAD_SIZE
        whole = _inflate_at_once(file, announced, declared)
        if whole is not None:
            return whole, begin + announced, True
        file.seek(begin)
        inflated = _inflate(file)
        if isinstance(inflated, _Vain):
            return inflated
        data, used = inflated
        # The stream knows its own end and has a checksum: sizes beside it may be damaged, the data are not.
        file.seek(begin + used)
        over = announced - used
        # some writers count the padding
        if over and not (0 < over < _ALIGNMENT and not file.read(over).strip(b"\0")):
            contradictions.append(
                Gap(
                    position,
                    begin,
                    f"a container claims a size of {object_size} bytes, it has {object_size - over}",
                )
            )
        if declared != len(data):
            why = f"a container claims to hold {declared} bytes, it holds {len(data)}"
            contradictions.append(Gap(position, begin, why))
        return data, begin + used, True
    if method == blf.STORED:
        if object_size - blf.CONTAINER_HEAD_SIZE != declared or declared > LIMIT:
            return _Vain("a container's sizes do not agree")
        if position + object_size > size:
            return _Vain("the file ends in a container")
        file.seek(position + object_size)
        behind = file.read(PADDING + len(_CONTAINER_BEGINS))
        # where no container follows, but one begins within it, bytes are missing: it reaches into the next one
        if _CONTAINER_BEGINS not in behind:
            stop = min(position + object_size + PADDING + blf.OBJECT.size, size)
            within = _next_container(file, begin, stop)
            if within < stop:
                return _Vain("a container is shorter than it says", within - begin)
        file.seek(begin)
        return file.read(declared), position + object_size
    return _Vain(f"a container has the unknown compression method {method}")


def _next_container(file: BinaryIO, begin: int, end: int) -> int:
    """Where the next container begins that is before byte `end`, else `end`."""
    file.seek(begin)
    window = b""
    while begin < end:
        window += file.read(min(PIECE, end - begin - len(window)))
        found = _container_in(window)
        if found >= 0:
            return begin + found
        if begin + len(window) >= end:
            break
        begin += len(window) - blf.OBJECT.size + 1
        window = window[1 - blf.OBJECT.size :]
    return end


def _inflate_at_once(file: BinaryIO, announced: int, declared: int) -> bytearray | None:
    """Inflate a container whose sizes are both right, which is usual; None: it needs a closer look.

    libdeflate knows whole streams only, and does those in less than half of zlib's time. It holds their checksums
    against the data as zlib does, and makes no more than what is declared. Whether anything is damaged, `_inflate`
    says alone.
    """
    if not (0 < announced <= SMALL and 0 < declared <= LIMIT):
        return None
    packed = file.read(announced)
    behind = file.read(PADDING)
    if len(packed) < announced or (behind.strip(b"\0") and blf.SIGNATURE not in behind):
        return None
    try:
        data = deflate.zlib_decompress(packed, declared)
    except deflate.DeflateError:
        return None
    if len(data) != declared:
        return None
    # A stream ends with its checksum. Where something else stands there, bytes follow it, and the announced size may
    # reach over other containers.
    return data if packed.endswith(deflate.adler32(data).to_bytes(4, "big")) else None


def _inflate(file: BinaryIO) -> tuple[bytes, int] | _Vain:
    """Inflate the zlib stream at the file's position: data and length of the stream, or what is wrong."""
    stream = zlib.decompressobj()
    parts: list[bytes] = []
    total = fed = 0
    while not stream.eof:
        piece = file.read(PIECE)
        if not piece:
            return _Vain("the file ends in a container", fed + total)
        fed += len(piece)
        try:
            part = stream.decompress(piece, LIMIT + 1 - total)
        except zlib.error:
            return _Vain("a container's compressed data are damaged", fed + total)
        total += len(part)
        if total > LIMIT:
            return _Vain(f"a container inflates to more than {LIMIT >> 20} MiB", fed + total)
        parts.append(part)
    return b"".join(parts), fed - len(stream.unused_data)


def _next_object(file: BinaryIO, position: int, size: int, bare: bool | None) -> int:
    """Where the next object begins (in a file with containers: the next container), or how far was searched."""
    like = _LIKE_CONTAINER if bare is False else _LIKE_OBJECT
    end = position + SEARCH
    file.seek(position)
    window = b""
    while position < end:
        piece = file.read(PIECE)
        window += piece
        for found in like.finditer(window):
            if found.start() + blf.OBJECT.size > len(window):
                break
            *_, object_size, kind = blf.OBJECT.unpack_from(window, found.start())
            container = kind == blf.LOG_CONTAINER and blf.OBJECT.size <= object_size <= 2 * LIMIT
            if container or (bare is not False and blf.believable(kind, object_size)):
                return position + found.start()
        if not piece:
            return size
        keep = window[1 - blf.OBJECT.size :]
        position += len(window) - len(keep)
        window = keep
    return min(position, size)
