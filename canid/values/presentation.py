"""How a result finds its text, HTML, plot and table, which are made in higher layers.

A result is a plain value that every part of canid may use, and a user expects `result.summary()` and `result.plot()` of
it. Results inherit these from `Shown`, or `Tabled`, and they ask what the package itself (`canid/__init__.py`, above all
layers) has provided: `ui.views.presenters`, imported when something is shown for the first time. So no import goes up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

if TYPE_CHECKING:
    import pandas
    import polars


class Presenter(NamedTuple):
    """The four forms of one type of result."""

    summary: Callable[[Any], list[str]]  # lines, as the command line prints them
    html: Callable[[Any], str]  # a fragment for a notebook, without scripts
    plot: Callable[[Any], Any]  # a plotly Figure
    kinds: Mapping[str, Callable[[Any], Any]] = {}  # further plots, by the names that `plot` takes
    frame: Callable[[Any, str], Any] | None = None  # (result, "pandas", "polars" or "") -> a data frame


Find = Callable[[type], Presenter]
_find: list[Callable[[], Find]] = []


def provide(load: Callable[[], Find]) -> None:
    """Set the function that imports the presenters; called once, by the package."""
    _find[:] = [load]


class Shown:
    """A result that shows itself, in text, notebook and plot."""

    __slots__ = ()

    def summary(self) -> str:
        """The result as text, as the command line prints it."""
        return "\n".join(_presenter(self).summary(self))

    def plot(self, kind: str = "") -> Any:
        """The result as a plotly Figure.

        Args:
            kind: of an identification "step" or "frequency": the driver's response, with the measured one; "": the
                estimates over the drive.

        Raises:
            ConfigError: plotly is not installed.
            ValueError: another kind.
        """
        presenter = _presenter(self)
        if kind and kind not in presenter.kinds:
            known = ", ".join(repr(each) for each in ("", *presenter.kinds))
            raise ValueError(f"plot of a {type(self).__name__}: no kind {kind!r}; there are {known}")
        return (presenter.kinds[kind] if kind else presenter.plot)(self)

    def _repr_html_(self) -> str:
        return _presenter(self).html(self)


class Tabled(Shown):
    """A result that is a data frame as well."""

    __slots__ = ()

    @overload
    def to_frame(self, library: Literal["pandas"]) -> pandas.DataFrame: ...
    @overload
    def to_frame(self, library: Literal["polars"]) -> polars.DataFrame: ...
    @overload
    def to_frame(self, library: Literal[""] = "") -> Any: ...
    def to_frame(self, library: str = "") -> Any:
        """The result as a data frame.

        Of a trace or drive the columns `t`, `output`, the inputs, every signal, `learn`, `segment` and `gate`; of an
        identification the headline's parameters, a row each: input, parameter, value, low, high, unit, quotable.

        Args:
            library: "pandas" or "polars"; "": pandas where it is installed, else polars.

        Returns:
            a pandas DataFrame with the units in `frame.attrs["units"]`; a polars one, which has no attributes, with
            units in the names of its columns: "speed [m/s]".

        Raises:
            ConfigError: it is not installed.
            ValueError: another library.
        """
        make = _presenter(self).frame
        assert make is not None, f"{type(self).__name__} has no table"
        return make(self, library)


def _presenter(result: object) -> Presenter:
    return _find[0]()(type(result))
