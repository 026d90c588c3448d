"""VBOX .vbo, Racelogic's text format, as columns with units.

Format: https://en.racelogic.support/VBOX_Automotive/Knowledge_Base/VBO_File_Format
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.analysis.tables.source import MAX_COLUMNS
from canid.analysis.tables.sources.text_source import MAX_LINE_BYTES
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import LineCount, blocks
from canid.io.logs.text_lines import line as line_of
from canid.values.errors import ConfigError, DamagedLogError, LogError
from canid.values.types import Array

DAY_S = 86_400.0
LAT, LON = "lat", "lon"
# degrees; what is less in both, taken as minutes, is ocean in the Gulf of Guinea: it is in degrees
_MAX_LAT, _MAX_LON = 90.0, 180.0
_OF_MINUTES = 1.0 / 60.0
# bytes of a file: 24 h of 40 columns at 10 Hz
MAX_BYTES = 500_000_000
# words of the titles of standard channels: canid's name, unit, factor; positions are in minutes, see `_position`.
# https://developers.racelogic.co.uk lists them
_STANDARD: tuple[tuple[str, str, str, float], ...] = (
    (r"sats|satellites", "satellites", "", 1.0),
    (r"lat|latitude", LAT, "deg", 1.0),
    (r"long|longitude", LON, "deg", 1.0),
    (r"heading", "heading", "deg", 1.0),
    (r"height", "altitude", "m", 1.0),
)
_SECTION = re.compile(r"\[([\w ]{1,40})\]")
# hhmmss.sss at the end of a day
_MAX_CLOCK = 240_000.0
_VELOCITY = {"kmh": "km/h", "km/h": "km/h", "knots": "knot", "mph": "mph", "m/s": "m/s"}


class VboColumn(NamedTuple):
    """A channel; NaN: not a number in the file."""

    value: Array  # (n,)
    unit: str  # "" where the file states none


class Vbo(NamedTuple):
    """A .vbo file."""

    t: Array  # (n,) s since the first row
    columns: dict[
        str, VboColumn
    ]  # satellites, lat, lon (deg, east positive), speed, heading, altitude; others as named
    start_utc: float  # s since 1970 UTC of the first row; NaN where the file states no date
    lines: LineCount  # rows, lines that are none, and damaged ones
    notes: tuple[str, ...] = ()  # what was judged, sentences


def read_vbo(path: str | Path) -> Vbo:
    """Read a .vbo file.

    Columns of standard channels have canid's names (`lat`, `lon`, `speed`, `altitude`, `heading`, `satellites`), others
    their own from the file. A day that ends within the drive is followed.

    Raises:
        ConfigError: there is no such file.
        LogError: it is no .vbo, or none of its rows can be read.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "a.vbo"
        >>> text = "File created on 02/08/2018 at 15:34:47|[header]|time|latitude|longitude|velocity kmh|[column names]|"
        >>> text += "time lat long velocity|[data]|153447.50 +03119.5 +00060.0 036.000|"
        >>> _ = path.write_text(text.replace("|", chr(10)))
        >>> read = read_vbo(path)
        >>> read.start_utc, {name: (c.value.tolist(), c.unit) for name, c in read.columns.items()}["lon"]
        (1533224087.5, ([-1.0], 'deg'))
    """
    file = Path(path)
    if not os.path.exists(file):
        raise ConfigError(f"no such file: {path}")
    try:
        if file.stat().st_size > MAX_BYTES:
            raise LogError(f"{path}: has more than {MAX_BYTES / 1e6:.0f} MB")
        header, sections, values, count = _read(file)
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror}") from None
    names = " ".join(sections.get("column names", [])).split()
    if values is None or not names:
        missing = "column names" if values is not None or "data" in sections else "data"
        raise LogError(f"{path}: is no .vbo: it has no [{missing}] section")
    titles = sections.get("header", [])
    titles = titles if len(titles) == len(names) else names
    time = next((k for k, name in enumerate(names) if name.lower() == "time"), None)
    if time is None or not len(values):
        damage = count.damage("rows")
        why = f" ({damage.says})" if damage else ""
        kind = DamagedLogError if damage else LogError
        raise kind(f"{path}: has no {'rows' if time is not None else 'column time'}{why}")
    seconds = _seconds(values[:, time])
    units = iter(sections.get("channel units", []))
    columns: dict[str, VboColumn] = {}
    for k, (name, title) in enumerate(zip(names, titles, strict=True)):
        if k == time:
            continue
        made, unit, factor = _meaning(name, title, units)
        columns[made if made not in columns else f"{made}_{k}"] = VboColumn(values[:, k] * factor, unit)
    notes = _position(columns, str(path))
    return Vbo(seconds - seconds[0], columns, _start(header, float(seconds[0])), count, notes)


def _position(columns: dict[str, VboColumn], name: str) -> tuple[str, ...]:
    """Put the position in degrees, east and north positive; leave it out where it can be neither form.

    Racelogic writes minutes with the longitude positive to the west; other loggers write degrees, positive to the east.
    """
    if not {LAT, LON} <= columns.keys():
        return ()
    # zeros stand for no position
    size = [np.abs(columns[role].value) for role in (LAT, LON)]
    lat, lon = (float(np.median(known)) if (known := x[x > 0.0]).size else 0.0 for x in size)
    if lat <= _MAX_LAT and lon <= _MAX_LON:
        return (f"{name}: the position is in degrees, east positive",) if lat + lon > 0.0 else ()
    if lat * _OF_MINUTES > _MAX_LAT or lon * _OF_MINUTES > _MAX_LON:
        del columns[LAT], columns[LON]
        return (
            f"{name}: the position of {lat:g} and {lon:g} is neither in minutes nor in degrees; it was left out",
        )
    columns[LAT] = VboColumn(columns[LAT].value * _OF_MINUTES, "deg")
    columns[LON] = VboColumn(columns[LON].value * -_OF_MINUTES, "deg")
    return ()


def _read(file: Path) -> tuple[str, dict[str, list[str]], Array | None, LineCount]:
    """First line, the lines of each section, and the rows of [data], (n, columns).

    Blank lines count in [channel units] alone. A line of the data with another number of values than there are columns
    is damaged.
    """
    count = LineCount()
    sections: dict[str, list[str]] = {}
    parts: list[Array] = []
    name = first = ""
    width, time = 0, -1
    for block in blocks(file, ReadState(size=file.stat().st_size), count, MAX_LINE_BYTES):
        flat: list[float] = []
        begin = 0
        for k, end in enumerate(block.ends.tolist()):
            # UTF-8 by VBOX units, ANSI by older programs
            line = block.data[begin:end].decode("utf-8", "replace").strip()
            if block.number + k == 1:
                first = line
            match = _SECTION.fullmatch(line)
            if match or name != "data":
                count.others["header lines"] += bool(line)
                if match:
                    name = match[1].strip().lower()
                    sections.setdefault(name, [])
                    names = " ".join(sections.get("column names", [])).lower().split()
                    width, time = len(names), names.index("time") if "time" in names else -1
                elif name and (line or name == "channel units") and len(sections[name]) < MAX_COLUMNS:
                    sections[name].append(line)
            elif line:
                # values are separated by blanks: a comma is a decimal one
                cells = line.replace(",", ".").split()
                why = "" if len(cells) == width else f"has {len(cells)} values, and there are {width} columns"
                if not why and time >= 0 and not 0.0 <= _number(cells[time]) <= _MAX_CLOCK:
                    why = "its time is damaged"
                if why:
                    count.miss(line_of(block, k, begin, end), why)
                else:
                    count.took(block.number + k, np.zeros(1, np.int64))
                    flat += map(_number, cells)
            begin = end
        if flat:
            parts.append(np.array(flat).reshape(-1, width))
    values = np.concatenate(parts) if parts else np.zeros((0, width))
    return first, sections, values if "data" in sections else None, count


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _seconds(stamp: Array) -> Array:
    """Of hhmmss.sss, going on after midnight."""
    # whole ms first: the fraction of 153447.5 is exact to 1e-11 only
    ms = np.rint(stamp * 1e3)
    whole = ms // 1000
    seconds = whole // 10_000 * 3600 + whole // 100 % 100 * 60 + whole % 100 + ms % 1000 / 1e3
    midnights = np.concatenate([[0.0], np.cumsum(np.diff(seconds) < -DAY_S / 2)])
    return np.asarray(seconds + DAY_S * midnights, dtype=np.float64)


def _meaning(name: str, title: str, units: Iterator[str]) -> tuple[str, str, float]:
    """Name, unit and factor of a channel; one that is not standard takes the next unit of the file."""
    lower = title.lower()
    for pattern, made, unit, factor in _STANDARD:
        if re.fullmatch(pattern, name.lower()) or re.fullmatch(pattern, lower):
            return made, unit, factor
    match = re.match(r"(vertical )?(?:velocity|vertvel|vert-vel|speed)\s*(kmh|km/h|knots|mph|m/s)?$", lower)
    if match or name.lower() == "velocity":
        unit = _VELOCITY.get((match[2] if match else "") or "kmh", "km/h")
        return "vertical_speed" if match and match[1] else "speed", unit, 1.0
    return name, next(units, ""), 1.0


_DATE: Callable[[str], re.Match[str] | None] = re.compile(r"File created on (\d\d)/(\d\d)/(\d{4})").match


def _start(first: str, seconds: float) -> float:
    match = _DATE(first.strip().lstrip("\ufeff"))
    try:
        day = datetime(int(match[3]), int(match[2]), int(match[1]), tzinfo=UTC) if match else None
    except ValueError:
        day = None
    # the epoch's own day is what stands where no date is known
    return (
        math.nan
        if day is None or day.year <= 1970 or not math.isfinite(seconds)
        else day.timestamp() + seconds
    )
