"""VBOX .vbo, Racelogic's text format, as columns with units.

Format: https://en.racelogic.support/VBOX_Automotive/Knowledge_Base/VBO_File_Format
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.errors import ConfigError, LogError
from canid.types import Array

DAY_S = 86_400.0
# bytes of a file: 24 h of 40 columns at 10 Hz
MAX_BYTES = 500_000_000
# words of the titles of standard channels: canid's name, unit, factor. https://developers.racelogic.co.uk lists them
_STANDARD: tuple[tuple[str, str, str, float], ...] = (
    (r"sats|satellites", "satellites", "", 1.0),
    (r"lat|latitude", "lat", "deg", 1.0 / 60.0),
    # positive to the west in the file
    (r"long|longitude", "lon", "deg", -1.0 / 60.0),
    (r"heading", "heading", "deg", 1.0),
    (r"height", "altitude", "m", 1.0),
)
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


def read_vbo(path: str | Path) -> Vbo:
    """Read a .vbo file.

    Columns of standard channels have canid's names (`lat`, `lon`, `speed`, `altitude`, `heading`, `satellites`), others
    their own from the file. A day that ends within the drive is followed.

    Raises:
        ConfigError: there is no such file.
        LogError: it is no .vbo, or a row has not as many values as there are columns; with the line.

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
    try:
        if file.stat().st_size > MAX_BYTES:
            raise LogError(f"{path}: has more than {MAX_BYTES / 1e6:.0f} MB")
        # UTF-8 by VBOX units, ANSI by older programs
        text = file.read_bytes().decode("utf-8", "replace")
    except FileNotFoundError:
        raise ConfigError(f"no such file: {path}") from None
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror}") from None
    first, sections = _sections(text)
    data, names = sections.get("data"), " ".join(line for _, line in sections.get("column names", [])).split()
    if data is None or not names:
        raise LogError(f"{path}: is no .vbo: it has no [{'data' if names else 'column names'}] section")
    titles = [line for _, line in sections.get("header", [])]
    titles = titles if len(titles) == len(names) else names
    values = _values(str(path), data, names)
    time = next((k for k, name in enumerate(names) if name.lower() == "time"), None)
    if time is None or not len(values):
        raise LogError(f"{path}: has no {'rows' if time is not None else 'column time'}")
    seconds = _seconds(values[:, time])
    units = iter([line for _, line in sections.get("channel units", [])])
    columns: dict[str, VboColumn] = {}
    for k, (name, title) in enumerate(zip(names, titles, strict=True)):
        if k == time:
            continue
        made, unit, factor = _meaning(name, title, units)
        columns[made if made not in columns else f"{made}_{k}"] = VboColumn(values[:, k] * factor, unit)
    return Vbo(seconds - seconds[0], columns, _start(first, float(seconds[0])))


def _sections(text: str) -> tuple[str, dict[str, list[tuple[int, str]]]]:
    """First line, and the lines of each section with their numbers; blank lines count in [channel units] alone."""
    lines = text.splitlines()
    sections: dict[str, list[tuple[int, str]]] = {}
    name = ""
    for number, line in enumerate(lines, 1):
        found = re.fullmatch(r"\s*\[([\w ]{1,40})\]\s*", line)
        if found:
            name = found[1].strip().lower()
            sections.setdefault(name, [])
        elif name and (line.strip() or name == "channel units"):
            sections[name].append((number, line.strip()))
    return (lines[0] if lines else ""), sections


def _values(path: str, data: list[tuple[int, str]], names: list[str]) -> Array:
    rows = [(number, line.split()) for number, line in data]
    for number, cells in rows:
        if len(cells) != len(names):
            raise LogError(
                f"{path}: line {number}: has {len(cells)} values, but there are {len(names)} columns"
            )
    out = np.empty((len(rows), len(names)))
    for row, (_, cells) in enumerate(rows):
        for k, cell in enumerate(cells):
            out[row, k] = _number(cell)
    return out


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
    found = re.match(r"(vertical )?(?:velocity|vertvel|vert-vel|speed)\s*(kmh|km/h|knots|mph|m/s)?$", lower)
    if found or name.lower() == "velocity":
        unit = _VELOCITY.get((found[2] if found else "") or "kmh", "km/h")
        return "vertical_speed" if found and found[1] else "speed", unit, 1.0
    return name, next(units, ""), 1.0


_DATE: Callable[[str], re.Match[str] | None] = re.compile(r"File created on (\d\d)/(\d\d)/(\d{4})").match


def _start(first: str, seconds: float) -> float:
    found = _DATE(first.strip().lstrip("\ufeff"))
    try:
        day = datetime(int(found[3]), int(found[2]), int(found[1]), tzinfo=UTC) if found else None
    except ValueError:
        day = None
    # the epoch's own day is what stands where no date is known
    return (
        math.nan
        if day is None or day.year <= 1970 or not math.isfinite(seconds)
        else day.timestamp() + seconds
    )
