"""A table: columns over time with units, made when they are asked for, so that a long log needs little memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# float64: NaN is "not measured"; int64; or objects: texts, None is "no text"
Values = npt.NDArray[Any]


class Field(NamedTuple):
    """A column."""

    name: str
    unit: str = ""
    comment: str = ""
    kind: Literal["number", "integer", "text"] = "number"
    choices: Mapping[float, str] = {}  # value -> what it means


class Table(NamedTuple):
    """Rows in the order of time."""

    group: str  # "samples", "estimates", "signals", "plot"
    name: str  # within its group, such as a message; "": the group has one table
    t: Array  # (n,) s since the log's first frame
    fields: tuple[Field, ...]
    values: Callable[[slice], list[Values]]  # of these rows, one for each field
    comment: str = ""

    @property
    def title(self) -> str:
        """Group and name."""
        return f"{self.group}.{self.name}" if self.name else self.group


class Origin(NamedTuple):
    """Where the tables come from, for the headers of files."""

    log: str  # its name
    start_ns: int | None  # ns since 1970 UTC of t = 0; None: the log states no date
    vehicle: str = ""
    program: str = "canid"  # with its version

    @property
    def start_text(self) -> str:
        """The start as ISO 8601, UTC; "" where it is not known.

        Example:
            >>> Origin("a.blf", 1_533_224_087_123_456_789).start_text
            '2018-08-02T15:34:47.123456789Z'
        """
        return "" if self.start_ns is None else f"{np.datetime64(self.start_ns, 'ns')}Z"


def of_columns(
    group: str, name: str, t: Array, columns: list[tuple[Field, Values]], comment: str = ""
) -> Table:
    """Make a table of columns that exist.

    Example:
        >>> table = of_columns("samples", "", np.arange(2.0), [(Field("gap", "m"), np.array([3.0, 4.0]))])
        >>> table.values(slice(1, None))
        [array([4.])]
    """
    fields = tuple(field for field, _ in columns)
    return Table(group, name, t, fields, lambda part: [values[part] for _, values in columns], comment)


def in_ns(t: Array) -> npt.NDArray[np.int64]:
    """Times as whole nanoseconds, which they are.

    Example:
        >>> in_ns(np.array([0.1, 1.5])).tolist()
        [100000000, 1500000000]
    """
    return np.rint(t * 1e9).astype(np.int64)
