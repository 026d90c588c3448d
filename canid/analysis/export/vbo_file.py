"""VBOX .vbo, Racelogic's text format: positions in minutes, longitude positive to the west, CRLF.

Format: https://en.racelogic.support/VBOX_Automotive/Knowledge_Base/VBO_File_Format
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import IO

import numpy as np

from canid.analysis.export import names
from canid.analysis.export.drive_tables import unit_of
from canid.analysis.export.table import Origin
from canid.values.errors import ConfigError
from canid.values.terminal_text import terminal_text
from canid.values.types import Array, Trace

# The format has no "not known"; programs take fewer than three or four satellites for no position.
SATELLITES = 8
# m; a course over less than this is noise of the position
COURSE_M = 0.5
# m per degree of latitude, on the sphere of the same volume as the earth: good to 0.5 %, and only for the course
M_PER_DEG = 111_195.0
# title in [header], short name in [column names]
_STANDARD = (
    ("satellites", "sats"),
    ("time", "time"),
    ("latitude", "lat"),
    ("longitude", "long"),
    ("velocity kmh", "velocity"),
    ("heading", "heading"),
    ("height", "height"),
)
_IN_STANDARD = {"lat", "lon", "speed", "altitude"}


def check(roles: set[str], vehicle: str) -> None:
    """Refuse a vehicle without positions.

    Raises:
        ConfigError: with what is to be mapped.
    """
    absent = [role for role in ("lat", "lon") if role not in roles]
    if absent:
        raise ConfigError(
            f"{vehicle}: a .vbo needs positions, and {' and '.join(absent)} {'is' if len(absent) == 1 else 'are'} not "
            f"mapped; map lat and lon (deg) in the vehicle file, or export another format"
        )


def write(file: IO[bytes], trace: Trace, origin: Origin) -> tuple[int, list[str]]:
    """Write the file: rows of the samples that have a position.

    Time is UTC since midnight; since the log's first frame where it states no date. Velocity is that of the role speed, or
    gnss_speed. Heading is the course over the ground. What was not measured in another channel is NaN.

    Returns:
        how many rows, and the names of the columns.

    Raises:
        ConfigError: no sample has a position.
    """
    here = np.isfinite(trace.signals["lat"]) & np.isfinite(trace.signals["lon"])
    if not here.any():
        raise ConfigError(f"{origin.log}: lat and lon never came together: there is no position to write")
    t = trace.t[here]
    signals = {role: values[here] for role, values in trace.signals.items()}
    extra = [role for role in signals if role not in _IN_STANDARD]
    texts = [terminal_text(role) for role in extra]
    start = origin.start_ns or 0
    created = datetime.fromtimestamp(start // 1_000_000_000, UTC)
    header = [
        f"File created on {created:%d/%m/%Y} at {created:%H:%M:%S}",
        "",
        "[header]",
        *(title for title, _ in _STANDARD),
        *texts,
        "",
        "[channel units]",
        *(unit_of(role) for role in extra),
        "",
        "[comments]",
        f"{origin.program} export of {terminal_text(origin.log)}",
        f"vehicle : {terminal_text(origin.vehicle)}",
        f"Log Rate (Hz) : {1.0 / trace.dt:05.2f}",
        f"the number of satellites is not known: {SATELLITES} is written",
    ]
    if origin.start_ns is None:
        header.append("the log states no date: time and date count from zero")
    standard = [name for _, name in _STANDARD]
    columns = [*standard, *names.unique(texts, names.matlab_name, standard)]
    header += ["", "[column names]", " ".join(columns), "", "[data]"]
    file.write("".join(f"{line}\r\n" for line in header).encode("utf-8", "backslashreplace"))
    lat, lon = signals["lat"], signals["lon"]
    velocity = next((signals[role] for role in ("speed", "gnss_speed") if role in signals), np.zeros(len(t)))
    height = signals.get("altitude", np.zeros(len(t)))
    # ms of the day, UTC
    ms = (np.rint(t * 1e3).astype(np.int64) + round(start / 1e6)) % 86_400_000
    rows = zip(
        ms.tolist(),
        (lat * 60.0).tolist(),
        (lon * -60.0).tolist(),
        (velocity * 3.6).tolist(),
        course(lat, lon).tolist(),
        height.tolist(),
        *(signals[role].tolist() for role in extra),
        strict=True,
    )
    file.write("".join(_row(*row) for row in rows).encode("ascii"))
    return len(t), columns


def _row(
    ms: int, lat: float, lon: float, velocity: float, heading: float, height: float, *extra: float
) -> str:
    s = ms // 1000
    time = f"{s // 3600:02d}{s // 60 % 60:02d}{s % 60:02d}.{ms % 1000:03d}"
    standard = f"{SATELLITES:03d} {time} {lat:+015.8f} {lon:+015.8f} {velocity:07.3f} {heading:06.2f} {height:+09.2f}"
    return " ".join([standard, *(f"{x:+.9E}" if x == x else "NaN" for x in extra)]) + "\r\n"


def course(lat: Array, lon: Array) -> Array:
    """Course over the ground in degrees clockwise from north; that of the last movement at rest.

    Example:
        >>> course(np.array([47.0, 47.0, 47.001, 47.0]), np.array([16.0, 16.001, 16.001, 16.001])).tolist()
        [90.0, 90.0, 0.0, 180.0]
    """
    out = np.full(len(lat), np.nan)
    narrower = np.cos(np.radians(lat))  # m of east per m of north, of a degree
    heading, k = np.nan, 0
    for n in range(1, len(lat)):
        north = (lat[n] - lat[k]) * M_PER_DEG
        # the shorter way around the earth
        east = ((lon[n] - lon[k] + 180.0) % 360.0 - 180.0) * M_PER_DEG * narrower[n]
        if np.hypot(north, east) >= COURSE_M:
            heading, k = float(np.degrees(np.arctan2(east, north))) % 360.0, n
        out[n] = heading
    moving = np.flatnonzero(np.isfinite(out))
    if not moving.size:
        return np.zeros(len(lat))
    out[: moving[0]] = out[moving[0]]
    return out
