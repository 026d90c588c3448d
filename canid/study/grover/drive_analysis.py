"""One drive: its episodes, his method on the longest of them, and the joint fit; one picklable function of a log."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.signal_checks import drive_time
from canid.study.artifact import Skipped
from canid.study.grover import episodes, input_correlation, joint, unscented
from canid.study.grover.episode_analysis import Analysis, analyse
from canid.study.grover.episodes import Episode, Route
from canid.study.grover.input_correlation import Cost
from canid.study.grover.joint import Joint
from canid.study.grover.settings import GroverSettings
from canid.study.grover.unscented import SecondOpinion
from canid.study.prints.printed_numbers import SELECTION_PERCENT
from canid.types import NAN, DriveTime, Interval, Trace

# samples between two points of a map: 1 s at 10 Hz
MAP_EVERY = 10


class DriveAnalysis(NamedTuple):
    """All of one drive. Without episodes the rest is empty."""

    log: str
    output: str  # role: "pedal", "accel"
    time: DriveTime
    episodes: tuple[Episode, ...]
    analyses: tuple[Analysis, ...]  # of the longest episodes, in time
    joint: Joint
    speed_fit: float  # %, of the joint model with speed times the headway error, eq. 2.1
    cost: Cost | None
    second: SecondOpinion
    route: Route | None
    too_short: int  # stretches below the least length
    skipped: tuple[Skipped, ...]


# units by role; of others none is stated
UNITS = {"pedal": "%", "accel": "m/s²", "accel_command": "m/s²"}


def drive_of(log: str, trace: Trace, settings: GroverSettings) -> DriveAnalysis:
    """Analyse a drive.

    Args:
        log: its name.
        trace: of it.
        settings: of the study.

    Example:
        >>> import canid
        >>> found = drive_of("x", canid.read_trace("replay_logs/following_urban.blf", "generic"), GroverSettings())
        >>> found.output, len(found.analyses) > 0
        ('pedal', True)
    """
    found = episodes.episodes_of(trace, settings)
    skipped = list(episodes.skipped_of(log, found))
    role = output_role(trace)
    time = drive_time.of_trace(trace)
    nothing = SecondOpinion((Interval(), Interval()), 0, "no episode")
    none = DriveAnalysis(
        log, role, time, found.episodes, (), Joint({}, (), NAN), NAN, None, nothing,
        episodes.route(trace), found.too_short, tuple(skipped),
    )  # fmt: skip
    if not found.episodes:
        return none
    whole = joint.of_drive(trace)
    chosen = sorted(
        sorted(found.episodes, key=lambda e: (-e.length, e.first))[: settings.max_fitted],
        key=lambda e: e.first,
    )
    analyses = []
    for episode in chosen:
        following = found.episodes[episode.number] if episode.number < len(found.episodes) else None
        one = analyse(trace, episode, following, whole, settings)
        what = f"episode {episode.number}"
        if isinstance(one, str):
            skipped.append(Skipped(log, what, one))
        elif (worst := min(p.model.fit_percent for p in one.inputs)) < settings.gate_fit:
            why = f"a transfer function fits {worst:.0f} %, below the gate of {settings.gate_fit:g} %"
            skipped.append(Skipped(log, what, why))
        else:
            analyses.append(one)
    return none._replace(
        analyses=tuple(analyses),
        joint=whole,
        speed_fit=joint.with_speed(trace),
        cost=input_correlation.of_drive(trace, found.episodes, whole, SELECTION_PERCENT, settings),
        second=unscented.of_drive(trace, chosen),
        skipped=tuple(skipped),
    )


def output_role(trace: Trace) -> str:
    """Which signal the driver's output is: "pedal", "accel", ...; "output": none of those recorded.

    Example:
        >>> import canid
        >>> output_role(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        'pedal'
    """
    known = np.isfinite(trace.output)
    for role in ("pedal", "accel", "accel_command", *sorted(trace.signals)):
        column = trace.signals.get(role)
        if column is not None and known.any() and np.array_equal(column[known], trace.output[known]):
            return role
    return "output"


def unit_of(role: str) -> str:
    """Unit of an output.

    >>> unit_of("pedal"), unit_of("output")
    ('%', 'its unit')
    """
    return UNITS.get(role, "its unit")
