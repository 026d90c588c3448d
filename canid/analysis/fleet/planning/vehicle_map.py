"""The mapping file of `canid fleet --vehicles`: which driver, car and vehicle file each log belongs to."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, model_validator

from canid.analysis.fleet.job import Source
from canid.analysis.fleet.planning import globs
from canid.analysis.fleet.planning.sources import of_vehicle, read_source
from canid.signals.dbc_text.parsing import ParseError, Parser
from canid.signals.vehicle import file_bytes, read_vehicle
from canid.signals.vehicle.quoting import brief, shown
from canid.signals.vehicle.schema import File, Name, Section, did_you_mean, parse
from canid.values.errors import ConfigError

# a line for each of 20,000 logs; the parser reads it in a second or two
MAX_MAP_BYTES = 3_000_000
MAX_ENTRIES = 20_000
# mistakes that are reported at once: more are one mistake repeated
_MAX_MISTAKES = 30
_SECTIONS = ("drives", "vehicle", "columns")
_Filled = Annotated[str, Field(min_length=1, max_length=300)]


class Drives(Section):
    """One entry: logs, and whose they are."""

    match: File
    driver: _Filled | None = None
    car: _Filled | None = None
    group: Name = ""
    vehicle: File | None = None
    columns: File | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Drives:
        if self.vehicle is not None and self.columns is not None:
            raise ValueError("names vehicle and columns: a log has one of both")
        return self


class Entry(NamedTuple):
    """One entry, with its source."""

    match: str
    driver: str  # "": by the folders
    car: str  # "": by the folders, else the vehicle's name
    group: str
    source: str  # key of its `Source`; "": the default


class VehicleMap(NamedTuple):
    """The mapping file. The first entry that matches a log holds."""

    path: str
    entries: tuple[Entry, ...]
    names: dict[str, int]  # entries without wildcards, by their whole path
    patterns: tuple[tuple[int, bool, re.Pattern[str]], ...]  # index, whether of the name alone, expression
    source: str  # of logs whose entry names none; "": none
    sources: dict[str, Source]


def read_map(path: str | Path) -> VehicleMap:
    """Read a mapping file.

    Raises:
        ConfigError: with all its mistakes and those of the vehicle files that it names, a line each.
    """
    file = Path(path)
    data = file_bytes.read(file, MAX_MAP_BYTES, "mapping file")
    try:
        with Parser() as parser:
            table = parser.toml(data)
    except ParseError as error:
        raise ConfigError(f"{file} is not valid TOML: {brief(str(error))}") from None
    return of_table(table, file)


def of_table(table: dict[str, Any], file: Path) -> VehicleMap:
    """Check what a mapping file holds. Raises ConfigError with all mistakes."""
    name = brief(file.name)
    mistakes = [
        f"{name}: {brief(key)}: unknown section{did_you_mean(key, _SECTIONS)}"
        for key in list(table)[:_MAX_MISTAKES]
        if key not in _SECTIONS
    ]
    listed = table.get("drives")
    if not isinstance(listed, list) or not listed or len(listed) > MAX_ENTRIES:
        what = f"{len(listed):,} entries" if isinstance(listed, list) and listed else shown(listed)
        mistakes.append(
            f'{name}: drives: must be 1 to {MAX_ENTRIES:,} entries such as [[drives]] match = "*.blf", not {what}'
        )
        listed = []
    sources: dict[str, Source] = {}
    read: dict[tuple[str, str], str] = {}

    def source_of(kind: str, given: object, key: str) -> str:
        if given is None:
            return ""
        if not isinstance(given, str):
            mistakes.append(f"{name}: {key}: must be a text, not {shown(given)}")
            return ""
        if (kind, given) not in read:
            read[kind, given] = ""
            try:
                located = _located(given, file)
                # a shipped vehicle and a shipped column map may have one name: openacc
                bare = located == given and not Path(given).suffix and "/" not in given
                made = of_vehicle(read_vehicle(given)) if kind == "vehicle" and bare else read_source(located)
            except ConfigError as error:
                mistakes.extend(f"{name}: {key}: {line}" for line in error.mistakes)
            else:
                if (made.vehicle is None) == (kind == "vehicle"):
                    other = "columns" if kind == "vehicle" else "vehicle"
                    mistakes.append(f"{name}: {key}: {brief(given)} is for {other} =")
                sources[made.fingerprint] = made
                read[kind, given] = made.fingerprint
        return read[kind, given]

    default = source_of("vehicle", table.get("vehicle"), "vehicle") or source_of(
        "columns", table.get("columns"), "columns"
    )
    entries = []
    for i, value in enumerate(listed):
        if len(mistakes) >= _MAX_MISTAKES:
            break
        entry, wrong = parse(Drives, value, f"drives[{i}]")
        mistakes += [f"{name}: {line}" for line in wrong]
        if entry is not None:
            source = source_of("vehicle", entry.vehicle, f"drives[{i}].vehicle") or source_of(
                "columns", entry.columns, f"drives[{i}].columns"
            )
            match = entry.match.removeprefix("./")
            entries.append(Entry(match, entry.driver or "", entry.car or "", entry.group, source))
    if mistakes:
        raise ConfigError(*mistakes[:_MAX_MISTAKES])
    names: dict[str, int] = {}
    patterns = []
    for i, mapped in enumerate(entries):
        if not globs.is_pattern(mapped.match) and "/" in mapped.match:
            names.setdefault(mapped.match, i)
        else:
            split = mapped.match.split("/")
            patterns.append((i, len(split) == 1, globs.of_names(split)))
    return VehicleMap(str(file), tuple(entries), names, tuple(patterns), default, sources)


def _located(given: str, file: Path) -> str:
    """A file relative to the mapping file; else a name, such as of a shipped vehicle."""
    near = file.parent / given
    return str(near) if os.path.exists(near) or "/" in given else given


def entry_of(relative: str, mapping: VehicleMap) -> Entry | None:
    """The first entry that matches a log.

    Args:
        relative: path of the log below its root. A pattern without a slash is matched with its name alone.
        mapping: the mapping file.

    Example:
        >>> table = {"drives": [{"match": "2019/a*.blf", "driver": "anna"}, {"match": "*.blf", "driver": "ben"}]}
        >>> of = of_table(table, Path("map.toml"))
        >>> [entry_of(path, of).driver for path in ("2019/a1.blf", "2020/a1.blf")]
        ['anna', 'ben']
        >>> entry_of("a.asc", of) is None
        True
    """
    exact = mapping.names.get(relative, len(mapping.entries))
    name = relative.rpartition("/")[2]
    for i, name_alone, expression in mapping.patterns:
        if i > exact:
            break
        if expression.fullmatch(name if name_alone else relative):
            return mapping.entries[i]
    return mapping.entries[exact] if exact < len(mapping.entries) else None
