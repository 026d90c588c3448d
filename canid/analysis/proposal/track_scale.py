"""Scale and unit of a radar's tracks by a log: what stands still comes closer at the own speed.

The rate's scale is that of the distance's change. Of many approaches those of standing objects have one ratio of closing
speed to own speed; of oncoming vehicles every approach has another, but the closing speed changes as the own speed does,
whose changes they do not know of. The angle's scale follows from the side on which
objects are passed, which is known to a factor of 1.6 alone: enough to distinguish the own lane from the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.proposal import log_columns
from canid.analysis.proposal.log_columns import LogColumns
from canid.analysis.proposal.track_groups import TrackGroup, TrackPart
from canid.signals.dbc_text.parsing import Message
from canid.signals.vehicle.bits import Bools
from canid.values.runs import runs
from canid.values.types import Array

# s over which the change of a distance is taken: a quantisation of 0.1 m is small in it for what comes closer
_SPAN_S = 0.5
# m/s; slower than this the quantisation of speed and distance counts
_MIN_SPEED = 5.0
# share by which distance and rate may disagree in one object's approach; beyond it the track names another object
_SAME_RATE = 0.15
# s that an approach lasts, and the standard deviation of the logarithm of its ratio: what stands still has one ratio
_MIN_APPROACH_S, _STEADY = 1.0, 0.05
# half the width of a cluster of ratios, in logarithms; approaches that make one; how many times as many as the next one
_CLUSTER, _MIN_APPROACHES, _CLEAR = 0.012, 5, 1.5
# relative standard error with which the changes of the own speed must show in those of the closing speed
_MOST_ERROR = 0.02
# by so much the own speed must vary among the approaches: else an oncoming vehicle of one speed has one ratio, too
_SPEED_RATIO = 1.1
# share of the reports in which a track without an object repeats one value
_IDLE_SHARE = 0.1
# scales that people choose: powers of two and decimal ones, m or m/s; km/h is tried besides
_ROUND = tuple(
    sorted({2.0**-k for k in range(9)} | {d * 10.0**-k for d in (1, 2, 2.5, 4, 5) for k in (1, 2, 3)})
)
_ROUND_SHARE = 0.04
_MEASURED = ("distance", "rate", "angle")
_RATE_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6}
# m: range of a radar within which a scale is believed
_RANGE_M = (40.0, 400.0)
# m to the side at which objects are passed, as a median: the oncoming lane 3.5, guard rails 2 to 4, signs 4 to 8
_PASSED_M = 4.5


class TrackScale(NamedTuple):
    """What the DBC does not say of a radar's tracks."""

    distance: float  # m for one unit of the DBC
    rate: float  # m/s for one unit, or km/h as `rate_unit` says
    rate_unit: str
    closing: bool  # the rate is positive where the gap closes
    angle: float  # ° for one unit; NaN: not known
    nothing: float  # distance in the DBC's unit that a track without an object reports; NaN: none
    says: str


class _Report(NamedTuple):
    """A track's reports, in the DBC's units; NaN: no object."""

    t: Array
    distance: Array
    rate: Array
    angle: Array


class _Approach(NamedTuple):
    """One object that comes closer."""

    ratio: float  # closing speed to own speed, DBC's unit of distance for one m
    speed: float  # m/s, own
    side: float  # median of distance times angle; NaN: not known
    together: float  # sum of the changes of own speed times those of closing speed, from their means
    own: float  # sum of the squared changes of own speed


def scaled(tracks: TrackGroup, bus: int, columns: LogColumns, speed: Array | None) -> TrackGroup:
    """Tracks with the units and scales that a log shows; as they are where it shows none.

    Args:
        tracks: of which the DBC leaves out units.
        bus: on which the log has them.
        columns: the log.
        speed: own speed on its raster, m/s.
    """
    empty = TrackPart("", None)
    distance, rate, angle = (tracks.parts.get(part, empty) for part in ("distance", "rate", "angle"))
    scale = track_scale(tracks.tracks, bus, columns, speed)
    # an angle of unknown scale does not separate the own lane from the next
    if scale is None or ("angle" in tracks.unknown and scale.angle != scale.angle):
        return tracks
    parts = dict(tracks.parts)
    made = {
        "distance": distance._replace(unit="m", scale=scale.distance, valid=_valid(scale)),
        "rate": rate._replace(unit=scale.rate_unit, scale=-scale.rate if scale.closing else scale.rate),
        "angle": angle._replace(unit="deg", scale=scale.angle),
    }
    parts |= {
        part: track_part._replace(why=scale.says)
        for part, track_part in made.items()
        if part in tracks.unknown
    }
    if "angle" in tracks.unknown:
        why = f"as passed objects lie {_PASSED_M:g} m aside: sure to a factor of 1.6; its sign is open"
        parts["angle"] = parts["angle"]._replace(why=why)
    left = tuple(part for part in tracks.unknown if part not in made)
    return tracks._replace(parts=parts, unknown=left)


