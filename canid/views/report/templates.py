"""The one environment of canid's HTML pages, and their style sheets and scripts."""

from __future__ import annotations

from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from canid.views.names import either, readable
from canid.views.numbers import interval, number, percent


def environment() -> Environment:
    """Templates by their path under `canid/views`, with the filters for numbers and names.

    Example:
        >>> environment().from_string("{{ 2.5 | number('s') }}").render()
        '2.5 s'
    """
    of = Environment(
        loader=PackageLoader("canid.views", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    of.filters.update(interval=interval, percent=percent, number=number, readable=readable, either=either)
    return of


def file_text(path: str) -> Markup:
    """A style sheet or script by its path under `canid/views`, as part of a page."""
    return Markup(files("canid.views").joinpath(path).read_text(encoding="utf-8"))
