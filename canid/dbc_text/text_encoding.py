"""Character encoding of a DBC: UTF-16 and UTF-8 where the bytes show it, else Windows-1252."""

from __future__ import annotations

import codecs

# bytes that are enough to see UTF-16 without a byte order mark: every second byte of Latin text is 0
_SAMPLE_BYTES = 400


def decoded(data: bytes) -> str:
    """Decode, with line ends as single line feeds, and without a byte order mark.

    Example:
        >>> decoded("unit °C".encode("cp1252")) == decoded("unit °C".encode()) == decoded("unit °C".encode("utf-16"))
        True
    """
    text = _text(data).lstrip("\ufeff")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _text(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    sample = data[:_SAMPLE_BYTES]
    for zeros, name in ((sample[1::2], "utf-16-le"), (sample[::2], "utf-16-be")):
        if len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros):
            return data.decode(name, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")
