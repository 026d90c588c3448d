"""The objects of a .blf that hold frames as structures of numpy, for the reader and the writer."""

from __future__ import annotations

from typing import Any

import numpy as np

from canid.io.logs.blf import blf_layout as blf

HEADER_SIZE = {1: blf.OBJECT_V1_SIZE, 2: blf.OBJECT_V2_SIZE}
VERSIONS = tuple(HEADER_SIZE)
HEADER_FIELDS = [
    ("signature", "<u4"), ("header_size", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4"),
    ("unit", "<u4"), ("client", "<u2"), ("object_version", "<u2"), ("ns", "<i8"),
]  # fmt: skip
# as blf_layout.CLASSIC, ERROR_EXT, FD and FD64; of the other error frames what is read (Vector_BLF)
_CLASSIC_BODY = [("channel", "<u2"), ("how", "u1"), ("dlc", "u1"), ("word", "<u4"), ("data", "<u8")]
_ERROR_BODY = [
    ("channel", "<u2"), ("length", "<u2"), ("flags", "<u4"), ("ecc", "u1"), ("position", "u1"), ("dlc", "u1"),
    ("pad", "u1"), ("frame_length", "<u4"), ("word", "<u4"), ("more", "<u2"), ("pad2", "<u2"), ("data", "<u8"),
]  # fmt: skip
_ERROR_WITHOUT_ID_BODY = [("channel", "<u2"), ("length", "<u2")]
_FD_ERROR_BODY = [
    ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("ecc", "u1"), ("flags", "<u2"), ("code", "<u2"),
    ("more", "<u2"), ("extended_at", "u1"), ("pad", "u1"), ("word", "<u4"), ("pad2", "V28"),
]  # fmt: skip
_FD_BODY = [
    ("channel", "<u2"), ("how", "u1"), ("dlc", "u1"), ("word", "<u4"), ("frame_length", "<u4"), ("bits", "u1"),
    ("fd", "u1"), ("valid", "u1"), ("pad", "V5"), ("data", "u1", (64,)),
]  # fmt: skip
_FD64_BODY = [
    ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("tx_count", "u1"), ("word", "<u4"), ("frame_length", "<u4"),
    ("fd", "<u4"), ("rates", "<u4", (2,)), ("offsets", "<u4", (2,)), ("bits", "<u2"), ("sent", "u1"),
    ("extended_at", "u1"), ("crc", "<u4"),
]  # fmt: skip
BODY: dict[int, list[Any]] = {
    blf.CAN_MESSAGE: _CLASSIC_BODY,
    blf.CAN_MESSAGE2: _CLASSIC_BODY,
    blf.CAN_ERROR: _ERROR_WITHOUT_ID_BODY,
    blf.CAN_ERROR_EXT: _ERROR_BODY,
    blf.CAN_FD_ERROR_64: _FD_ERROR_BODY,
    blf.CAN_FD_MESSAGE: _FD_BODY,
    blf.CAN_FD_MESSAGE_64: _FD64_BODY,
}


def _layout(body: list[Any], version: int) -> np.dtype[Any]:
    """The structure of an object's header and body; `top` is the highest byte of the id's word."""
    longer = HEADER_SIZE[version] - blf.OBJECT_V1_SIZE
    plain = np.dtype(HEADER_FIELDS + [("longer", f"V{longer}")] * bool(longer) + body)
    fields = {name: field[:2] for name, field in (plain.fields or {}).items()}
    if "word" in fields:
        fields["top"] = (np.dtype("u1"), fields["word"][1] + 3)
    return np.dtype(
        {
            "names": [*fields],
            "formats": [f[0] for f in fields.values()],
            "offsets": [f[1] for f in fields.values()],
            "itemsize": plain.itemsize,
        }
    )


LAYOUTS = {(kind, version): _layout(body, version) for kind, body in BODY.items() for version in HEADER_SIZE}
