"""The outer layer of a .blf: from the file to whole, verified payloads, and gaps where there was damage.

A container is used only if all of it inflates and its checksum holds; after damage the search goes on at the next
container. Inconsistencies of a container that can be read nevertheless (a size that is not that of its data, bytes
before it that are no padding) are returned with it, as its contradictions. Memory is bounded by
`MAX_INFLATED_BYTES`, whatever the file claims, and work by the length of the file: each attempt costs no more than
`MAX_WASTED_BYTES`, and a
stretch that takes more than `MAX_BREAKS` of them is given up.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import deflate

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_layout import MAX_INFLATED_BYTES, MAX_PADDING_BYTES, Data
from canid.io.logs.blf.blf_object_chain import Broken, chain

# padding is shorter than this
_ALIGNMENT = 4
# Read and search in pieces of this size: large against a seek, small against memory.
PIECE_BYTES = 64 * 1024
# A container that is no longer than this when compressed is read and inflated in one go. Usual ones hold 128 kB, and
# where an announced size is wrong no more than this is read for nothing.
AT_ONCE_BYTES = 128 * 1024
# Bytes searched, in about 20 ms, before progress is reported.
SEARCH_BYTES = 16 * 1024 * 1024
# Damage is in one place or a few. A piece of a file that breaks more often, or in which more was unpacked for nothing
# than two of the largest containers hold, was crafted to cost time: the rest of it is skipped.
MAX_BREAKS, MAX_WASTED_BYTES = 64, 2 * MAX_INFLATED_BYTES

# signature, header size and version of a container
_CONTAINER_BEGINS = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT.size, 1, 0, 0)[:8]
# these, a size that a container may have, and its type
_CONTAINER = re.compile(re.escape(_CONTAINER_BEGINS) + rb".{3}[\0-\2]\n\0\0\0", re.DOTALL)
# what may be one though its header's size or version is damaged; and any object that `blf_layout.is_plausible` may hold;
# both as well: the header of a further file
_LIKE_CONTAINER = re.compile(rb"LOBJ(?=.{7}[\0-\2]\n\0\0\0)|LOGG(?=\x90\0\0\0)", re.DOTALL)
_LIKE_OBJECT = re.compile(rb"LOBJ(?=.{7}[\0\1].[\0-\3]\0\0)|LOGG(?=\x90\0\0\0)", re.DOTALL)


class Payload(NamedTuple):
    """Objects, whole or continued in the next payload."""

    at: int  # byte in the file where the container begins
    end: int  # one past its last byte
    data: Data
    bare: bool = False  # whole objects without a container: independent of each other
    checked: bool = False  # a checksum confirms the data
    contradictions: tuple[Gap, ...] = ()  # inconsistencies that cost no data


class FileStart(NamedTuple):
    """A further file begins here, as in files that were joined by cat."""

    at: int
    header: blf.FileHeader


class Gap(NamedTuple):
    """Something was lost here."""

    at: int
    end: int  # one past its last byte
    why: str


# data confirmed by a checksum, and one past the last byte of their container
_Checked = tuple[Data, int, bool]


class _Failure(NamedTuple):
    """What could not be read."""

    why: str
    spent: int = 0  # bytes that were read and unpacked before that was known


def containers(
    file: BinaryIO, start: int, size: int, bare: bool | None = None
) -> Iterator[Payload | Gap | FileStart]:
    """Payloads, gaps and headers of further files in the order of the file, from byte `start` to byte `size`.

    Objects that stand in the file without a container come as payloads of whole objects, see `Payload.bare`.
    `bare`: there are no containers in this file; None: not known yet.
    """
    position = start
    stretch, breaks, wasted = start, 0, 0
    while position < size:
        file.seek(position)
        head = file.read(blf.OBJECT.size + MAX_PADDING_BYTES)
        skip = head.find(blf.SIGNATURE, 0, MAX_PADDING_BYTES + len(blf.SIGNATURE) - 1)
        if blf.FILE_SIGNATURE in head and (further := _file_start(file, position, head, skip)):
            yield further
            position, bare = further.at + further.header.size, None
            continue
        if skip < 0 or len(head) - skip < blf.OBJECT.size:
            if len(head) < blf.OBJECT.size and not head.strip(b"\0"):
                if len(head) > MAX_PADDING_BYTES:
                    yield Gap(position, size, "there are more zeros at the end than padding has")
                return  # padding at the end of the file
            got: tuple[Data, int] | _Checked | _Failure = _Failure(
                "no object begins where one should" if skip < 0 else "the file ends in an object"
            )
            following = position + 1
        else:
            contradictions: list[Gap] = []
            if head[:skip].strip(b"\0"):
                contradictions.append(
                    Gap(position, position + skip, "what stands before an object is no padding")
                )
            position += skip
            following = position + len(blf.SIGNATURE)
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
                got = _Failure(f"an object of type {kind} stands where a container should")
        if isinstance(got, _Failure):
            if position >= stretch + PIECE_BYTES:
                stretch, breaks, wasted = position, 0, 0
            breaks, wasted = breaks + 1, wasted + got.spent
            if breaks > MAX_BREAKS or wasted > MAX_WASTED_BYTES:
                following = max(following, stretch + PIECE_BYTES)
            begin, position = position, _next_object(file, following, size, bare)
            yield Gap(begin, position, got.why)
        else:
            data, end, *checked = got
            yield Payload(position, end, data, bool(bare), bool(checked), tuple(contradictions))
            position = end


def _file_start(file: BinaryIO, position: int, head: bytes, skip: int) -> FileStart | None:
    """The header of a further file at `position`, after padding at most; None where there is none."""
    begin = head.find(blf.FILE_SIGNATURE)
    if begin > (MAX_PADDING_BYTES if skip < 0 else skip) or head[:begin].strip(b"\0"):
        return None
    file.seek(position + begin)
    header = blf.joined_header(file.read(blf.FILE_HEADER_SIZE))
    return FileStart(position + begin, header) if header else None


def _bare_row(file: BinaryIO, position: int) -> tuple[bytes, int] | None:
    """Consecutive objects without a container, and where they end; None: they must be read one at a time."""
    file.seek(position)
    data, following = file.read(PIECE_BYTES), file.read(blf.OBJECT.size - 1)
    stop = _container_in(data + following)
    stop = len(data) if stop < 0 else stop
    try:
        objects = chain(data, 0)
    except Broken:
        return _intact_row(data, position, stop)
    # a container ends the row, though an object that is cut off may claim to reach over its beginning
    n = int((objects.begin + objects.size).searchsorted(stop, "right"))
    if n < 2:
        return None
    end = int(objects.begin[n - 1] + objects.size[n - 1])
    return data[:end], position + end


def _intact_row(data: bytes, position: int, stop: int) -> tuple[bytes, int] | None:
    """The intact objects at the beginning of `data`; None: they must be read one at a time."""
    n = end = at = 0
    while at >= 0 and at + blf.OBJECT.size <= len(data):
        *_, size, kind = blf.OBJECT.unpack_from(data, at)
        if not blf.is_plausible(kind, size) or at + size > stop:
            break
        n, end = n + 1, at + size
        at = data.find(blf.SIGNATURE, end, end + MAX_PADDING_BYTES)
    return (data[:end], position + end) if n > 1 else None


def _bare(
    file: BinaryIO, position: int, kind: int, object_size: int, size: int
) -> tuple[bytes, int] | _Failure:
    if not blf.is_plausible(kind, object_size):
        return _Failure(f"an object of type {kind} claims a size of {object_size} bytes")
    if position + object_size > size:
        return _Failure("the file ends in an object")
    file.seek(position)
    data = file.read(object_size + blf.OBJECT.size - 1)
    if _container_in(data) >= 0:
        return _Failure("an object reaches into a container", object_size)
    return data[:object_size], position + object_size


def _container_in(data: Data) -> int:
    """Where a container's header stands in `data`, -1 if none does whole."""
    if _CONTAINER_BEGINS not in data:
        return -1  # the usual case, and much faster
    match = _CONTAINER.search(data)
    return match.start() if match else -1


