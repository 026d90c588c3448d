"""Rows of a table: the wanted columns of the rows that were selected, and the vehicles among which to select."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.headings import heading
from canid.analysis.tables.resolution import place_of
from canid.analysis.tables.source import EMPTY, MAX_KEPT, NO_NUMBER, Source, number
from canid.signals.vehicle.quoting import brief, several
from canid.signals.vehicle.schema import did_you_mean
from canid.values.errors import ConfigError
from canid.values.types import Array

Bools = npt.NDArray[np.bool_]
# vehicles that a message lists
MAX_LISTED = 8
# vehicles of one table; a million ids are a column that is no id
MAX_VEHICLES = 1_000_000


class Where(NamedTuple):
    """Rows whose column holds this."""

    place: int
    value: str


class Rows(NamedTuple):
    """Columns of the selected rows, by their places."""

    numbers: Mapping[int, Array]
    texts: Mapping[int, list[str]]
    n: int
    lines: npt.NDArray[np.int64]  # (n,) of the file


def wheres(given: Sequence[str], headings: Sequence[str], name: str) -> list[Where]:
    """Parse NAME=VALUE.

    Raises:
        ConfigError: it is none, or there is no such column.

    Example:
        >>> wheres(["Location=us-101"], ["time", "location"], "x.csv")
        [Where(place=1, value='us-101')]
    """
    parsed = [heading(text) for text in headings]
    out = []
    for text in given:
        column, equals, value = text.partition("=")
        place = place_of(column, parsed) if equals else -1
        if not equals:
            raise ConfigError(f'--where "{brief(text)}": write NAME=VALUE, such as ID=12')
        if place < 0:
            texts = [title.text.strip() for title in parsed]
            raise ConfigError(
                f"{name}: --where: no column {brief(column)}{did_you_mean(column, texts)}; it has {several(texts, 12)}"
            )
        out.append(Where(place, value.strip()))
    return out


def is_text(sample: Sequence[str]) -> bool:
    """Whether most cells of a column hold texts.

    Example:
        >>> is_text(["ACC", "Human"]), is_text(["1.5", "", "n/a"])
        (True, False)
    """
    filled = [cell for cell in sample if cell]
    return sum(number(cell) == NO_NUMBER for cell in filled) * 2 > len(filled)


def same(values: Array | list[str], value: str) -> Bools:
    """Which cells hold a value, as a number or as a text.

    Example:
        >>> same(np.array([12.0, 13.0]), "12").tolist(), same(["US-101"], "us-101").tolist()
        ([True, False], [True])
    """
    if isinstance(values, list):
        wanted = value.strip().lower()
        return np.array([cell.strip().lower() == wanted for cell in values], bool)
    wanted_number = number(value)
    equal: Bools = values == wanted_number if wanted_number != NO_NUMBER else np.zeros(len(values), bool)
    return equal


def read(
    source: Source,
    numbers: Sequence[int],
    texts: Sequence[int],
    keep: Callable[[Mapping[int, Array], Mapping[int, list[str]]], Bools] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Rows:
    """Read columns of the rows that are kept.

    Args:
        source: of the columns.
        numbers: places of columns that are read as numbers.
        texts: places of columns that are read as texts.
        keep: which rows of a block; None: all.
        progress: called with the share that was read.

    Raises:
        ConfigError: more than can be kept.
    """
    parts: list[Array] = []
    kept_texts: list[list[str]] = [[] for _ in texts]
    lines: list[npt.NDArray[np.int64]] = []
    kept = 0
    if keep is None and source.rows * len(numbers) > MAX_KEPT:
        raise _too_many(source)
    for block in source.blocks(numbers, texts):
        rows = block.numbers if numbers else np.zeros((len(block.texts[0]) if texts else 0, 0))
        line_numbers = block.lines
        if keep is not None:
            named = {place: rows[:, j] for j, place in enumerate(numbers)}
            mask = keep(named, dict(zip(texts, block.texts, strict=True)))
            rows, line_numbers = rows[mask], line_numbers[mask]
            chosen = np.flatnonzero(mask).tolist()
            for have, column in zip(kept_texts, block.texts, strict=True):
                have += [column[k] for k in chosen]
        else:
            for have, column in zip(kept_texts, block.texts, strict=True):
                have += column
        parts.append(rows)
        lines.append(line_numbers)
        kept += rows.size
        if kept > MAX_KEPT:
            raise _too_many(source)
        if progress is not None:
            progress(source.progress)
    joined = np.concatenate(parts) if parts else np.zeros((0, len(numbers)))
    return Rows(
        {place: np.ascontiguousarray(joined[:, j]) for j, place in enumerate(numbers)},
        dict(zip(texts, kept_texts, strict=True)),
        len(joined),
        np.concatenate(lines) if lines else np.zeros(0, np.int64),
    )


def _too_many(source: Source) -> ConfigError:
    return ConfigError(
        f"{source.name}: holds more than {MAX_KEPT:,} numbers; select a part of the rows, or split it"
    )


def vehicles(
    source: Source,
    id_place: int,
    text: bool,
    lead: int | None,
    selection: Sequence[Where],
    texts: Sequence[int],
    none: Sequence[float] = (),
) -> dict[str, tuple[int, int]]:
    """Vehicles of a table: id -> its rows, and those behind a lead.

    Args:
        source: of the columns.
        id_place: of the column of ids.
        text: whether ids are texts.
        lead: place of the column that shows that there is a lead: not 0, not empty; None: there is none.
        selection: rows that count.
        texts: places that are read as texts.
        none: numbers of `lead` that say that there is none.

    Raises:
        ConfigError: too many to be vehicles.
    """
    counts: dict[str, tuple[int, int]] = {}
    wanted = {id_place, *(condition.place for condition in selection), *([] if lead is None else [lead])}
    numbers = sorted(wanted - set(texts))
    as_text = sorted(wanted & set(texts))
    for values, words in _blocks(source, numbers, as_text):
        column: Array | list[str] = words[id_place] if text else values[id_place]
        mask = np.ones(len(column), bool)
        for condition in selection:
            mask &= same(
                words[condition.place] if condition.place in words else values[condition.place],
                condition.value,
            )
        behind = mask.copy()
        if lead is not None and lead in values:
            x = values[lead]
            behind &= np.isfinite(x) & (x != EMPTY) & (x != NO_NUMBER) & (x != 0.0) & ~np.isin(x, none)
        elif lead is not None:
            behind &= np.array([bool(cell.strip()) for cell in words[lead]], bool)
        ids = np.array(column)
        keys, inverse = np.unique(ids, return_inverse=True)
        rows = np.bincount(inverse[mask], minlength=len(keys))
        following = np.bincount(inverse[behind], minlength=len(keys))
        for key, n, m in zip(keys.tolist(), rows.tolist(), following.tolist(), strict=True):
            if n and key != EMPTY and key != "":
                name = key if isinstance(key, str) else f"{key:.12g}"
                before = counts.get(name, (0, 0))
                counts[name] = before[0] + n, before[1] + m
        if len(counts) > MAX_VEHICLES:
            raise ConfigError(
                f"{source.name}: {source.headings[id_place]} has more than {MAX_VEHICLES:,} values: no id"
            )
    return counts


def _blocks(
    source: Source, numbers: Sequence[int], texts: Sequence[int]
) -> Iterator[tuple[dict[int, Array], dict[int, list[str]]]]:
    for block in source.blocks(numbers, texts):
        yield (
            {place: block.numbers[:, j] for j, place in enumerate(numbers)},
            dict(zip(texts, block.texts, strict=True)),
        )


def listed(counts: Mapping[str, tuple[int, int]], dt: float, behind: bool = True) -> str:
    """The vehicles that follow longest, in words.

    Example:
        >>> listed({"7": (100, 0), "12": (100, 90)}, 0.1)
        '12 (9 s behind a lead), 7 (0 s)'
    """
    order = sorted(counts, key=lambda key: (-counts[key][1], -counts[key][0], key))
    shown = [f"{brief(key)} ({counts[key][1] * dt:.3g} s)" for key in order[:MAX_LISTED]]
    shown[0] = shown[0].replace(" s)", " s behind a lead)" if behind else " s)")
    more = f" and {len(order) - MAX_LISTED:,} more" if len(order) > MAX_LISTED else ""
    return ", ".join(shown) + more
