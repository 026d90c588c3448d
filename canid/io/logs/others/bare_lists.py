"""Lists of CAN frames without a header: which column is which, where the rows prove it.

`1478198376.389427,0316,8,05,21,68,09,21,21,00,6f,R`: a number that says how many bytes follow is the length, what stands
between it and the time is the id and perhaps Rx or Tx. A row in which something else stands there has no known form: a
channel may be a length.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

_TIME = re.compile(r"-?\d{1,20}([.,]\d{1,20})?|\d\d?:\d\d:\d\d([.,:]\d{1,9})?")
_ID = re.compile(r"0x[0-9a-f]{1,8}x?|[0-9a-f]{3,8}[hx]?", re.IGNORECASE)
_OCTET = re.compile(r"(0x)?[0-9a-f]{2}|0x[0-9a-f]", re.IGNORECASE)
_HEX = re.compile(r"0.|.*[a-f]", re.IGNORECASE)
_WAY = re.compile(r"rx|tx", re.IGNORECASE)
# rows of one form that show it, and their share of those that begin with a time
_MIN_ROWS, _SHARE = 3, 0.9
# cells behind the bytes: a mark or a label
_MAX_BEHIND = 2
DELIMITERS = ",;\t"


class Form(NamedTuple):
    """The columns of a list without a header; the bytes are as many as the length says."""

    delimiter: str
    id: int
    way: int  # -1: none
    length: int
    behind: str  # the first thing that stands behind the bytes; "": nothing does

    @property
    def names(self) -> list[str]:
        """The header that the list might have."""
        names = {0: "Time", self.id: "ID", self.way: "Dir", self.length: "DLC", self.length + 1: "Data"}
        return [names[k] for k in range(self.length + 2)]


def form_of(lines: Sequence[str]) -> Form | None:
    """The form of the rows; None: they have none that is known, or not one alone.

    >>> form_of(["0.10,0316,2,05,21,R", "0.11,02B0,1,FF,R", "0.12,0316,0,R"])
    Form(delimiter=',', id=1, way=-1, length=2, behind='R')
    >>> form_of(["0.10,0316,1,2,05,21"] * 3), form_of(["0.1,850,0,20.5", "0.2,851,1,20"] * 3)
    (None, None)
    """
    for delimiter in DELIMITERS:
        rows = [[cell.strip(" \"'") for cell in line.split(delimiter)] for line in lines if delimiter in line]
        timed = [cells for cells in rows if _TIME.fullmatch(cells[0])]
        forms = [shape for cells in timed if (shape := _form(cells, delimiter)) is not None]
        kinds = Counter(form._replace(behind="") for form, _ in forms)
        kind, most = kinds.most_common(1)[0] if kinds else (None, 0)
        # of numbers alone it may be a table of signals
        if (
            kind is not None
            and most >= max(_MIN_ROWS, _SHARE * len(timed))
            and 2 * sum(x for _, x in forms) >= most
        ):
            return kind._replace(behind=next((form.behind for form, _ in forms if form.behind), ""))
    return None


def is_row(line: str, delimiter: str) -> bool:
    """Whether a line may be a frame of a list without a header.

    >>> is_row("0.10,0316,2,05,21,R", ","), is_row("Bit rate: 500", ",")
    (True, False)
    """
    return _form([cell.strip(" \"'") for cell in line.split(delimiter)], delimiter) is not None


def octets(cells: Sequence[str], n: int) -> list[str]:
    """The first `n` words of cells, bytes as they are written.

    >>> octets(["05", "0x21", "R"], 2), octets(["05 21"], 1)
    (['05', '21'], ['05'])
    """
    words = [word for cell in cells for word in cell.split()][:n]
    return [word[2:] if word[:2] in ("0x", "0X") else word for word in words]


def _form(cells: Sequence[str], delimiter: str) -> tuple[Form, bool] | None:
    """The form of a row, and whether it has bytes and hexadecimal numbers."""
    for length in (2, 3):
        if length >= len(cells) or not re.fullmatch(r"\d{1,2}", cells[length]):
            continue
        n = int(cells[length])
        words = [word for cell in cells[length + 1 :] for word in (cell.split() or [""])]
        data, behind = words[:n], [word for word in words[n:] if word]
        between = range(1, length)
        ids = [k for k in between if _ID.fullmatch(cells[k])]
        ways = [k for k in between if _WAY.fullmatch(cells[k])]
        whole = len(data) == n <= 64 and all(map(_OCTET.fullmatch, data))
        alone = len(behind) <= _MAX_BEHIND and not any(map(_OCTET.fullmatch, behind))
        if whole and alone and len(ids) == 1 and len(ids) + len(ways) == len(between):
            is_hex = n > 0 and any(map(_HEX.match, (cells[ids[0]], *data)))
            return Form(delimiter, ids[0], (*ways, -1)[0], length, "".join(behind[:1])), is_hex
    return None
