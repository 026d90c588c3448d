"""Static SVG: scales, ticks, elements with rounded coordinates, and escaped text.

A part of a drawing is `Markup`, which only `element` makes: a text is escaped wherever it is put in.

Colors and widths are those of `drawing.css` by class, or attributes where there is no style sheet (notebooks).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from markupsafe import Markup

from canid.values.terminal_text import terminal_text

# s between two ticks of a time axis
TIME_STEPS_S = (1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0)


class Scale(NamedTuple):
    """Values to px; a value outside lies on the nearer end.

    Example:
        >>> Scale(0.0, 10.0, 100.0, 200.0)(2.5), Scale(0.0, 10.0, 100.0, 200.0)(11.0)
        (125.0, 200.0)
    """

    low: float
    high: float
    start: float  # px of `low`
    stop: float  # px of `high`

    def __call__(self, value: float) -> float:
        """Px of a value."""
        share = (min(max(value, self.low), self.high) - self.low) / (self.high - self.low)
        return self.start + (self.stop - self.start) * share


def scale(values: Iterable[float], start: float, stop: float, spare: float = 0.0) -> Scale | None:
    """The scale that shows all finite values; None: there is none.

    Args:
        values: what it must hold.
        start: px of the lowest.
        stop: px of the highest.
        spare: of their range, added on both sides.

    Example:
        >>> scale([2.0, math.nan, 3.0], 0.0, 9.0), scale([2.0], 0.0, 9.0), scale([], 0.0, 9.0)
        (Scale(low=2.0, high=3.0, start=0.0, stop=9.0), Scale(low=1.0, high=3.0, start=0.0, stop=9.0), None)
    """
    known = [float(x) for x in values if math.isfinite(x)]
    if not known:
        return None
    low, high = min(known), max(known)
    if not high > low:
        low, high = low - 1.0, high + 1.0
    spare *= high - low
    return Scale(low - spare, high + spare, start, stop)


def ticks(low: float, high: float, most: int = 5) -> list[float]:
    """Round numbers between two values: at most `most` steps, and at least two fifths of that.

    Example:
        >>> ticks(3.9, 6.2), ticks(0.13, 0.62)
        ([4.0, 4.5, 5.0, 5.5, 6.0], [0.2, 0.3, 0.4, 0.5, 0.6])
    """
    rough = (high - low) / most
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * k for k in (1.0, 2.0, 5.0, 10.0) if size * k >= rough)
    return _multiples(low, high, step)


def time_ticks(low: float, high: float, most: int = 10) -> list[float]:
    """Round times in s, at most `most` and one.

    Example:
        >>> time_ticks(0.0, 1200.0), time_ticks(20.0, 95.0, 4)
        ([0.0, 120.0, 240.0, 360.0, 480.0, 600.0, 720.0, 840.0, 960.0, 1080.0, 1200.0], [30.0, 60.0, 90.0])
    """
    long = high - low
    hours = TIME_STEPS_S[-1] * max(math.ceil(long / (TIME_STEPS_S[-1] * most)), 1)
    return _multiples(low, high, next((s for s in TIME_STEPS_S if long / s <= most), hours))


def _multiples(low: float, high: float, step: float) -> list[float]:
    # a tick at an end of the scale may lie outside by rounding
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 9) for k in range(first, last + 1)]


def element(name: str, kind: str = "", content: str = "", **attributes: float | str) -> Markup:
    """An element; `_` in the name of an attribute stands for `-`.

    Args:
        name: of the element.
        kind: its class.
        content: `Markup`, such as other elements, as it is; any other text is data.
        attributes: numbers are rounded, texts are data.

    Example:
        >>> element("line", "a", x1=1.0, y1=2.25, stroke_width=2)
        Markup('<line class="a" x1="1" y1="2.2" stroke-width="2"/>')
        >>> element("g", content=element("title", content="a < b"))
        Markup('<g><title>a &lt; b</title></g>')
    """
    shown = _attributes(kind, attributes)
    if not content:
        return Markup("<{}{}/>").format(name, shown)
    return Markup("<{0}{1}>{2}</{0}>").format(name, shown, _data(content))


def text(
    words: str, x: float, y: float, kind: str = "", anchor: str = "start", **more: float | str
) -> Markup:
    """A text; whatever it holds is data, also where it is `Markup`."""
    place: dict[str, float | str] = {"x": x, "y": y, "text_anchor": anchor}
    return element("text", kind, str(words), **place | more)


def points(pairs: Iterable[tuple[float, float]]) -> str:
    """Points of a polyline or polygon."""
    return " ".join(f"{_value(x)},{_value(y)}" for x, y in pairs)


def svg(parts: Iterable[Markup], width: float, height: float, alt: str) -> Markup:
    """The whole drawing, as wide as its place allows."""
    return whole(parts, (width, height), alt, "drawing", style=f"max-width: {_value(width)}px")


def small(parts: Iterable[Markup], width: float, height: float, alt: str = "", kind: str = "") -> Markup:
    """A drawing of fixed size for a cell of a table; without `alt` it repeats what other cells say."""
    return whole(parts, (width, height), alt, kind, width=width, height=height)


def whole(
    parts: Iterable[Markup], size: tuple[float, float], alt: str, kind: str = "", **more: float | str
) -> Markup:
    """A drawing with further attributes of its element."""
    box: dict[str, float | str] = {"viewBox": f"0 0 {_value(size[0])} {_value(size[1])}"}
    said: dict[str, float | str] = {"role": "img", "aria_label": alt} if alt else {"aria_hidden": "true"}
    return element("svg", kind, Markup("").join(parts), **box | said | more)


def _attributes(kind: str, attributes: dict[str, float | str]) -> Markup:
    named: dict[str, float | str] = {"class": kind} if kind else {}
    shown = named | attributes
    return Markup("").join(
        Markup(' {}="{}"').format(key.replace("_", "-"), _value(x)) for key, x in shown.items()
    )


def _value(x: float | str) -> str:
    return _data(str(x)) if isinstance(x, str) else f"{x:.1f}".removesuffix(".0")


def _data(text: str) -> str:
    """A text without what XML cannot hold, whose characters are shown as on a terminal; markup as it is."""
    return text if isinstance(text, Markup) else terminal_text(text)
