"""Which format a text file has, by its first lines: a suffix such as .log, .csv or .trc belongs to several programs."""

from __future__ import annotations

import gzip
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from canid.io.logs import formats
from canid.io.logs.formats import Form
from canid.io.logs.list_columns import byte_of, decoded, role_of
from canid.io.logs.others import bare_lists
from canid.values.errors import ConfigError

# of python-can's .csv: a header of which most is there is one that is damaged
_NAMES = ["timestamp", "arbitration_id", "extended", "remote", "error", "dlc", "data"]
_PYTHON_CAN, _MOST = {*_NAMES}, 5
# and those of them that no table of signals has
_OF_PYTHON_CAN = {"arbitration_id", "extended", "remote", "dlc"}
# a quote that opens a cell and is not closed in its line; and lines that one header may have
_OPEN, _MAX_SPAN = re.compile(r'^[^"]*(?:"[^"]*"[^"]*)*(?:^|[,;\t])\s*"[^"]*$'), 200
# bytes that are looked at; Vehicle Spy has some 60 lines before its first frame, and lines of Kvaser's header are long
_BEGIN_BYTES = 65_536
_MAX_LINES = 200
# how `candump -c` switches colors
COLOR = re.compile(r"\x1b\[[\d;]{0,16}m")
_MARKS = ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"), (b"\xef\xbb\xbf", "utf-8"))
# a cell of at least four bytes, as no table of signals has: 01 02 03 04, 0x01 0x02 0x03 0x04; three may be a date
_CELLS_OF_BYTES = re.compile(
    r"(?:^|[,;\t])\s*((0x)?[0-9a-f]{2}\s*[,;\t]\s*){3,63}(0x)?[0-9a-f]{2}\s*(?:[,;\t]|$)", re.I
)
_BYTES = re.compile(r"(x\| )?(0x)?[0-9a-f]{2}([ -]+(0x)?[0-9a-f]{2}){3,63}", re.IGNORECASE)
# rows of one such cell each, in one column, that make a list of frames whatever its header's language
_ROWS_OF_BYTES, _SHARE_OF_BYTES = 2, 0.3


def encoding(begin: bytes) -> tuple[str, int]:
    r"""The encoding that a byte order mark states, and its length; latin-1 where there is none: it cannot fail.

    >>> encoding(b"\xff\xfed\x00"), encoding(b"date")
    (('utf-16-le', 2), ('latin-1', 0))
    """
    return next(((name, len(mark)) for mark, name in _MARKS if begin.startswith(mark)), ("latin-1", 0))


def is_gzip(path: Path) -> bool:
    """Whether a file is gzipped, by its suffix or its first bytes. Raises OSError."""
    if path.suffix.lower() == ".gz":
        return True
    with path.open("rb") as file:
        return file.read(3) == b"\x1f\x8b\x08"  # RFC 1952, deflate


def first_lines(path: Path) -> list[str]:
    """The first lines of a text file that are not blank, without colors; plain or gzipped, in whatever encoding.

    Raises OSError.
    """
    try:
        with gzip.open(path, "rb") if is_gzip(path) else path.open("rb") as file:
            begin = file.read(_BEGIN_BYTES)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        return []
    name, mark = encoding(begin)
    lines = COLOR.sub("", begin[mark:].decode(name, errors="replace")).splitlines()
    # the last one may be cut
    whole = lines if len(begin) < _BEGIN_BYTES or len(lines) == 1 else lines[:-1]
    filled = [line for line in whole if line.strip()][:_MAX_LINES]
    return ["\n".join(filled[a:b]) for a, b in with_open_quotes(filled)]


def with_open_quotes(lines: Sequence[str]) -> list[tuple[int, int]]:
    """Which lines belong together, each as (first, last + 1): names in quotes that hold line feeds, above the first row.

    >>> with_open_quotes(['a text', '"Time', '[s]","Gap', '[m]"', '0.1,20.4', '0.2,"'])
    [(0, 1), (1, 4), (4, 5), (5, 6)]
    """
    out, at, above = list[tuple[int, int]](), 0, True
    while at < len(lines):
        end = at + 1
        above = above and not re.match(r"\W?\d", lines[at])
        if above and _OPEN.search(lines[at]):
            quotes = accumulate(line.count('"') for line in lines[at : at + _MAX_SPAN])
            end = at + next((k for k, n in enumerate(quotes, 1) if n % 2 == 0), 1)
        out.append((at, end))
        at = end
    return out


class Head(NamedTuple):
    """The beginning of a file."""

    form: Form | None  # of the first line that has one; None: no line has
    lines: list[str]  # of `first_lines`; none where the suffix is of a binary format


