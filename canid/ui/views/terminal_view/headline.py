"""The headline: the one estimate to quote, with large numbers, its trend and its progress."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

from canid.ui.terminal.spans import Line, Span, cells, packed, width
from canid.ui.views.terminal_view import band_plot, digits
from canid.ui.views.terminal_view.estimate_lines import Numbers
from canid.ui.views.terminal_view.state import TREND_SPAN_S, View
from canid.values.text import estimate_text
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import gain_unit
from canid.values.types import QUOTED, Channel, Estimate, Identifiable, Interval, Progress, Status

# how much of a channel is known, most first
KNOWN = (Identifiable.OK, Identifiable.SUM_ONLY, Identifiable.GAIN_ONLY, Identifiable.NOT)
# delays that may be quoted, by status
QUOTED_DELAYS = {status: tuple(name for name in names if name != "K") for status, names in QUOTED.items()}
# s that the time axis has at least
SHORTEST_AXIS_S = 60.0
# columns of "K headway -12.34 " in front of a trend
AXIS_COLUMNS = 17
# columns of a progress bar, at most
BAR_COLUMNS = 24
# columns between two large numbers
GAP = 4


def leading(view: View) -> Estimate | None:
    """The headline estimate; without one, that of the estimator that had it last, or that knows most."""
    now = [e for e in view.estimates if e.headline] or [
        e for e in view.estimates if e.estimator == view.headlined
    ]
    # of equals the same one every time, so that the picture does not alternate
    return max(now or view.estimates, key=lambda e: (e.status is Status.OK, e.estimator), default=None)


def main_channel(channels: Mapping[str, Channel]) -> str | None:
    """The channel of which most is known; of equals the last one, range rate before headway error."""
    ranks = {
        name: KNOWN.index(ch.status) for name, ch in channels.items() if ch.status is not Identifiable.NOT
    }
    best = [name for name, rank in ranks.items() if rank == min(ranks.values())]
    return best[-1] if best else None


def large_numbers(n: Numbers, output: str, columns: int) -> tuple[list[Line], bool]:
    """K and the quoted delays of the main channel in block digits, each with unit and interval.

    Returns:
        Three lines, [] where nothing fits or is known; and whether all that may be quoted of the channel is in them.
    """
    name = main_channel(n.shown.channels)
    if name is None:
        return [], False
    ch = n.shown.channels[name]
    blocks = [_block(f"K {readable(name)}", ch.K, gain_unit(output, name), n.style)]
    quoted = QUOTED_DELAYS[ch.status]
    blocks += [_block(SYMBOLS[delay], getattr(ch, delay), "s", n.style) for delay in quoted]
    out: list[Line] = [(), (), ()]
    fitting = 0
    for block in blocks:
        space = GAP if fitting else 1
        if width(out[0]) + space + width(block[0]) > columns:
            break
        out = [(*line, Span(" " * space), *row) for line, row in zip(out, block, strict=True)]
        fitting += 1
    return (out if fitting else []), bool(quoted) and fitting == len(blocks)


def _block(label: str, iv: Interval, unit: str, style: str) -> list[Line]:
    """Three lines of equal width: a number, and at its right what it is, its interval and its unit."""
    text = f"{iv.value:z.2f}" if abs(iv.value) < 100.0 else f"{iv.value:z.0f}"
    low_high = estimate_text.fixed(iv).partition(" ")[2]
    words = (label, low_high, unit)
    columns = max(map(cells, words))
    return [
        (
            Span(row, style),
            Span("  "),
            Span(f"{word}{' ' * (columns - cells(word))}", "bold" if not k else "dim"),
        )
        for k, (row, word) in enumerate(zip(digits.large(text), words, strict=True))
    ]


class Curve(NamedTuple):
    """One parameter of one channel over the last minutes."""

    label: str
    points: tuple[tuple[float, Interval], ...]  # by time, s
    start: float  # s, of the time axis
    stop: float
    style: str


def curves(view: View) -> list[Curve]:
    """K and the quoted delay of the main channel, then K of the others, as far as two points of it are known."""
    if not view.trend:
        return []
    # whole seconds: between them the plots are the same, and are not drawn again
    stop = max(math.floor(view.t), view.trend[-1].t)
    start = max(stop - TREND_SPAN_S, min(view.trend[0].t, stop - SHORTEST_AXIS_S))
    kept = [point for point in view.trend if point.t >= start]
    main = main_channel(kept[-1].channels) if kept else None
    if main is None:
        return []
    wanted = [(main, "K"), *((main, what) for what in QUOTED_DELAYS[kept[-1].channels[main].status][:1])]
    wanted += [(name, "K") for name in kept[-1].channels if name != main]
    out = []
    for name, what in wanted:
        points = tuple(
            (p.t, iv)
            for p in kept
            if name in p.channels
            and p.channels[name].status is not Identifiable.NOT
            and math.isfinite((iv := getattr(p.channels[name], what)).value)
        )
        label = SYMBOLS[what] if name == main else f"K {name.partition('_')[0]}"
        if len(points) > 1:
            out.append(Curve(label, points, start, stop, "bold green" if what == "K" else "bold cyan"))
    return out


# drawing is half the cost of a large picture: the curves of a picture are kept for those of the same second
@lru_cache(maxsize=8)
def plotted(curve: Curve, columns: int, rows: int) -> list[Line]:
    """A curve with its 95 % band: at its left the highest and the lowest value, and the time that the plot spans."""
    plot = band_plot.rows(curve.points, curve.start, curve.stop, columns - AXIS_COLUMNS, rows, curve.style)
    low, high = band_plot.bounds(curve.points)
    inner = ("", "") * (rows - 2)
    labels = (curve.label, *inner[: rows - 2], _span(curve.stop - curve.start))
    values = (f"{high:.2f}", *inner[: rows - 2], f"{low:.2f}")
    return [
        (Span(f"{label:9}{value:>7} ", "dim"), *row)
        for label, value, row in zip(labels, values, plot, strict=True)
    ]


def _span(seconds: float) -> str:
    return f"{seconds / 60.0:.0f} min" if seconds >= 90.0 else f"{seconds:.0f} s"


def progress(e: Estimate, output: str, columns: int, *, every: bool = False) -> list[Line]:
    """What is to be known next, how far that is, and how many more seconds of such driving it takes."""
    known = [(name, ch.progress) for name, ch in e.channels.items() if ch.progress is not None]
    # what comes first: NaN is never
    known.sort(key=lambda item: (not item[1].seconds >= 0.0, item[1].seconds))
    out: list[Line] = []
    for name, state in known if every else known[:1]:
        done = share_done(state)
        room = min(max(columns - 60, 8), BAR_COLUMNS)
        full = round(done * room)
        label: Line = (Span("next: ", "dim"), Span(f"{readable(name)} {SYMBOLS[state.parameter]}"))
        bar: Line = (
            Span("█" * full, "cyan"),
            Span("░" * (room - full), "dim"),
            Span(f" {100 * done:.0f} %"),
        )
        _, _, missing = estimate_text.missing(state, gain_unit(output, name)).partition(" ")
        out += packed([label, bar, (Span(missing, "dim"),)], columns)
    return out


def share_done(progress: Progress) -> float:
    """Share of the driving that a parameter needs: information grows with time, as 1/sd².

    Example:
        >>> share_done(Progress("tau", 0.2, 0.1, 180.0))
        0.25
    """
    if not (progress.sd > 0.0 and progress.needed > 0.0 and math.isfinite(progress.sd)):
        return 0.0
    return min((progress.needed / progress.sd) ** 2, 0.99)