def _unpack(
    file: BinaryIO, position: int, object_size: int, size: int, contradictions: list[Gap]
) -> tuple[Data, int] | _Checked | _Failure:
    """Return the container's data and the byte where it ends, or what is wrong with it; adds to `contradictions`."""
    file.seek(position + blf.OBJECT.size)
    head = file.read(blf.CONTAINER.size)
    if len(head) < blf.CONTAINER.size:
        return _Failure("the file ends in a container")
    method, declared = blf.CONTAINER.unpack(head)
    begin = position + blf.CONTAINER_HEAD_SIZE
    if method == blf.DEFLATED:
        announced = object_size - blf.CONTAINER_HEAD_SIZE
        whole = _inflate_at_once(file, announced, declared)
        if whole is not None:
            return whole, begin + announced, True
        file.seek(begin)
        inflated = _inflate(file)
        if isinstance(inflated, _Failure):
            return inflated
        data, used = inflated
        # The stream has its own end and checksum: the sizes in the header may be damaged, the data are not.
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
        if object_size - blf.CONTAINER_HEAD_SIZE != declared or declared > MAX_INFLATED_BYTES:
            return _Failure("a container's sizes do not agree")
        if position + object_size > size:
            return _Failure("the file ends in a container")
        file.seek(position + object_size)
        following = file.read(MAX_PADDING_BYTES + len(_CONTAINER_BEGINS))
        # where no container follows, but one begins within it, bytes are missing: it reaches into the next one
        if _CONTAINER_BEGINS not in following:
            stop = min(position + object_size + MAX_PADDING_BYTES + blf.OBJECT.size, size)
            within = _next_container(file, begin, stop)
            if within < stop:
                return _Failure("a container is shorter than it says", within - begin)
        file.seek(begin)
        return file.read(declared), position + object_size
    return _Failure(f"a container has the unknown compression method {method}")


