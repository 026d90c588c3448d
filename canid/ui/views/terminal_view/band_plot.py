"""A parameter over the last minutes with its 95 % band, in braille characters of 2x4 dots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from canid.ui.terminal.spans import Span
from canid.values.types import Interval

# bit of the braille character per dot: (column, row)
DOTS = {
    (0, 0): 0x01, (0, 1): 0x02, (0, 2): 0x04, (0, 3): 0x40, (1, 0): 0x08, (1, 1): 0x10, (1, 2): 0x20, (1, 3): 0x80,
}  # fmt: skip
BRAILLE = 0x2800
# share of the range of the values that stays free above and below them, where the band is narrower than that
MARGIN = 0.15
# half-widths of the typical band that are shown around the values: a wide band at the start does not flatten the rest
BAND_SHOWN = 1.3


def bounds(points: Sequence[tuple[float, Interval]]) -> tuple[float, float]:
    """Lowest and highest value of the plot: all values, and the typical band around them.

    Example:
        >>> bounds([(0.0, Interval(4.0, 3.0, 5.0)), (1.0, Interval(4.4, 3.4, 5.4))])
        (2.7, 5.7)
    """
    values = [iv.value for _, iv in points]
    widths = [(iv.high - iv.low) / 2.0 for _, iv in points if math.isfinite(iv.high - iv.low)]
    low, high = min(values), max(values)
    room = max(BAND_SHOWN * median(widths) if widths else 0.0, MARGIN * (high - low), 1e-9 + 1e-3 * abs(high))
    return low - room, high + room


def rows(
    points: Sequence[tuple[float, Interval]], start: float, stop: float, columns: int, height: int, style: str
) -> list[tuple[Span, ...]]:
    """The plot as lines: the value as a line of dots in `style`, the band as a dim pattern of every second dot.

    Args:
        points: (t [s], value with interval), by time, finite values.
        start: s, at the left edge.
        stop: s, at the right edge; later than `start`.
        columns: characters.
        height: characters.
        style: of the value.

    Returns:
        `height` lines of `columns` characters.
    """
    low, high = bounds(points)
    levels = 4 * height
    band = [[0] * columns for _ in range(height)]
    line = [[0] * columns for _ in range(height)]

    def level(x: float) -> int:
        """Row of dots from the top."""
        return min(max(round((high - x) / (high - low) * (levels - 1)), 0), levels - 1)

    def dot(grid: list[list[int]], column: int, row: int) -> None:
        grid[row // 4][column // 2] |= DOTS[column % 2, row % 4]

    latest = _by_column(points, start, stop, 2 * columns)
    before: int | None = None
    for column, iv in enumerate(latest):
        if iv is None:
            before = None
            continue
        at = level(iv.value)
        if math.isfinite(iv.low) and math.isfinite(iv.high):
            for row in range(level(iv.high), level(iv.low) + 1):
                if (row + column) % 2 == 0:
                    dot(band, column, row)
        # a step is drawn as a line, so that it does not fall apart
        first, last = (at, at) if before is None else (min(at, before), max(at, before))
        for row in range(first, last + 1):
            dot(line, column, row)
        before = at
    return [_joined(band[k], line[k], style) for k in range(height)]


def _by_column(
    points: Sequence[tuple[float, Interval]], start: float, stop: float, columns: int
) -> list[Interval | None]:
    """The latest point of each column of dots; a gap of less than 3 s is bridged."""
    out: list[Interval | None] = [None] * columns
    step = (stop - start) / columns
    for t, iv in points:
        if start <= t <= stop:
            first = min(int((t - start) / step), columns - 1)
            held = min(int((t + GAP_S - start) / step), columns - 1)
            for column in range(first, max(held, first) + 1):
                out[column] = iv
    return out


# s that a point is held: estimates come twice a second, and the trend keeps one a second
GAP_S = 2.0


def _joined(band: list[int], line: list[int], style: str) -> tuple[Span, ...]:
    """Characters of the same style in one span; where the value is, the band is left out."""
    spans: list[Span] = []
    start = 0
    for at in range(1, len(line) + 1):
        if at == len(line) or bool(line[at]) != bool(line[start]):
            shown = line if line[start] else band
            text = "".join(chr(BRAILLE + bits) if bits else " " for bits in shown[start:at])
            spans.append(Span(text, style if line[start] else "dim"))
            start = at
    return tuple(spans)