def _valid(scale: TrackScale) -> tuple[float, float] | None:
    """Distances of objects, without the one that means that there is none."""
    if scale.nothing != scale.nothing:
        return None
    none = scale.nothing * scale.distance
    return (0.0, none - scale.distance) if none > _RANGE_M[0] else None


def track_scale(
    tracks: Sequence[tuple[Message, dict[str, str]]], bus: int, columns: LogColumns, speed: Array | None
) -> TrackScale | None:
    """Find the scales; None where the log does not decide them.

    Args:
        tracks: of each its message, and part ("distance", "rate", "angle") -> name of its signal.
        bus: of the tracks.
        columns: the log.
        speed: own speed on its raster, m/s.
    """
    if speed is None:
        return None
    reports = [report for m, names in tracks if (report := _reports(m, names, bus, columns)) is not None]
    if not reports:
        return None
    nothing = _nothing(reports)
    reports = [_without(report, nothing) for report in reports]
    spans = [_spans(report) for report in reports]
    share = _rate_share(spans)
    if share is None:
        return None
    approaches = [
        each for span in spans for each in _approaches(span, share, np.interp(span.t, columns.t, speed))
    ]
    ratio, says = _standing(approaches)
    if not ratio:
        ratio, says = _changing(approaches)
    if not ratio:
        return None
    distance = _round(1.0 / ratio)
    highest = float(np.nanmax(np.concatenate([report.distance for report in reports]))) * distance
    if not _RANGE_M[0] <= highest <= _RANGE_M[1]:
        return None
    unit, rate = _rate(distance * abs(share))
    sides = [abs(each.side) for each in approaches if each.ratio > 0.9 * ratio and each.side == each.side]
    angle = math.nan
    if len(sides) >= _MIN_APPROACHES and (middle := float(np.median(sides))) > 0.0:
        angle = float(f"{math.degrees(_PASSED_M / (middle * distance)):.2g}")
    return TrackScale(distance, rate, unit, share < 0.0, angle, nothing, says)


def _reports(message: Message, signals: dict[str, str], bus: int, columns: LogColumns) -> _Report | None:
    by_name = {signal.name: signal for signal in message.signals}
    measured = {}
    for part, name in signals.items():
        if part not in _MEASURED:
            continue
        came = log_columns.column(message, by_name[name], bus, columns)
        if came is not None:
            measured[part] = came[0]
    if (
        not {"distance", "rate"} <= measured.keys()
        or len({len(column.t) for column in measured.values()}) != 1
    ):
        return None
    none = np.full(len(measured["distance"].t), np.nan)
    angle = measured["angle"].value if "angle" in measured else none
    return _Report(measured["distance"].t, measured["distance"].value, measured["rate"].value, angle)


def _nothing(reports: Sequence[_Report]) -> float:
    """The distance that tracks repeat most, at an end of what they report: no object."""
    every = np.concatenate([report.distance for report in reports])
    every = every[np.isfinite(every)]
    if not every.size:
        return math.nan
    values, counts = np.unique(every, return_counts=True)
    most = int(np.argmax(counts))
    at_end = most in (0, len(values) - 1)
    return float(values[most]) if at_end and counts[most] > _IDLE_SHARE * every.size else math.nan


def _without(report: _Report, nothing: float) -> _Report:
    distance = np.where(report.distance == nothing, np.nan, report.distance)
    return report._replace(distance=distance)


def _spans(report: _Report) -> _Report:
    """Change of the distance over half a second, with the mean rate and the place in its middle."""
    period = float(np.median(np.diff(report.t))) if len(report.t) > 1 else math.inf
    n = max(round(_SPAN_S / period), 1) if period > 0.0 else 0
    if not n or len(report.t) <= 2 * n:
        nothing = np.zeros(0)
        return _Report(nothing, nothing, nothing, nothing)
    dt = report.t[n:] - report.t[:-n]
    change = np.where(dt < 2 * _SPAN_S, (report.distance[n:] - report.distance[:-n]) / dt, np.nan)
    rate = 0.5 * (report.rate[n:] + report.rate[:-n])
    near = 0.5 * (report.distance[n:] + report.distance[:-n])
    side = near * 0.5 * (report.angle[n:] + report.angle[:-n])
    # "distance" is now its change, "rate" the rate; distance times angle stands in the place of the angle
    return _Report(0.5 * (report.t[n:] + report.t[:-n]), change, rate, np.where(near > 0.0, side, np.nan))


