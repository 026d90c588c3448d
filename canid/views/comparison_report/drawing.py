"""Static SVG in the colors of the style sheet: elements with rounded coordinates and escaped text."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import Markup, escape


def element(name: str, kind: str = "", **attributes: float | str) -> str:
    """An element without content.

    Example:
        >>> element("line", "a", x1=1.0, y1=2.25)
        '<line class="a" x1="1" y1="2.2"/>'
    """
    own = f' class="{kind}"' if kind else ""
    shown = "".join(f' {key}="{_value(value)}"' for key, value in attributes.items())
    return f"<{name}{own}{shown}/>"


def text(words: str, x: float, y: float, kind: str = "", anchor: str = "start") -> str:
    """A text; whatever it holds is data."""
    return (
        f'<text class="{kind}" x="{_value(x)}" y="{_value(y)}" text-anchor="{anchor}">{escape(words)}</text>'
    )


def points(of: Iterable[tuple[float, float]]) -> str:
    """Points of a polyline or polygon."""
    return " ".join(f"{_value(x)},{_value(y)}" for x, y in of)


def svg(parts: Iterable[str], width: float, height: float, alt: str) -> Markup:
    """The whole drawing, as wide as its place allows."""
    return Markup(
        f'<svg class="drawing" viewBox="0 0 {_value(width)} {_value(height)}" role="img" '
        f'aria-label="{escape(alt)}" style="max-width: {_value(width)}px">{"".join(parts)}</svg>'
    )


def _value(x: float | str) -> str:
    return str(escape(x)) if isinstance(x, str) else f"{x:.1f}".removesuffix(".0")