def head_of(path: Path) -> Head:
    """Read the beginning of a file once, and say what it is.

    Raises OSError.
    """
    suffix = formats.log_suffix(path).removesuffix(".gz")
    if suffix not in formats.TEXT_SUFFIXES:
        return Head(None, [])
    lines = first_lines(path)
    for k, line in enumerate(lines):
        for form in formats.FORMS:
            if (not form.suffixes or suffix in form.suffixes) and re.match(form.line, line, re.IGNORECASE):
                # rows as python-can's below the header of another list, or its names in another form
                other = form.format is formats.FORMATS[".csv"] and any(map(is_frame_list, lines[: k + 1]))
                return Head(formats.UNKNOWN_LIST if other else form, lines)
    listed = suffix in formats.TABLE_SUFFIXES and (any(map(is_frame_list, lines)) or has_bytes(lines))
    bare = not any(map(is_header, lines)) and bare_lists.form_of(lines) is not None
    if listed or bare or (suffix in formats.TABLE_SUFFIXES and bare_lists.may_be(lines)):
        return Head(formats.UNKNOWN_LIST, lines)
    return Head(None, lines)


def refuse(path: Path, form: Form) -> ConfigError:
    """The error for a file of another program that is not read.

    >>> str(refuse(Path("x.csv"), formats.UNKNOWN_LIST)).split(": ")[:2]
    ['x.csv', 'lists CAN frames in a form that canid does not know']
    """
    return ConfigError(f"{path}: {form.says}: {form.remedy}")


def cells_of(line: str) -> list[str]:
    """The words of a header, in lower case and without blanks and quotation marks.

    >>> cells_of('"Time Stamp";ID')
    ['timestamp', 'id']
    """
    return [cell.strip(" \"'\t").lower().replace(" ", "") for cell in re.split(r"[,;\t]", line.strip())]


def is_frame_list(line: str) -> bool:
    """Whether a header names an id and data, and is not python-can's.

    >>> is_frame_list("Time,ID,DLC,Data"), is_frame_list("time,id,speed,gap"), is_frame_list("Identifier (hex);Data")
    (True, False, True)
    """
    cells = {cell for part in cells_of(decoded(line)) for cell in part.split("|")}
    roles = {role_of(cell) for cell in cells} | {"data" for cell in cells if byte_of(cell) is not None}
    # its header with a character damaged is still its header; with all names in another form it is another list
    names = [cell.strip(' "') for cell in line.lower().lstrip(",").split(",")]
    quoted = line.count('"') >= 2 * len(_NAMES)
    other = cells >= _PYTHON_CAN and (quoted or names[: len(_NAMES)] != _NAMES)
    return {"id", "data"} <= roles and (other or len(_PYTHON_CAN & cells) < _MOST)


def has_bytes(lines: list[str]) -> bool:
    """Whether many of the lines have a cell of four bytes or more, in one column: frames, under a header of any language.

    >>> has_bytes(["Nr;Kennung;Daten", "1;0x123;01 02 03 04", "2;0x124;0A FF 00 01"])
    True
    >>> has_bytes(["t,gap,date", "0.1,20.4,24-12-25", "0.2,20.5,24-12-25"])
    False
    """
    columns = Counter(
        k
        for line in lines
        for k, cell in enumerate(re.split(r"[,;\t]", line))
        if _BYTES.fullmatch(cell.strip(" \"'"))
    )
    # in cells of their own, of which some have letters
    cells = [match[0] for line in lines if (match := _CELLS_OF_BYTES.search(line))]
    in_cells = len(cells) if re.search(r"[a-f]", "".join(cells).lower()) else 0
    most = max(in_cells, *columns.values(), 0)
    return most >= _ROWS_OF_BYTES and most >= _SHARE_OF_BYTES * len(lines)


def is_header(line: str) -> bool:
    """Whether a line is the header of a table of named columns: several names, and no number.

    >>> is_header("%time,speed [km/h],gap"), is_header("0.1,0x123,1"), is_header("a word")
    (True, False, False)
    >>> is_header("timestamp,arbitration_id,exten")  # of python-can's .csv, damaged
    False
    """
    if any(letter < " " and letter != "\t" for letter in line):
        return False  # no text
    cells = [cell for cell in cells_of(line.lstrip("%")) if cell]
    return (
        len(cells) > 1 and not _OF_PYTHON_CAN & {*cells} and all(re.match(r"[^\W\d]", cell) for cell in cells)
    )


def is_table(lines: list[str]) -> bool:
    """Whether a header of named columns stands among the lines, and numbers within three lines below it.

    >>> is_table(["Date,26,09,2019", "Time,Speed", "s,m/s", "0.1,21.4"]), is_table(["a word, and a text", "more"])
    (True, False)
    """
    return any(
        is_header(line) and any(_has_numbers(below) for below in lines[k + 1 : k + 4])
        for k, line in enumerate(lines)
    )


def _has_numbers(line: str) -> bool:
    cells = cells_of(line)
    return len(cells) > 1 and any(re.fullmatch(r"[+-]?\d+([.,]\d+)?(e[+-]?\d+)?", cell) for cell in cells)
