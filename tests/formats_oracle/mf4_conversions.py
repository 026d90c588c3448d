"""ASAM MDF 4 with a conversion on any channel: bus logging, and measurements of signals (docs/formats/mf4.md, CC blocks)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.formats_oracle import mf4_files as blocks

FORMULA = 3
# of bus logging, behind the time: the member, its bits, and its value in record k
MEMBERS: tuple[tuple[str, int, Callable[[int], int]], ...] = (
    ("ID", 32, lambda k: 0x100 + k % 7),
    ("IDE", 8, lambda k: 0),
    ("BusChannel", 8, lambda k: 1),
    ("DLC", 8, lambda k: 8),
    ("DataLength", 8, lambda k: 8),
    ("Dir", 8, lambda k: k % 2),
    ("EDL", 8, lambda k: 0),
    ("CRC", 8, lambda k: k % 256),
)
# of a measurement that identify reads
SIGNALS = ("speed", "gap", "range_rate", "accel")


class Conversion(NamedTuple):
    """A CC block."""

    kind: int
    values: Sequence[float] = ()
    references: Sequence[str | Conversion | None] = ()
    unit: str = ""


def formula(text: str) -> Conversion:
    """A conversion by a formula."""
    return Conversion(FORMULA, (), (text,))


def bus_log(conversions: Mapping[str, Conversion], n: int = 20, name: str = "CAN_DataFrame") -> bytes:
    """A log of n frames; `conversions` of members, of the time "t" and of "DataBytes"."""
    file = blocks._File(False)
    head = _head(file)
    size = 8 + sum(bits // 8 for _, bits, _ in MEMBERS) + 8
    time = _channel(file, "t", 0, 64, (blocks._MASTER, blocks._TIME, blocks._FLOAT), conversions.get("t"))
    whole = _channel(file, name, 64, 8 * size - 64, (blocks._VALUE, 0, blocks._BYTES), None)
    file.link(time, 0, whole)
    before, link, bit = whole, 1, 64
    for member, bits, _ in (*MEMBERS, ("DataBytes", 64, None)):
        kind = blocks._BYTES if member == "DataBytes" else blocks._UINT
        channel = _channel(
            file, f"{name}.{member}", bit, bits, (blocks._VALUE, 0, kind), conversions.get(member)
        )
        file.link(before, link, channel)
        before, link, bit = channel, 0, bit + bits
    rows = b"".join(
        struct.pack("<d", 0.01 * k)
        + b"".join(value(k).to_bytes(bits // 8, "little") for _, bits, value in MEMBERS)
        + k.to_bytes(8, "big")
        for k in range(n)
    )
    _data_group(file, head, time, name, n, size, rows, blocks._BUS_EVENT | blocks._PLAIN)
    return bytes(file.data)


def measurement(
    columns: Mapping[str, Sequence[float]], conversions: Mapping[str, Conversion], text: str = ""
) -> bytes:
    """A measurement of signals as doubles; those of `text` and of the time "t" too may have conversions."""
    file = blocks._File(False)
    head = _head(file)
    names = ["t", *(name for name in columns if name != "t")]
    first = before = 0
    for k, name in enumerate(names):
        kinds = (
            (blocks._MASTER, blocks._TIME, blocks._FLOAT)
            if name == "t"
            else (blocks._VALUE, 0, blocks._FLOAT)
        )
        channel = _channel(file, name, 64 * k, 64, kinds, conversions.get(name))
        if before:
            file.link(before, 0, channel)
        first, before = first or channel, channel
    n = len(columns["t"])
    rows = b"".join(struct.pack(f"<{len(names)}d", *(columns[name][k] for name in names)) for k in range(n))
    _data_group(file, head, first, "drive", n, 8 * len(names), rows, 0)
    return bytes(file.data)


def texts(cells: Sequence[bytes], conversion: Conversion | None) -> bytes:
    """A measurement of one signal "x" of texts of 8 bytes."""
    file = blocks._File(False)
    head = _head(file)
    time = _channel(file, "t", 0, 64, (blocks._MASTER, blocks._TIME, blocks._FLOAT), None)
    # cn_data_type 7: a text in UTF-8
    file.link(time, 0, _channel(file, "x", 64, 64, (blocks._VALUE, 0, 7), conversion))
    rows = b"".join(struct.pack("<d8s", 0.1 * k, cell) for k, cell in enumerate(cells))
    _data_group(file, head, time, "texts", len(cells), 16, rows, 0)
    return bytes(file.data)


def write(path: Path, content: bytes) -> Path:
    """Write a file; returns its path."""
    path.write_bytes(content)
    return path


def _head(file: blocks._File) -> int:
    plain = blocks._Dialect(False, False, False, False, False, False, True, False, 1)
    return blocks._head(file, plain)


def _channel(
    file: blocks._File,
    name: str,
    bit: int,
    bits: int,
    kinds: tuple[int, int, int],
    conversion: Conversion | None,
) -> int:
    return blocks._channel(
        file, name, (bit, bits), kinds, 0 if conversion is None else _block(file, conversion)
    )


def _block(file: blocks._File, of: Conversion) -> int:
    references = [
        0 if each is None else file.text(each) if isinstance(each, str) else _block(file, each)
        for each in of.references
    ]
    unit = file.text(of.unit) if of.unit else 0
    fixed = struct.pack("<BBHHHdd", of.kind, 0, 0, len(references), len(of.values), 0.0, 0.0)
    return file.block(
        b"CC", (0, unit, 0, 0, *references), fixed + struct.pack(f"<{len(of.values)}d", *of.values)
    )


def _data_group(
    file: blocks._File, head: int, channels: int, name: str, n: int, size: int, rows: bytes, flags: int
) -> None:
    group = blocks._group(file, channels, name, (0, n, size, flags))
    file.link(head, 0, file.block(b"DG", (0, group, file.block(b"DT", (), rows), 0), bytes(8)))
