"""Where a log is damaged: stretches of bytes, put together where they touch, and one sentence about them."""

from __future__ import annotations

# stretches that are told apart; of a file that is damaged in more places, the last one reaches to the last of them
_PLACES = 1000


class Damaged:
    """Collects what could not be read, in the order of the file, in bounded memory."""

    def __init__(self) -> None:
        """Start with nothing damaged."""
        self._spans: list[tuple[int, int]] = []
        self._why = ""
        self._more = 0
        self.count = 0  # what was added

    def add(self, begin: int, end: int, why: str) -> None:
        """Bytes from `begin` up to, not including, `end` could not be read; none where nobody knows which."""
        self.count += 1
        touches = bool(self._spans) and begin <= self._spans[-1][1] + 1
        if not self._why:
            self._why = why
        elif end <= begin or not touches:
            self._more += 1
        if end <= begin:
            return
        if self._spans and (touches or len(self._spans) == _PLACES):
            first, last = self._spans[-1]
            self._spans[-1] = min(first, begin), max(last, end - 1)
        else:
            self._spans.append((begin, end - 1))

    def __bool__(self) -> bool:
        return bool(self._why)

    @property
    def spans(self) -> tuple[tuple[int, int], ...]:
        """First and last byte of each stretch."""
        return tuple(self._spans)

    def says(self, what: str, read: int, total: int) -> str:
        """Say how much was read, where the damage is, and what was wrong first. `total` -1: nobody knows.

        >>> damaged = Damaged()
        >>> damaged.add(100, 200, "a container's compressed data are damaged")
        >>> damaged.says("objects", 90, 95)
        "read 90 of 95 objects, bytes 100–199 damaged: a container's compressed data are damaged"
        """
        of = f" of {total:d}" if total >= 0 else ""
        places = len(self._spans)
        where = f", bytes {self._spans[0][0]}–{self._spans[0][1]}" if places else ""
        where += f" and {places - 1} more place{'s' if places > 2 else ''}" if places > 1 else ""
        more = f", and {self._more} more" if self._more else ""
        return f"read {read}{of} {what}{where}{' damaged' if places else ''}: {self._why}{more}"
