"""Files made to stop a reader: endless things, sizes that lie, bombs, and things within things.

Each is a function that makes one, of so many bytes of file or of unpacked data.
"""

from __future__ import annotations

import gzip
import random
import struct
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

MIB = 1 << 20
# the most that a container may hold, as in blf_layout
_MAX_CONTAINER_BYTES = 16 * MIB
# beyond its size, what a family may write: the streams of one container
_OVERHEAD_BYTES = MIB
_SIGNATURE = b"LOBJ"
_FRAME = struct.pack("<4sHHLLLHHQHBBL8s", _SIGNATURE, 32, 1, 48, 1, 2, 0, 0, 7, 1, 0, 8, 9, b"12345678")


def _file_header() -> bytes:
    start = (2020, 9, 0, 13, 12, 26, 40, 0)
    fixed = struct.pack("<4sL8BQQLL8H8H", b"LOGG", 144, *(0,) * 8, 0, 0, 0, 0, *start, *start)
    return fixed.ljust(144, b"\0")


def _head(size: int, kind: int, header: int = 16) -> bytes:
    return struct.pack("<4sHHLL", _SIGNATURE, header, 1, size, kind)


def _container(packed: bytes, declared: int, method: int = 2) -> bytes:
    size = 32 + len(packed)
    return _head(size, 10) + struct.pack("<H6xL4x", method, declared) + packed + bytes(size % 4)


