"""The damaged spans of a log, merged where they touch, and one sentence about them."""

from __future__ import annotations

# spans that are kept separate; with more, the last one extends to the last damaged byte
_MAX_SPANS = 1000


class DamagedSpans:
    """Collects what could not be read, in the order of the file, in bounded memory."""

    def __init__(self) -> None:
        """Start with nothing damaged."""
        self._spans: list[tuple[int, int]] = []
        self._why = ""
        self._more = 0
        self.count = 0  # what was added

    def add(self, begin: int, end: int, why: str, count: int = 1) -> None:
        """Bytes from `begin` up to, not including, `end` could not be read; equal where the place is unknown.

        `count`: how many lines or objects these are.
        """
        self.count += count
        touches = bool(self._spans) and begin <= self._spans[-1][1] + 1
        if not self._why:
            self._why = why
            self._more = count - 1
        elif end <= begin or not touches:
            self._more += count
        if end <= begin:
            return
        if self._spans and (touches or len(self._spans) == _MAX_SPANS):
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

    def sentence(self, what: str, read: int, total: int) -> str:
        """State how much was read, where the damage is, and its first cause. `total` -1: unknown.

        >>> damaged = DamagedSpans()
        >>> damaged.add(100, 200, "a container's compressed data are damaged")
        >>> damaged.sentence("objects", 90, 95)
        "read 90 of 95 objects, bytes 100–199 damaged: a container's compressed data are damaged"
        """
        share = f" of {total:d}" if total >= 0 else ""
        places = len(self._spans)
        where = f", bytes {self._spans[0][0]}–{self._spans[0][1]}" if places else ""
        where += f" and {places - 1} more place{'s' if places > 2 else ''}" if places > 1 else ""
        more = f", and {self._more} more" if self._more else ""
        return f"read {read}{share} {what}{where}{' damaged' if places else ''}: {self._why}{more}"
