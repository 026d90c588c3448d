"""The one environment of canid's HTML pages, and their style sheets and scripts."""

from __future__ import annotations

import re
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from canid.values.text.names import readable
from canid.values.text.numbers import interval, number, percent


def environment() -> Environment:
    """Templates by their path under `canid/ui/views`, with the filters for numbers and names.

    Example:
        >>> environment().from_string("{{ 2.5 | number('s') }}").render()
        '2.5 s'
    """
    templates = Environment(
        loader=PackageLoader("canid.ui.views", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters.update(interval=interval, percent=percent, number=number, readable=readable)
    templates.filters.update(css_string=css_string, form=lambda value: type(value).__name__)
    return templates


def code(text: str) -> Markup:
    """Escaped text whose words between backticks are shown as code.

    Example:
        >>> code("map `pedal` <first>")
        Markup('map <code>pedal</code> &lt;first&gt;')
    """
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def css_string(text: str) -> Markup:
    r"""Text as a string of a style sheet; all but plain letters, digits and spaces as code points.

    Example:
        >>> css_string('a "b" </style>')
        Markup('"a \\22 b\\22  \\3c \\2f style\\3e "')
    """
    plain = "".join(c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in text)
    return Markup(f'"{plain}"')


def file_text(path: str) -> Markup:
    """A style sheet or script by its path under `canid/ui/views`, as part of a page."""
    return Markup(files("canid.ui.views").joinpath(path).read_text(encoding="utf-8"))
