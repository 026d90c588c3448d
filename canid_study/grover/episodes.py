"""Car-following episodes (Grover 2021, sec. 4.1): one lead, a person at the pedal, no brake, nothing missing."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from canid.signals.signal_checks.drive_time import usable
from canid.values.runs import runs
from canid.values.types import NAN, Array, LearnGate, Trace
from canid_study.artifact import Skipped
from canid_study.grover.settings import DEFAULTS, GroverSettings

# share of the input's power below the stated frequency
BAND_SHARE = 0.95
# s, m/s, and of the output's own unit: a signal that moves less is constant to the resolution of any sensor
CONSTANT_SD = 1e-6
INPUTS = ("headway_error", "range_rate")


class Episode(NamedTuple):
    """A stretch of a drive as [first, stop) samples, and what moves in it."""

    number: int  # from 1, in time
    first: int
    stop: int
    t: float  # s, start
    length: float  # s
    headway: float  # s, mean; NaN: not measured
    speed: float  # m/s, mean
    correlation: float  # of headway error and range rate
    band: tuple[float, float]  # Hz, per input: the frequency below which BAND_SHARE of its power lies
    sd: tuple[float, float, float]  # of headway error s, range rate m/s, output
    east: float = NAN  # m from the drive's first position, at the start
    north: float = NAN

    @property
    def part(self) -> slice:
        """The samples."""
        return slice(self.first, self.stop)


class Found(NamedTuple):
    """The episodes of a drive and what is not among them."""

    episodes: tuple[Episode, ...]
    skipped: tuple[tuple[str, str], ...]  # what, why
    too_short: int  # stretches below the least length
    longest: float  # s, of the stretches


class Route(NamedTuple):
    """Positions of a drive, (n,) m east and north of the first one."""

    east: Array
    north: Array


def episodes_of(trace: Trace, settings: GroverSettings = DEFAULTS) -> Found:
    """Find the episodes of a drive.

    Args:
        trace: of car following, any output.
        settings: least and largest length.

    Returns:
        In time; what was left out and why.

    Example:
        >>> import canid
        >>> selected = episodes_of(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> all(e.length >= 20.0 for e in selected.episodes)
        True
    """
    if trace.input_names != INPUTS:
        names = ", ".join(trace.input_names)
        why = f"its inputs are {names}, not headway error and range rate: set [driver] task = car_following"
        return Found((), (("the whole log", why),), 0, 0.0)
    known = np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    ready = usable(trace) & known
    stretches = []
    for first, stop in runs(ready):
        cuts = 1 + first + np.flatnonzero(np.diff(trace.segment[first:stop]))
        stretches += list(zip([first, *cuts.tolist()], [*cuts.tolist(), stop], strict=True))
    lengths = [(stop - first) * trace.dt for first, stop in stretches]
    long = [s for s, length in zip(stretches, lengths, strict=True) if length >= settings.min_episode - 1e-9]
    position = route(trace)
    episodes: list[Episode] = []
    skipped: list[tuple[str, str]] = []
    for first, stop in [piece for s in long for piece in _pieces(*s, trace.dt, settings)]:
        episode = _episode(trace, position, len(episodes) + 1, first, stop)
        constant = [
            name for name, sd in zip((*INPUTS, "output"), episode.sd, strict=True) if sd <= CONSTANT_SD
        ]
        if constant:
            what = f"{episode.t:.0f} to {episode.t + episode.length:.0f} s"
            names = ", ".join(name.replace("_", " ") for name in constant)
            skipped.append((what, f"{names} is constant: nothing responds to it"))
        else:
            episodes.append(episode)
    if not long:
        skipped.append(("the whole log", _nothing(trace, settings, max(lengths, default=0.0))))
    return Found(tuple(episodes), tuple(skipped), len(stretches) - len(long), max(lengths, default=0.0))


def route(trace: Trace) -> Route | None:
    """Position of a drive, from east and north or from latitude and longitude; None: none is recorded.

    Example:
        >>> import canid
        >>> at = route(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> at.east.shape == at.north.shape
        True
    """
    east, north = trace.signals.get("east"), trace.signals.get("north")
    if east is None or north is None or not np.isfinite(east + north).any():
        lat, lon = trace.signals.get("lat"), trace.signals.get("lon")
        if lat is None or lon is None or not np.isfinite(lat + lon).any():
            return None
        # metres per degree of latitude on the mean sphere
        north = lat * 111_195.0
        east = lon * 111_195.0 * np.cos(np.radians(np.nanmean(lat)))
    known = np.isfinite(east + north)
    begin = int(np.argmax(known))
    return Route(east - east[begin], north - north[begin])


def _pieces(first: int, stop: int, dt: float, settings: GroverSettings) -> list[tuple[int, int]]:
    """Cut a stretch into equal episodes of at most the largest length."""
    most = max(settings.max_episode, settings.min_episode) / dt
    count = max(int(np.ceil((stop - first) / most)), 1)
    # a cut that made pieces below the least length is not made
    if (stop - first) * dt / count < settings.min_episode:
        count = max(int((stop - first) * dt / settings.min_episode), 1)
    edges = np.linspace(first, stop, count + 1).round().astype(int).tolist()
    return list(pairwise(edges))


def _episode(trace: Trace, position: Route | None, number: int, first: int, stop: int) -> Episode:
    part = slice(first, stop)
    inputs, output = trace.inputs[part], trace.output[part]
    sd = (float(inputs[:, 0].std()), float(inputs[:, 1].std()), float(output.std()))
    both = min(sd[:2]) > CONSTANT_SD
    return Episode(
        number,
        first,
        stop,
        float(trace.t[first]),
        (stop - first) * trace.dt,
        _mean(trace, "headway", part),
        _mean(trace, "speed", part),
        correlation(inputs[:, 0], inputs[:, 1]) if both else NAN,
        (band(inputs[:, 0], trace.dt), band(inputs[:, 1], trace.dt)),
        sd,
        NAN if position is None else float(position.east[first]),
        NAN if position is None else float(position.north[first]),
    )


def _mean(trace: Trace, role: str, part: slice) -> float:
    column = trace.signals.get(role)
    known = np.zeros(0) if column is None else column[part][np.isfinite(column[part])]
    return float(known.mean()) if known.size else NAN


def correlation(x: Array, y: Array) -> float:
    """Pearson's correlation; NaN where one is constant.

    >>> round(correlation(np.array([1.0, 2.0, 3.0]), np.array([2.0, 4.0, 6.0])), 9)
    1.0
    """
    a, b = x - x.mean(), y - y.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else NAN


def band(x: Array, dt: float) -> float:
    """Frequency below which BAND_SHARE of the power lies, Hz.

    Args:
        x: (n,).
        dt: s.

    Example:
        >>> t = np.arange(600) * 0.1
        >>> round(band(np.sin(2 * np.pi * 0.5 * t), 0.1), 2)
        0.5
    """
    power = np.abs(np.fft.rfft(detrended(x))) ** 2
    total = float(power.sum())
    if total <= 0.0:
        return NAN
    return float(np.fft.rfftfreq(len(x), dt)[int(np.searchsorted(np.cumsum(power), BAND_SHARE * total))])


def detrended(x: Array) -> Array:
    """Take the least-squares line off each column (sec. 4.2).

    Args:
        x: (n,) or (n, m).

    Example:
        >>> bool(np.allclose(detrended(np.arange(5.0)), 0.0))
        True
    """
    if len(x) < 2:
        return np.zeros_like(x)
    line = np.column_stack([np.ones(len(x)), np.linspace(-1.0, 1.0, len(x))])
    out: Array = x - line @ np.linalg.lstsq(line, x, rcond=None)[0]
    return out


def _nothing(trace: Trace, settings: GroverSettings, longest: float) -> str:
    """Why a drive has no episode, and what to do."""
    least = f"no {settings.min_episode:g} s of following one lead with the pedal and without the brake"
    counts: dict[LearnGate, int] = {}
    for gate in trace.gate:
        if gate is not LearnGate.OPEN:
            counts[gate] = counts.get(gate, 0) + 1
    withheld = [finding.says for finding in trace.findings if finding.withholds]
    if withheld:
        return f"{least}: {withheld[0]}"
    if not counts:
        return f"{least}: the longest stretch lasts {longest:.0f} s; drive longer behind one lead"
    gate, count = max(counts.items(), key=lambda pair: pair[1])
    why = f"{gate.value} ({100.0 * count / max(len(trace.gate), 1):.0f} % of the drive)"
    return f"{least}: the longest stretch lasts {longest:.0f} s; {why}"


def skipped_of(log: str, selected: Found) -> tuple[Skipped, ...]:
    """What is not among the episodes, for the study's list."""
    return tuple(Skipped(log, what, why) for what, why in selected.skipped)
