"""The optional plotly package: its script for pages, and our figures as its figures for notebooks."""

from __future__ import annotations

import re
import zlib
from base64 import b64encode
from functools import cache
from html import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from markupsafe import Markup

from canid.ui.views.drawing.figure import Figure, Spec
from canid.ui.views.drawing.palette import NOTEBOOK
from canid.values.errors import ConfigError

# px that a title takes above the legend
TITLE_PX = 34


def plotly_file() -> Path | None:
    """plotly.js of the installed package, which is not imported; None without one."""
    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        return None
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"


def plotly_script() -> Markup | None:
    """plotly.js, packed, and the script that unpacks and runs it, as elements of a page; None without the package."""
    file = plotly_file()
    if file is None:
        return None
    inflate = Markup(Path(__file__).with_name("inflate.js").read_text(encoding="utf-8"))
    return Markup(
        '<script type="text/plain" id="plotly" data-bytes="{}">{}</script>\n<script>{}</script>'
    ).format(file.stat().st_size, _packed(file), inflate)


@cache
def _packed(file: Path) -> str:
    """A file as raw DEFLATE in base64."""
    packer = zlib.compressobj(9, wbits=-zlib.MAX_WBITS)
    return b64encode(packer.compress(file.read_bytes()) + packer.flush()).decode()


def plotly_figure(drawn: Figure | None, title: str) -> Any:
    """A figure of the reports as a `plotly.graph_objects.Figure`; background and text are those of its template.

    Args:
        drawn: the figure; None: there is nothing to draw, and the title says so.
        title: data, not markup.

    Raises:
        ConfigError: plotly is not installed.

    Example:
        >>> drawn = Figure("a", "", "", "", 200, [{"y": [1.0], "line": {"color": "@after"}}], {})
        >>> plotly_figure(drawn, "<b>").layout.title.text
        '&lt;b&gt;'
    """
    if plotly_file() is None:
        raise ConfigError("plot() needs plotly: pip install 'canid[report]'")
    objects = import_module("plotly.graph_objects")
    head = {"text": escape(title, quote=False), "x": 0, "xref": "paper", "y": 1, "yref": "container"}
    head |= {"yanchor": "top", "pad": {"t": 8}, "font": {"size": 15}}
    if drawn is None:
        return objects.Figure(layout={"title": head, "height": 160})
    layout = _painted(drawn.layout)
    height = drawn.height + TITLE_PX
    layout["margin"] = layout.get("margin", {}) | {"t": layout.get("margin", {}).get("t", 0) + TITLE_PX}
    layout["legend"] = layout.get("legend", {}) | {"y": 1.0 - TITLE_PX / height}
    return objects.Figure(_painted(drawn.data), layout | {"title": head, "height": height})


def _painted(value: Any) -> Any:
    """The colors of `NOTEBOOK`; what has none there is left to plotly's template."""
    if isinstance(value, dict):
        kept: Spec = {key: x for key, x in value.items() if not (_named(x) and x[1:] not in NOTEBOOK)}
        return {key: _painted(x) for key, x in kept.items()}
    if isinstance(value, list | tuple):
        return [_painted(x) for x in value]
    return NOTEBOOK[value[1:]] if _named(value) else value


def _named(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch("@[a-z-]+", value) is not None
