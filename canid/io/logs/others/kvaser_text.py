"""Reads the plain text of Kvaser's programs: CanKing's window, and what the Memorator's converter writes.

` 0    0CFBFFDB X       8  1B  31  20  EB  B3  FF  D9  FF     100.000139 R`: channel, id, flags, length, data, time,
direction; or `  1.000300   1       123  Rx   8  01 02 ...       1`: time, channel from 1 on, id, flags, length, data,
counter. The base of both kinds of numbers is what the lines `Format of ... field` state, or what the first ids and bytes
prove; else the log is refused. Flags: X 29 bits, R remote, F or FD CAN FD, B bit-rate switch, E error state, Rx, Tx.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.content import first_lines
from canid.io.logs.frame_lines import Row, checked_id, read
from canid.io.logs.others.table_layout import proven_base
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, remote_length
from canid.values import timestamps
from canid.values.errors import ConfigError
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_FLAGS = {
    "x": Flag.EXTENDED, "r": Flag.REMOTE, "f": Flag.FD, "fd": Flag.FD, "b": Flag.BRS, "e": Flag.ESI, "tx": Flag.TX,
    "rx": Flag.NONE, "t": Flag.TX, "": Flag.NONE,
}  # fmt: skip
_BODY = r"(\d{1,3})\s+([0-9a-f]+)\s+((?:(?:[xrfbe]|fd|rx|tx)\s+)*)(\d{1,2})((?:\s+[0-9a-f]{1,3}(?![\w.]))*)"
_WINDOW = re.compile(_BODY + r"\s+(\d+\.\d+)\s+([rt])", re.IGNORECASE)
_CONVERTED = re.compile(r"(\d+\.\d+)\s+" + _BODY, re.IGNORECASE)
_OTHER = re.compile(r"[\d.]+\s+Trigger\b.*|=+|Logging stopped\.?", re.IGNORECASE)
_ERROR = re.compile(r"\d+\s+[0-9a-f]+\s+.*ErrorFrame\b.*|[\d.]+\s+\d+\s+.*Error ?Frame\b.*", re.IGNORECASE)
_BASE = re.compile(r"\s*Format of (data|id) field:\s*(HEX|DEC)\w*\s*", re.IGNORECASE)
_HEADER = re.compile(r"(chn|time\s+chan)\s+identifier\b.*", re.IGNORECASE)


def read_kvaser_text(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file. Raises ConfigError where a base is not known."""
    begin = first_lines(path)
    stated = filter(None, map(_BASE.fullmatch, begin))
    said = {line[1].lower(): 16 if line[2].upper() == "HEX" else 10 for line in stated}
    counted = any("counter" in line.lower() for line in begin if _HEADER.fullmatch(line.strip()))
    parts = [part for line in begin if (part := _parts(line.strip(), counted))]
    id_base = said.get("id") or proven_base([part[1] for part in parts], ids=True)
    data_base = said.get("data") or proven_base([word for part in parts for word in part[4]], ids=False)
    if parts and not (id_base and data_base):
        raise ConfigError(
            f"{path}: is Kvaser's plain text, and its numbers may be hexadecimal or decimal: write the lines 'Format of id "
            "field: HEX' and 'Format of data field: HEX' above its header (or DEC)"
        )
    below = False

    def take(text: str, line: Line) -> Row | str:
        nonlocal below
        if not below or _HEADER.fullmatch(text) or _OTHER.fullmatch(text):
            below = below or _HEADER.fullmatch(text) is not None
            return "header lines"
        if _ERROR.fullmatch(text):
            return "error frames"
        part = _parts(text, counted)
        if part is None or not line.whole:
            raise Bad("it is no line of Kvaser's plain text" if line.whole else "the file ends in it")
        channel, word, marks, length, words, stamp = part
        flags = sum({int(_FLAGS[mark.lower()]) for mark in marks})
        try:
            id_, wide = checked_id(int(word, id_base), extended=True if flags & Flag.EXTENDED else None)
            data = bytes(int(octet, data_base) for octet in words)
        except ValueError as error:
            raise error if isinstance(error, Bad) else Bad("its numbers are not those of its base") from None
        ns = timestamps.from_text(stamp)
        if flags & Flag.REMOTE:
            return Row(ns, channel, id_, b"", flags | wide, remote_length(length))
        if len(data) != length:
            raise Bad(f"it announces {length} data bytes and has {len(data)}")
        return Row(ns, channel, id_, data, flags | wide | (int(Flag.FD) if length > 8 else 0))

    return read(path, state, take, wanted, dated=lambda: False)


def _parts(text: str, counted: bool) -> tuple[int, str, list[str], int, list[str], str] | None:
    """Bus, id, flags, length, data and time of a line; None: it is no frame. `counted`: a counter stands behind the data."""
    if match := _WINDOW.fullmatch(text):
        channel, id_, marks, length, data, stamp, way = match.groups()
        return (
            int(channel),
            id_,
            [*marks.split(), "t" if way in "tT" else ""],
            int(length),
            data.split(),
            stamp,
        )
    if match := _CONVERTED.match(text):
        stamp, channel, id_, marks, length, data = match.groups()
        words = [*data.split(), *text[match.end() :].split()]
        if counted and words and words.pop().isdecimal():
            return max(int(channel) - 1, 0), id_, marks.split(), int(length), words, stamp
    return None
