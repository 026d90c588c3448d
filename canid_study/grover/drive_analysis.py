"""One drive: its episodes, his method on the longest of them, and the joint fit; one picklable function of a log."""

from __future__ import annotations

from typing import NamedTuple

from canid.signals.signal_checks import drive_time
from canid.values.output_role import output_role
from canid.values.types import NAN, DriveTime, Interval, Trace
from canid_study.artifact import Skipped
from canid_study.grover import episodes, input_correlation, joint, unscented
from canid_study.grover.episode_analysis import Analysis, analyse
from canid_study.grover.episodes import Episode, Route
from canid_study.grover.input_correlation import Cost
from canid_study.grover.joint import Joint
from canid_study.grover.settings import GroverSettings
from canid_study.grover.unscented import SecondOpinion
from canid_study.printed_numbers import SELECTION_PERCENT

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
        >>> analysis = drive_of("x", canid.read_trace("replay_logs/following_urban.blf", "generic"), GroverSettings())
        >>> analysis.output, len(analysis.analyses) > 0
        ('pedal', True)
    """
    selected = episodes.episodes_of(trace, settings)
    skipped = list(episodes.skipped_of(log, selected))
    role = output_role(trace) or "output"
    time = drive_time.of_trace(trace)
    nothing = SecondOpinion((Interval(), Interval()), "no episode")
    none = DriveAnalysis(
        log, role, time, selected.episodes, (), Joint({}, (), NAN), NAN, None, nothing,
        episodes.route(trace), selected.too_short, tuple(skipped),
    )  # fmt: skip
    if not selected.episodes:
        return none
    whole = joint.of_drive(trace)
    chosen = sorted(
        sorted(selected.episodes, key=lambda e: (-e.length, e.first))[: settings.max_fitted],
        key=lambda e: e.first,
    )
    analyses = []
    for episode in chosen:
        following = selected.episodes[episode.number] if episode.number < len(selected.episodes) else None
        analysis = analyse(trace, episode, following, whole, settings)
        what = f"episode {episode.number}"
        if isinstance(analysis, str):
            skipped.append(Skipped(log, what, analysis))
        elif (worst := min(p.model.fit_percent for p in analysis.inputs)) < settings.gate_fit:
            why = f"a transfer function fits {worst:.0f} %, below the gate of {settings.gate_fit:g} %"
            skipped.append(Skipped(log, what, why))
        else:
            analyses.append(analysis)
    return none._replace(
        analyses=tuple(analyses),
        joint=whole,
        speed_fit=joint.with_speed(trace),
        cost=input_correlation.of_drive(trace, selected.episodes, whole, SELECTION_PERCENT, settings),
        second=unscented.of_drive(trace, chosen),
        skipped=tuple(skipped),
    )


def unit_of(role: str) -> str:
    """Unit of an output.

    >>> unit_of("pedal"), unit_of("output")
    ('%', 'its unit')
    """
    return UNITS.get(role, "its unit")
