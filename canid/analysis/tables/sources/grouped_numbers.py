"""Numbers whose thousands are grouped, as spreadsheets write them: 1,118,846.5 and 1.118.846,5 and 1'118'846."""

from __future__ import annotations

import re
from collections.abc import Sequence

# apostrophe, typographic apostrophe, spaces: separators that are never a decimal sign
_NEUTRAL = "'\u2019\u00a0\u202f "
# 0,125 and 0.125 group nothing
_COMMAS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+(?:\.\d*)?")
_DECIMAL_COMMA = re.compile(r"[-+]?(?:0\d*,\d+|\d+,(?:\d{1,2}|\d{4,}))")
_NEUTRALS = re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:[{_NEUTRAL}]\d{{3}})+(?:[.,]\d*)?")
_POINTS = re.compile(r"[-+]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d*)?")
# a group of three digits in bytes that no other digit or point continues; a date has other groups
_POINTS_IN_BYTES = re.compile(rb"(?<![\d.])[1-9]\d{0,2}(?:\.\d{3})+(?![\d.])")
_POINT = re.compile(r"[-+]?\d*\.\d+")
_DELETE = str.maketrans("", "", _NEUTRAL)


def by_points(cell: str) -> bool:
    """Whether points may group the thousands of a number.

    Example:
        >>> by_points("1.234,5"), by_points("1.234"), by_points("0.125"), by_points("31.12.2024")
        (True, True, False, False)
    """
    return _POINTS.fullmatch(cell) is not None


def any_by_points(data: bytes) -> bool:
    """Whether points group thousands in one of the cells, where the decimal sign is a comma.

    Example:
        >>> any_by_points(b"999;1,5"), any_by_points(b"1.000;1,5"), any_by_points(b"31.12.2024;1,5")
        (False, True, False)
    """
    return b"." in data and _POINTS_IN_BYTES.search(data) is not None


def any_by_commas(rows: Sequence[Sequence[str]]) -> bool:
    """Whether commas group thousands: two of them in one number, or next to decimal points and where none is decimal."""
    if any(_DECIMAL_COMMA.fullmatch(cell) for row in rows for cell in row):
        return False
    cells = [cell for row in rows for cell in row if "," in cell and _COMMAS.fullmatch(cell)]
    if any(cell.count(",") > 1 or "." in cell for cell in cells):
        return True
    return bool(cells) and any(_POINT.fullmatch(cell) for row in rows for cell in row)


def plain(cell: str, decimal_comma: bool, commas_group: bool = False) -> str:
    """A number with a decimal point and without separators; another text as it is, but for its commas.

    Args:
        cell: of a table.
        decimal_comma: a comma is the decimal sign.
        commas_group: a comma groups thousands.

    Example:
        >>> plain("1.118.846,5", True), plain("1'118'846.5", False), plain("1,118", False, commas_group=True)
        ('1118846.5', '1118846.5', '1118')
    """
    stripped = cell.strip()
    if _NEUTRALS.fullmatch(stripped):
        cell = stripped.translate(_DELETE)
    elif decimal_comma and by_points(stripped):
        cell = cell.replace(".", "")
    elif commas_group and "," in cell and _COMMAS.fullmatch(stripped):
        cell = cell.replace(",", "")
    return cell.replace(",", ".") if decimal_comma else cell
