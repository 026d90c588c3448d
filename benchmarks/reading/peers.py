"""What others need for the same file and the same signals."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import deflate
import numpy as np

from canid.io.buses import python_can
from canid.io.logs.blf import blf_layout as blf
from canid.values.types import Frame

Wanted = dict[tuple[int, int], Any]  # (bus, id) -> cantools message

READERS = {".blf": "BLFReader", ".asc": "ASCReader"}


def cantools_messages(dbcs: list[tuple[Path, int | None]], names: set[str]) -> Wanted:
    """The messages of these names, by bus and id; a DBC without a bus is that of bus 0."""
    import cantools

    out: Wanted = {}
    for path, bus in dbcs:
        database = cantools.database.load_file(path, strict=False)
        out |= {
            (bus or 0, message.frame_id): message for message in database.messages if message.name in names
        }
    return out


def python_can_and_cantools(path: Path, wanted: Wanted) -> Callable[[], tuple[int, int]]:
    """Read every message, decode the wanted: (messages, decoded)."""
    reader = getattr(python_can.load(), READERS[path.suffix])

    def run() -> tuple[int, int]:
        messages = decoded = 0
        with reader(str(path)) as source:
            for message in source:
                messages += 1
                known = wanted.get((message.channel, message.arbitration_id))
                if known is not None:
                    known.decode(message.data)
                    decoded += 1
        return messages, decoded

    return run


# what inflates a container, out of its bytes and the size that they will have
INFLATERS: dict[str, Callable[[memoryview, int], bytes | bytearray]] = {
    "zlib": lambda packed, size: zlib.decompress(packed),
    "libdeflate": deflate.zlib_decompress,
}


def inflate_alone(path: Path, by: str) -> Callable[[], int]:
    """Nothing but inflating each container, one after the other: the floor of a .blf reader that inflates so."""
    inflate = INFLATERS[by]

    def run() -> int:
        data = path.read_bytes()
        position, size = blf.FILE_HEADER_SIZE, 0
        view = memoryview(data)
        while position + blf.CONTAINER_HEAD_SIZE <= len(data):
            _, _, _, object_size, _ = blf.OBJECT.unpack_from(data, position)
            _, declared = blf.CONTAINER.unpack_from(data, position + blf.OBJECT.size)
            size += len(inflate(view[position + blf.CONTAINER_HEAD_SIZE : position + object_size], declared))
            position += object_size + object_size % 4
        return size

    return run


def asammdf(path: Path, dbc: Path) -> Callable[[], int]:
    """What asammdf needs: it reads .mf4 only and gives the signals of the DBC's messages."""
    from asammdf import MDF

    def run() -> int:
        with MDF(path) as log:
            signals = log.extract_bus_logging({"CAN": [(dbc, 0)]}, ignore_value2text_conversion=True)
            n = sum(len(signals.get(name, raw=True)) for name in signals.channels_db if name != "time")
            signals.close()
        return n

    return run


def can_decoder(frames: list[Frame], dbc: Path) -> Callable[[], int]:
    """can_decoder decodes a pandas table; making the table of a log is not counted."""
    import can_decoder as peer
    import pandas

    table = pandas.DataFrame(
        {
            "ID": np.array([frame.id for frame in frames], dtype=np.uint32),
            "IDE": np.zeros(len(frames), dtype=bool),
            "DataLength": np.array([len(frame.data) for frame in frames], dtype=np.uint8),
            "DataBytes": [list(frame.data) for frame in frames],
        },
        index=pandas.DatetimeIndex(
            pandas.to_datetime([frame.t for frame in frames], unit="s", utc=True), name="TimeStamp"
        ),
    )
    decoder = peer.DataFrameDecoder(peer.load_dbc(str(dbc)))
    return lambda: len(decoder.decode_frame(table))
