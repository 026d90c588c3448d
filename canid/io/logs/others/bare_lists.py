"""Lists of CAN frames without a header: which column is which, where the rows prove it.

`1478198376.389427,0316,8,05,21,68,09,21,21,00,6f,R`: a number that says how many bytes follow, with blanks between them or
without, is the length. Between it and the time, which the number of the row may precede, stand the id, before it perhaps a
channel, behind it a digit that is 1 where the id has 29 bits, and Rx or Tx. A row in which something else stands there has
no known form, nor have decimal numbers: ids of digits alone may be hexadecimal all the same.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from canid.values.frame_columns import MAX_STANDARD_ID

_TIME = re.compile(r"-?\d{1,20}([.,]\d{1,20})?|\d\d?:\d\d:\d\d([.,:]\d{1,9})?")
_ID = re.compile(r"0x[0-9a-f]{1,8}x?|[0-9a-f]{3,8}[hx]?", re.IGNORECASE)
_OCTET = re.compile(r"(0x)?[0-9a-f]{2}|0x[0-9a-f]", re.IGNORECASE)
_JOINED = re.compile(r"(?:0x)?(?:[0-9a-f]{2}){2,64}", re.IGNORECASE)
_HEX = re.compile(r"0.|.*[a-f]", re.IGNORECASE)
_WAY = re.compile(r"rx|tx", re.IGNORECASE)
_BUS = re.compile(r"\d{1,2}|(?:v?can|slcan|ch|bus)[ _-]?\d{1,2}", re.IGNORECASE)
# rows of one form that show it, and their share of those that begin with a time
_MIN_ROWS, _SHARE = 3, 0.9
# cells behind the bytes: a mark or a label
_MAX_BEHIND = 2
DELIMITERS = ",;\t"


class Form(NamedTuple):
    """The columns of a list without a header; the bytes are as many as the length says."""

    delimiter: str
    names: tuple[str, ...]  # the header that the list might have, from the first column to that of the data
    behind: str  # the first thing that stands behind the bytes; "": nothing does


def form_of(lines: Sequence[str]) -> Form | None:
    """The form of the rows; None: they have none that is known, or not one alone.

    >>> form_of(["0.10,0316,2,05,21,R", "0.11,02B0,1,FF,R", "0.12,0316,0,R"])
    Form(delimiter=',', names=('Time', 'ID', 'DLC', 'Data'), behind='R')
    >>> form_of(["0.10,0316,1,2,05,21"] * 3), form_of(["0.1,850,0,20.5", "0.2,851,1,20"] * 3)
    (None, None)
    >>> form_of([f"{k},0.1{k},can0,0x316,0,2,0521" for k in range(3)]).names
    ('No', 'Time', 'Channel', 'ID', 'Extended', 'DLC', 'Data')
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
            # names in a language that is not known may state a unit
            and (len(rows[0]) < len(kind.names) - 1 or re.search(r"\d", "".join(rows[0])))
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
    words = [word for cell in cells for word in cell.split()]
    if words and n > 1 and _JOINED.fullmatch(words[0]) and len(words[0].removeprefix("0x")) == 2 * n:
        words = re.findall("..", words[0].removeprefix("0x"))
    words = words[:n]
    return [word[2:] if word[:2] in ("0x", "0X") else word for word in words]


def may_be(lines: Sequence[str]) -> bool:
    """Whether rows may be frames, whatever stands between their times and their lengths, and in whatever base.

    >>> may_be(["0.1,790,2,5,33", "0.2,790,1,104", "0.3,790,2,7,0"]), may_be(["0.1,790,2.5,5,33"] * 3)
    (True, False)
    """
    rows = [re.split("[,;\t ]+", line.strip()) for line in lines]
    good = [
        any(word.isdecimal() and 1 <= int(word) == len(cells) - k - 1 for k, word in enumerate(cells[2:7], 2))
        and all(re.fullmatch(r"[0-9a-fx]{1,10}", cell, re.IGNORECASE) for cell in cells[1:])
        for cells in rows
    ]
    return sum(good) >= max(_MIN_ROWS, _SHARE * len(rows))


def _form(cells: Sequence[str], delimiter: str) -> tuple[Form, bool] | None:
    """The form of a row, and whether it has bytes and hexadecimal numbers."""
    time = int(len(cells) > 1 and cells[0].isdecimal() and re.fullmatch(r"\d+[.,:].+", cells[1]) is not None)
    forms = list[tuple[int, Form, bool]]()
    for length in range(time + 2, min(time + 6, len(cells))):
        names = _between(cells[time + 1 : length])
        if not names or not _TIME.fullmatch(cells[time]) or not re.fullmatch(r"\d{1,2}", cells[length]):
            continue
        n, words = int(cells[length]), [word for cell in cells[length + 1 :] for word in cell.split()]
        data = octets(words, n)
        behind = words[n if data[:1] == octets(words, 1) else 1 :]
        whole = len(data) == n <= 64 and all(map(_OCTET.fullmatch, data))
        if whole and len(behind) <= _MAX_BEHIND and not any(map(_OCTET.fullmatch, behind)):
            is_hex = n > 0 and any(map(_HEX.match, (cells[time + 1 + names.index("ID")], *data)))
            names = [*("No", "Time")[1 - time :], *names, "DLC", "Data"]
            forms.append((n, Form(delimiter, tuple(names), "".join(behind[:1])), is_hex))
    return max(forms, key=lambda each: each[0])[1:] if forms else None


def _between(cells: Sequence[str]) -> list[str]:
    """The names of the columns between the time and the length; none: they are not known.

    >>> _between(["Rx", "0316"]), _between(["can0", "18FEF100", "1"]), _between(["316", "1"]), _between(["7"])
    (['Dir', 'ID'], ['Channel', 'ID', 'Extended'], [], [])
    """
    names, wide = list[str](), ""
    for cell in cells:
        if _WAY.fullmatch(cell):
            names.append("Dir")
        elif not wide and _ID.fullmatch(cell):
            names.append("ID")
            wide = str(int(int(cell.lower().rstrip("hx").removeprefix("0x"), 16) > MAX_STANDARD_ID))
        elif cell == wide or (not wide and _BUS.fullmatch(cell)):
            names.append("Extended" if wide else "Channel")
        else:
            return []
    return names if wide and len({*names}) == len(names) else []
