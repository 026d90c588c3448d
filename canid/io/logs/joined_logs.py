"""Logs that were joined into one file by cat or copy: one axis for their times.

A further log's times continue at the date of its header, as the clock had it. Without a date, of it or of the logs
before, they continue at the last time of the log before. Both is said, with where the log begins.
"""

from __future__ import annotations

import datetime

from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import MAX_TIME_NS

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


class Axis:
    """Times of all logs of a file, since the first one's zero.

    >>> state = ReadState()
    >>> axis = Axis(state)
    >>> axis.begin(10**18, ""), axis.begin(10**18 + 300 * 10**9, "line 22")
    (0, 300000000000)
    >>> axis.last = 400 * 10**9
    >>> _ = axis.begin(10**18 + 300 * 10**9, "line 44")
    >>> state.remarks[1][-22:]
    'or a clock was not set'
    >>> state.remarks[:1]
    ['a further log begins at line 22: its times continue at its own date, 2001-09-09 01:51:40 UTC']
    """

    def __init__(self, state: ReadState):
        """`state`: takes the remarks."""
        self.last = 0  # ns, of the latest time on the axis
        self._state = state
        self._zero: int | None = None  # epoch ns of the axis's zero

    def begin(self, start: int | None, where: str) -> int:
        """A log begins: what is to be added to its times, ns.

        Args:
            start: epoch ns of its zero; None: not stated.
            where: it begins; "": it is the first.
        """
        shift = 0
        if where:
            known = (
                start is not None and self._zero is not None and abs(start - self._zero) < MAX_TIME_NS // 2
            )
            shift = (
                start - self._zero if known and start is not None and self._zero is not None else self.last
            )
            self._state.remark(
                f"a further log begins at {where}: its times continue {_how(start, shift, known, self.last)}"
            )
        if self._zero is None and start is not None:
            self._zero = start - shift
        return shift


def _how(start: int | None, shift: int, known: bool, last: int) -> str:
    if not known or start is None:
        return "at the end of the log before, since not both logs state their date"
    at = f"{_EPOCH + datetime.timedelta(microseconds=start // 1000):%Y-%m-%d %H:%M:%S} UTC"
    if shift < 0:
        return f"at its own date, {at}, which is before the first log's"
    overlap = ", which is before the end of the log before: they overlap, or a clock was not set"
    return f"at its own date, {at}{overlap if shift < last else ''}"