def _rate_share(spans: Sequence[_Report]) -> float | None:
    """Change of the distance for one unit of rate, with its sign: the median of where the rate is large."""
    change = np.concatenate([span.distance for span in spans])
    rate = np.concatenate([span.rate for span in spans])
    known = np.isfinite(change) & np.isfinite(rate)
    if known.sum() < 100:
        return None
    large = known & (np.abs(rate) >= np.percentile(np.abs(rate[known]), 80)) & (rate != 0.0)
    if large.sum() < 20:
        return None
    share = change[large] / rate[large]
    middle = float(np.median(share))
    if middle == 0.0 or np.mean(np.abs(share / middle - 1.0) < _SAME_RATE) < 0.5:
        return None
    return middle


def _approaches(span: _Report, share: float, speed: Array) -> list[_Approach]:
    """Stretches in which one object comes closer, at a speed that is proportional to the own."""
    with np.errstate(invalid="ignore"):
        wanted = share * span.rate
        good: Bools = (span.distance < 0.0) & (np.abs(span.distance - wanted) <= _SAME_RATE * np.abs(wanted))
        good &= speed > _MIN_SPEED
    approaches = []
    for begin, end in runs(good):
        if span.t[end - 1] - span.t[begin] < _MIN_APPROACH_S:
            continue
        part = slice(begin, end)
        ratios = np.log(-span.distance[part] / speed[part])
        if float(np.std(ratios)) > _STEADY:
            continue
        sides = span.angle[part]
        side = float(np.nanmedian(sides)) if np.isfinite(sides).any() else math.nan
        own_speed = speed[part] - np.mean(speed[part])
        together = float(-wanted[part] @ own_speed)
        ratio = float(np.exp(np.median(ratios)))
        approaches.append(
            _Approach(ratio, float(np.mean(speed[part])), side, together, float(own_speed @ own_speed))
        )
    return approaches


def _standing(approaches: Sequence[_Approach]) -> tuple[float, str]:
    """The ratio that most approaches have, and why; 0: none stands out, or the own speed is the same in all of them."""
    if len(approaches) < _MIN_APPROACHES:
        return 0.0, ""
    logs = np.log([each.ratio for each in approaches])
    near = np.abs(logs[:, None] - logs[None, :]) < _CLUSTER
    counts = near.sum(axis=1)
    best = int(np.argmax(counts))
    members = near[best]
    others = np.abs(logs - logs[best]) > 2 * _CLUSTER
    next_one = int((near & others[:, None] & others[None, :]).sum(axis=1).max(initial=0))
    speeds = np.array([each.speed for each in approaches])[members]
    if counts[best] < max(_MIN_APPROACHES, _CLEAR * next_one) or speeds.max() < _SPEED_RATIO * speeds.min():
        return 0.0, ""
    return float(np.exp(np.median(logs[members]))), f"by {counts[best]} objects that stand still in the log"


def _changing(approaches: Sequence[_Approach]) -> tuple[float, str]:
    """Change of the closing speed for one m/s of own speed within the approaches, and why; 0: not precise enough."""
    if len(approaches) < 2 * _MIN_APPROACHES:
        return 0.0, ""
    together = np.array([each.together for each in approaches])
    own_squares = np.array([each.own for each in approaches])
    if not own_squares.sum() > 0.0:
        return 0.0, ""
    ratio = float(together.sum() / own_squares.sum())
    error = float(np.sqrt(((together - ratio * own_squares) ** 2).sum()) / own_squares.sum())
    if not ratio > 0.0 or error > _MOST_ERROR * ratio:
        return 0.0, ""
    return ratio, f"by {len(approaches)} objects that come closer in the log"


def _round(scale: float) -> float:
    """The round number next to a scale, where one is near; else three digits of it."""
    nearest = min(_ROUND, key=lambda each: abs(math.log(each / scale)))
    return nearest if abs(math.log(nearest / scale)) < _ROUND_SHARE else float(f"{scale:.3g}")


def _rate(scale: float) -> tuple[str, float]:
    """The unit in which a rate's scale, in m/s, is nearest to a round number; and that."""
    unit = min(
        _RATE_UNITS,
        key=lambda name: min(abs(math.log(each * _RATE_UNITS[name] / scale)) for each in _ROUND),
    )
    near_ms = min(abs(math.log(each / scale)) for each in _ROUND)
    if near_ms < _ROUND_SHARE / 2:
        unit = "m/s"
    return unit, _round(scale / _RATE_UNITS[unit])
