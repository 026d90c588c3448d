"""How a result finds its text, HTML, plot and table, which are made on higher floors.

A result is a plain value that every part of canid may use, and a user expects `result.summary()` and `result.plot()` of
it. Its methods call the functions here, and these ask what the package itself (`canid/__init__.py`, the top floor) has
provided: `views.presenters`, imported when something is shown for the first time. So no import goes up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Presenter(NamedTuple):
    """The four forms of one type of result."""

    summary: Callable[[Any], list[str]]  # lines, as the command line prints them
    html: Callable[[Any], str]  # a fragment for a notebook, without scripts
    plot: Callable[[Any], Any]  # a plotly Figure
    frame: Callable[[Any, str], Any] | None = None  # (result, "pandas", "polars" or "") -> a data frame


Find = Callable[[type], Presenter]
_find: list[Callable[[], Find]] = []


def provide(load: Callable[[], Find]) -> None:
    """Set the function that imports the presenters; called once, by the package."""
    _find[:] = [load]


def summary(result: object) -> str:
    """The result as text."""
    return "\n".join(_presenter(result).summary(result))


def html(result: object) -> str:
    """The result as a fragment of HTML."""
    return _presenter(result).html(result)


def plot(result: object) -> Any:
    """The result as a plotly Figure.

    Raises:
        ConfigError: plotly is not installed.
    """
    return _presenter(result).plot(result)


def frame(result: object, library: str) -> Any:
    """The result as a data frame.

    Raises:
        ConfigError: the library, or any that could be used, is not installed.
        ValueError: no such library.
    """
    make = _presenter(result).frame
    assert make is not None, f"{type(result).__name__} has no table"
    return make(result, library)


def _presenter(result: object) -> Presenter:
    return _find[0]()(type(result))
