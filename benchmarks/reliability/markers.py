"""The events in a .blf, parsed with structures written down here a second time (Vector_BLF, GlobalMarker)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from canid.types import Event


def markers(path: Path) -> list[Event]:
    """All global markers; their time counts from the file's own zero."""
    data, payload = path.read_bytes(), b""
    at = 144
    while at + 32 <= len(data):
        signature, _, _, size, kind = struct.unpack_from("<4sHHLL", data, at)
        if (signature, kind) != (b"LOBJ", 10):
            raise ValueError(f"no container at byte {at}")
        payload += zlib.decompress(data[at + 32 : at + size])
        at += size + size % 4
    found = []
    at = 0
    while (at := payload.find(b"LOBJ", at)) >= 0:
        _, header, _, size, kind = struct.unpack_from("<4sHHLL", payload, at)
        if kind == 96:
            (ns,) = struct.unpack_from("<Q", payload, at + 24)
            group, name, says = struct.unpack_from("<LLL", payload, at + header + 16)
            texts = payload[at + header + 40 : at + size]
            if texts[:group] == b"canid":
                what = texts[group : group + name].decode()
                found.append(
                    Event(ns * 1e-9, what, texts[group + name : group + name + says].decode().rstrip())
                )
        at += size
    return found
