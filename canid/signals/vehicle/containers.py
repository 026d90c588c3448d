"""AUTOSAR container frames: the payload of one of their PDUs (AUTOSAR SWS I-PDU Multiplexer, short and long header)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.signals.dbc_text.parsing import Container

# bytes of id and of length
_SHORT, _LONG = (3, 1), (4, 4)
_MAX_FRAME_BYTES = 64


def contained(
    container: Container, data: npt.NDArray[np.uint8], length: npt.NDArray[np.uint8]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Take one PDU out of container frames; a frame that ends within a PDU has what came before it.

    Args:
        container: by which header the PDU is found.
        data: (n, 8) or (n, 64).
        length: (n,) bytes that each frame has.

    Returns:
        Which frames hold the PDU, its payload (m, 64) and the payload's length (m,).

    Example:
        >>> frame = np.frombuffer(bytes([0, 0, 9, 2, 5, 6, 0, 0, 7, 1, 8, 0, 0, 0, 0, 0]), np.uint8)[None, :]
        >>> rows, payload, length = contained(Container("C", 7, False, False), frame, np.array([16], np.uint8))
        >>> rows.tolist(), payload[0, :1].tolist(), length.tolist()
        ([0], [8], [1])
    """
    id_bytes, length_bytes = _LONG if container.long_header else _SHORT
    order = "little" if container.little_endian else "big"
    rows: list[int] = []
    lengths: list[int] = []
    parts: list[bytes] = []
    for row, n in enumerate(length.tolist()):
        frame = data[row, :n].tobytes()
        at = 0
        while at + id_bytes + length_bytes <= n:
            begin = at + id_bytes + length_bytes
            size = int.from_bytes(frame[at + id_bytes : begin], order)  # type: ignore[arg-type]
            if begin + size > n:
                break
            if int.from_bytes(frame[at : at + id_bytes], order) == container.header_id:  # type: ignore[arg-type]
                rows.append(row)
                lengths.append(size)
                parts.append(frame[begin : begin + size].ljust(_MAX_FRAME_BYTES, b"\0"))
                break
            at = begin + size
    payload = np.frombuffer(b"".join(parts), np.uint8).reshape(-1, _MAX_FRAME_BYTES)
    return np.array(rows, np.int64), payload, np.array(lengths, np.uint8)


def wrapped(container: Container, payload: bytes) -> bytes:
    """A container frame that holds one PDU.

    Example:
        >>> wrapped(Container("C", 7, False, False), b"ab").hex(" ")
        '00 00 07 02 61 62'
    """
    id_bytes, length_bytes = _LONG if container.long_header else _SHORT
    if container.little_endian:
        header = container.header_id.to_bytes(id_bytes, "little") + len(payload).to_bytes(
            length_bytes, "little"
        )
    else:
        header = container.header_id.to_bytes(id_bytes, "big") + len(payload).to_bytes(length_bytes, "big")
    return header + payload