def _filled(what: bytes, size: int) -> bytes:
    return what * max(1, size // len(what))


def _good() -> bytes:
    """A container with two frames."""
    return _container(zlib.compress(_FRAME * 2), 2 * len(_FRAME))


def _blf(*middle: bytes) -> bytes:
    """Something between two good containers."""
    return _file_header() + _good() + b"".join(middle) + _good()


def _bare(what: bytes) -> Callable[[int], Iterable[bytes]]:
    return lambda size: [_file_header(), _FRAME * 2, _filled(what, size), _FRAME * 2]


def _outside(what: bytes) -> Callable[[int], Iterable[bytes]]:
    return lambda size: [_blf(_filled(what, size))]


def _stored(what: bytes) -> Callable[[int], Iterable[bytes]]:
    def made(size: int) -> Iterable[bytes]:
        body = _filled(what, min(size, _MAX_CONTAINER_BYTES))
        return [_blf(*[_container(body, len(body), 0)] * max(1, size // _MAX_CONTAINER_BYTES))]

    return made


def _bomb(what: bytes, first: bytes = b"") -> Callable[[int], Iterable[bytes]]:
    def made(size: int) -> Iterable[bytes]:
        body = first + _filled(what, min(size, _MAX_CONTAINER_BYTES) - len(first))
        one = _container(zlib.compress(body, 9), len(body))
        return [_blf(*[one] * max(1, size // _MAX_CONTAINER_BYTES))]

    return made


def _too_large(size: int) -> Iterable[bytes]:
    one = _container(zlib.compress(bytes(2 * _MAX_CONTAINER_BYTES), 9), 2 * _MAX_CONTAINER_BYTES)
    return [_blf(*[one] * max(1, size // (2 * _MAX_CONTAINER_BYTES)))]


def _within(size: int) -> Iterable[bytes]:
    """A container every 48 bytes, each of whose streams goes on to the same end far behind, which is broken."""
    body = bytearray()
    block = 64 * 1024 - 64
    while len(body) < size:
        # a stored block of deflate: all streams that begin in this stretch have theirs end where it ends
        begin, piece = len(body), bytearray()
        for at in range(0, block - 5 - 48, 48):
            left = block - at - 39
            head = _head(1 << 20, 10) + struct.pack("<H6xL4x", 2, 1 << 20)
            piece += head + b"\x78\x01" + struct.pack("<BHH", 0, left, left ^ 0xFFFF) + bytes(9)
        piece = piece.ljust(block, b"\0")
        body += piece + struct.pack("<BHH", 0, block, block ^ 0xFFFF)
        assert len(body) - begin == block + 5
    return [_blf(bytes(body), b"\xff" * 16)]


def _longer(size: int) -> Iterable[bytes]:
    """Stored containers every 32 bytes that claim all the rest."""
    claim = min(size, _MAX_CONTAINER_BYTES) // 2
    head = _head(32 + claim, 10) + struct.pack("<H6xL4x", 0, claim)
    return [_blf(_filled(head, size), b"\xff" * claim)]


def _one_by_one(size: int) -> Iterable[bytes]:
    """Objects without containers, behind each of them some garbage."""
    return [_file_header(), _FRAME, _filled((_head(16, 65) + b"garbage..") * 1 + _head(16, 65), size)]


def _text(first: bytes, line: bytes, last: bytes = b"") -> Callable[[int], Iterable[bytes]]:
    def made(size: int) -> Iterable[bytes]:
        yield first
        for left in range(size, 0, -MIB):
            yield _filled(line, min(MIB, left))
        yield last

    return made


def _numbered(first: bytes, line: str) -> Callable[[int], Iterable[bytes]]:
    def made(size: int) -> Iterable[bytes]:
        yield first
        each = len(line % 10_000_000)
        for k in range(0, size // each, 1000):
            yield "".join(line % (10_000_000 + n) for n in range(k, k + 1000)).encode()

    return made


def _zipped(made: Callable[[int], Iterable[bytes]]) -> Callable[[int], Iterable[bytes]]:
    def zipped(size: int) -> Iterable[bytes]:
        packer = zlib.compressobj(9, zlib.DEFLATED, 31)
        for piece in made(size):
            yield packer.compress(piece)
        yield packer.flush()

    return zipped


def _gzip_broken(size: int) -> Iterable[bytes]:
    data = gzip.compress(b"".join(_numbered(_ASC, "%d.5 1 123 Rx d 1 00\n")(size)), 1)
    return [data[: len(data) // 2], b"\xff" * 100, data[len(data) // 2 :]]


def _shapes(size: int) -> Iterable[bytes]:
    """Lines of which few are alike."""
    yield _ASC
    for k in range(size // 40):
        yield b"0." + b"1" * (1 + k % 9) + b" " * (1 + k // 9 % 29) + b"1 123 Rx d 1 0\n"


def _mf4(size: int) -> Iterable[bytes]:
    """An .mf4's identification, and blocks whose links and lengths are anything."""
    rng = random.Random(1)
    head = b"MDF     4.10    canid   ".ljust(28, b"\0") + struct.pack("<H", 410)
    words = [b"##HD", b"##DG", b"##CG", b"##CN", b"##DT", b"##DL", b"##DZ"]
    yield head.ljust(64, b"\0")
    yield struct.pack("<4s4xQQ6Q", b"##HD", 104, 6, 64, 64, 64, 64, 64, 64)
    for _ in range(size // 64):
        links = [64 * rng.randrange(size // 64) for _ in range(5)]
        yield struct.pack("<4s4xQQ5Q", rng.choice(words), rng.choice((64, 1 << 40)), 5, *links)


def _blocks(*blocks: bytes) -> Callable[[int], Iterable[bytes]]:
    """A .pcapng that begins well, and the same blocks again and again."""
    head = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    head += struct.pack("<IIHHII", 1, 20, 227, 0, 0, 20)
    head += struct.pack("<8I", 6, 48, 0, 0, 5, 16, 16, 0x100) + bytes([1, *bytes(11), 48, 0, 0, 0])
    return _text(head, b"".join(blocks))


_PCAP = struct.pack("<IHHiIII4I", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 227, 1_600_000_000, 0, 16, 16)
_PCAP += b"\0\0\1\0\1" + bytes(11)
_ASC = b"date Sun Sep 13 12:26:40.000 2020\nbase hex  timestamps absolute\n 0.1 1 123 Rx d 1 00\n"
_CANDUMP = b"(1600000000.000000) can0 123#00\n"
_CSV = b"timestamp,arbitration_id,extended,remote,error,dlc,data\n1600000000.0,0x123,0,0,0,1,AA==\n"
_TRC = b";$FILEVERSION=1.1\n;$STARTTIME=43000.5\n;\n     1)        10.0  Rx         0123  1  00\n"
_MARKER = (
    struct.pack("<4sHHLLLHHQ", _SIGNATURE, 32, 1, 88, 96, 2, 0, 0, 5)
    + struct.pack("<LLL3xBLLL12x", 0, 0, 0, 0, 5, 5, 6)
    + b"canidevent" + b"saying"
)  # fmt: skip
_WITHIN = _head(40, 65, 32) + bytes(16) + b"LOBJLOBJ"

# name, whose suffix is the format -> its pieces for so many bytes
FAMILIES: dict[str, Callable[[int], Iterable[bytes]]] = {
    "signatures.blf": _outside(_SIGNATURE),
    "signatures without containers.blf": _bare(_SIGNATURE),
    "signatures, stored.blf": _stored(_SIGNATURE),
    "signatures, bomb.blf": _bomb(_SIGNATURE, _FRAME),
    "size 0.blf": _outside(_head(0, 1)),
    "size 0, bare.blf": _bare(_head(0, 1)),
    "size 0, bomb.blf": _bomb(_head(0, 1), _FRAME),
    "size 1, bomb.blf": _bomb(_head(1, 1), _FRAME),
    "size 16.blf": _outside(_head(16, 7)),
    "size 16, bare.blf": _bare(_head(16, 7)),
    "size 16, stored.blf": _stored(_head(16, 7)),
    "size 16, bomb.blf": _bomb(_head(16, 7), _FRAME),
    "huge sizes.blf": _outside(_head(0xFFFFFFFF, 65)),
    "huge sizes, bare.blf": _bare(_head(0xFFFFFFFF, 65)),
    "largest sizes, bare.blf": _bare(_head(_MAX_CONTAINER_BYTES, 65)),
    "huge sizes, bomb.blf": _bomb(_head(_MAX_CONTAINER_BYTES, 65), _FRAME),
    "container heads.blf": _outside(_head(4096, 10)),
    "container heads, stored.blf": _longer,
    "streams within streams.blf": _within,
    "one by one, bare.blf": _one_by_one,
    "objects within objects, bomb.blf": _bomb(_WITHIN, _FRAME),
    "containers within containers.blf": _bomb(_good(), _FRAME),
    "bombs within bombs.blf": _bomb(_container(zlib.compress(bytes(MIB), 9), MIB), _FRAME),
    "zeros, bomb.blf": _bomb(bytes(4096), _FRAME),
    "too large.blf": _too_large,
    "frames, bomb.blf": _bomb(_FRAME),
    "markers, bomb.blf": _bomb(_MARKER, _FRAME),
    "zeros.blf": _outside(bytes(4096)),
    "no log.blf": lambda size: [bytes(size)],
    "base.asc": _text(_ASC, b"base hex\n"),
    "base relative.asc": _text(_ASC, b"base hex timestamps relative\n"),
    "dates.asc": _numbered(_ASC, "date Thu Aug 2 15:34:47.%d 2018\n"),
    "one line.asc": _text(_ASC, b"a"),
    "comments.asc": _text(_ASC, b"// nothing\n"),
    "empty.asc": _text(_ASC, b"\n"),
    "short.asc": _text(_ASC, b"a\n"),
    "short, apart.asc": _text(_ASC, b"a\n\n"),
    "late.asc": _text(_ASC, b"99999999999.9 1 1 Rx r\n"),
    "digits.asc": _text(_ASC, b"1" * 8000 + b".5 1 123 Rx d 1 00\n"),
    "shapes.asc": _shapes,
    "base.asc.gz": _zipped(_text(_ASC, b"base hex\n")),
    "empty.asc.gz": _zipped(_text(_ASC, b"\n")),
    "broken.asc.gz": _gzip_broken,
    "zeros.log": _text(_CANDUMP, b"\0"),
    "short.log": _text(_CANDUMP, b"a\n"),
    "empty.log.gz": _zipped(_text(_CANDUMP, b"\n")),
    "short.csv": _text(_CSV, b"a\n"),
    "commas.csv": _text(_CSV, b",,,,,,\n"),
    "short.csv.gz": _zipped(_text(_CSV, b"a\n")),
    "short.trc": _text(_TRC, b"a\n"),
    "comments.trc": _numbered(_TRC, ";%d\n"),
    "many headers, short.trc": _text(_TRC + b"".join(b";%d\n" % k for k in range(2000)), b"a b c\n"),
    "short.trc.gz": _zipped(_text(_TRC, b"a\n")),
    "empty packets.pcap": _text(_PCAP, bytes(16)),
    "packets of many sizes.pcap": _text(
        _PCAP, b"".join(struct.pack("<4I", 1, 1, k % 9, 8) + bytes(k % 9) for k in range(99))
    ),
    "sections.pcapng": _blocks(struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)),
    "interfaces.pcapng": _blocks(struct.pack("<IIHHII", 1, 20, 227, 0, 0, 20)),
    "interfaces of a section each.pcapng": _blocks(
        struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28),
        struct.pack("<IIHHII", 1, 20, 227, 0, 0, 20),
    ),
    "empty blocks.pcapng": _blocks(struct.pack("<III", 5, 12, 12), struct.pack("<IIII", 5, 16, 0, 16)),
    "a long block.pcapng": _blocks(struct.pack("<II", 5, (1 << 24) - 4) + bytes(1 << 20)),
    "links.mf4": _mf4,
    "zeros.mf4": lambda size: [b"MDF     4.10    canid   ".ljust(64, b"\0"), bytes(size)],
}


def write(name: str, folder: Path, size: int) -> Path:
    """Write the file of this family, of about so many bytes."""
    path = folder / name.replace(" ", "-").replace(",", "")
    with path.open("wb") as file:
        for piece in FAMILIES[name](size):
            # a mistake in a family must not fill the disk
            if file.tell() + len(piece) > 3 * size + _OVERHEAD_BYTES:
                raise RuntimeError(f"{name} is longer than it should be")
            file.write(piece)
    return path
