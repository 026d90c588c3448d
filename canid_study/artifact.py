"""Data types of a study: one row per equation, table, figure and claim of a paper; tables and figures as data."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from canid.values.types import Array


class ClaimVerdict(Enum):
    """What a check says of a published number or sentence."""

    HOLDS = "holds"
    FAILS = "fails"
    IMPOSSIBLE = "impossible"  # contradicts itself, whatever the data
    AMBIGUOUS = "ambiguous"
    UNDECIDED = "not decided"  # the data could say either, and their test says neither at its level
    NOT_CHECKABLE = "not checkable"  # needs data or curves that are not public
    SHOWN = "shown"  # nothing is claimed: a table or figure made anew


class Artifact(NamedTuple):
    """One row: an equation, table, figure or claim of a paper, and what became of it."""

    name: str  # "eq. 2.5", "Table 1", "Fig. 14", "claim G3"
    what: str  # in a few words
    published: str  # the printed number or claim, in words and numbers of canid's own
    reproduced: str  # by the paper's method; empty: nothing
    corrected: str  # canid's answer, with its interval; empty: nothing
    verdict: ClaimVerdict
    why: str
    files: tuple[
        str, ...
    ] = ()  # of the study's folder that show it: "tables/table_1.csv", "figures/fig_12.svg"


Cell = str | float | int | None  # None, or NaN: nothing known


class Table(NamedTuple):
    """A table, one CSV file.

    Intervals are three columns: x, x_low, x_high. Units are in the column's name: "tau (s)".
    """

    name: str  # of the file without suffix: "table_1", "claims"
    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[Cell]]
    note: str = ""  # below the table in the page


class Curve(NamedTuple):
    """A line, or points, of a panel."""

    x: Array  # (n,)
    y: Array  # (n,); NaN breaks the line
    label: str = ""  # in the legend; empty: not listed
    low: Array | None = None  # (n,) lower edge of a band; of points: error bars
    high: Array | None = None  # (n,)
    points: bool = False
    role: str = "reproduced"  # color: "published", "reproduced", "corrected", "measured", "limit", "other"
    dashed: bool = False


class Panel(NamedTuple):
    """One pair of axes."""

    x_label: str  # with unit
    y_label: str
    curves: tuple[Curve, ...]
    title: str = ""
    log_x: bool = False
    log_y: bool = False
    equal: bool = False  # one unit is as long on both axes: maps, Nyquist plots
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


class Figure(NamedTuple):
    """A figure, one SVG file."""

    name: str  # of the file without suffix, by the paper's number: "fig_12"; without one: "margins"
    title: str
    panels: tuple[Panel, ...]  # below each other
    caption: str = ""  # what to see in it


class Skipped(NamedTuple):
    """A log, or a part of one, that is not in the results."""

    log: str
    what: str  # "segment 17", "the whole log"
    why: str


class Study(NamedTuple):
    """All that `canid study` shows."""

    paper: str  # "Grover 2021"
    title: str
    says: tuple[str, ...]  # the result, in two or three sentences
    artifacts: tuple[Artifact, ...]
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    skipped: tuple[Skipped, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()  # name, value
    failed: tuple[str, ...] = ()  # acceptance figures of --reproduce that were missed, each as a sentence