def _next_container(file: BinaryIO, begin: int, end: int) -> int:
    """Where the next container begins that is before byte `end`, else `end`."""
    file.seek(begin)
    window = b""
    while begin < end:
        window += file.read(min(PIECE_BYTES, end - begin - len(window)))
        container = _container_in(window)
        if container >= 0:
            return begin + container
        if begin + len(window) >= end:
            break
        begin += len(window) - blf.OBJECT.size + 1
        window = window[1 - blf.OBJECT.size :]
    return end


def _inflate_at_once(file: BinaryIO, announced: int, declared: int) -> bytearray | None:
    """Inflate a container whose sizes are both right, which is usual; None: use `_inflate`.

    libdeflate inflates whole streams only, in less than half of zlib's time. It verifies their checksums as zlib does,
    and produces no more than what is declared. Damage is described by `_inflate` alone.
    """
    if not (0 < announced <= AT_ONCE_BYTES and 0 < declared <= MAX_INFLATED_BYTES):
        return None
    packed = file.read(announced)
    following = file.read(MAX_PADDING_BYTES)
    if len(packed) < announced or (following.strip(b"\0") and blf.SIGNATURE not in following):
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


def _inflate(file: BinaryIO) -> tuple[bytes, int] | _Failure:
    """Inflate the zlib stream at the file's position: data and length of the stream, or what is wrong."""
    stream = zlib.decompressobj()
    parts: list[bytes] = []
    total = fed = 0
    while not stream.eof:
        piece = file.read(PIECE_BYTES)
        if not piece:
            return _Failure("the file ends in a container", fed + total)
        fed += len(piece)
        try:
            part = stream.decompress(piece, MAX_INFLATED_BYTES + 1 - total)
        except zlib.error:
            return _Failure("a container's compressed data are damaged", fed + total)
        total += len(part)
        if total > MAX_INFLATED_BYTES:
            return _Failure(f"a container inflates to more than {MAX_INFLATED_BYTES >> 20} MiB", fed + total)
        parts.append(part)
    return b"".join(parts), fed - len(stream.unused_data)


def _next_object(file: BinaryIO, position: int, size: int, bare: bool | None) -> int:
    """Where the next object begins (in a file with containers: the next container), or how far was searched."""
    like = _LIKE_CONTAINER if bare is False else _LIKE_OBJECT
    end = position + SEARCH_BYTES
    file.seek(position)
    window = b""
    while position < end:
        piece = file.read(PIECE_BYTES)
        window += piece
        for match in like.finditer(window):
            if match.start() + blf.OBJECT.size > len(window):
                break
            if window.startswith(blf.FILE_SIGNATURE, match.start()):
                return position + match.start()
            *_, object_size, kind = blf.OBJECT.unpack_from(window, match.start())
            container = kind == blf.LOG_CONTAINER and blf.OBJECT.size <= object_size <= 2 * MAX_INFLATED_BYTES
            if container or (bare is not False and blf.is_plausible(kind, object_size)):
                return position + match.start()
        if not piece:
            return size
        keep = window[1 - blf.OBJECT.size :]
        position += len(window) - len(keep)
        window = keep
    return min(position, size)
