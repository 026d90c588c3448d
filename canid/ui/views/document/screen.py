"""A summary that fits on one screen: its parts by importance, the least important cut first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from canid.ui.views.document.document_text import WIDTH


class Part(NamedTuple):
    """Lines that belong together."""

    lines: list[str]
    least: int  # of them that stay where the summary becomes too long


def cut(parts: Sequence[Part], most: int) -> list[str]:
    """Drop lines from the end of the last parts, until all fit; a part that is cut ends with an ellipsis.

    Example:
        >>> cut([Part(["a"], 1), Part(["b", "c", "d"], 1)], 3)
        ['a', 'b', 'c …']
    """
    kept = [len(part.lines) for part in parts]
    for k in range(len(parts) - 1, -1, -1):
        while sum(kept) > most and kept[k] > min(parts[k].least, len(parts[k].lines)):
            kept[k] -= 1
    return [line for part, n in zip(parts, kept, strict=True) for line in _first(part.lines, n)]


def _first(lines: list[str], n: int) -> list[str]:
    if n >= len(lines) or not n:
        return lines[:n]
    return [*lines[: n - 1], f"{lines[n - 1][: WIDTH - 2].rstrip()} …"]
