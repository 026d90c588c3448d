"""Choice of a signal for each role: sure, close (worth a question) or open."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from canid.analysis.proposal import log_columns, log_evidence
from canid.analysis.proposal.log_columns import LogColumns
from canid.analysis.proposal.log_evidence import Seen
from canid.analysis.proposal.made_roles import MadeRole, range_rate_of_others, speed_of_wheels
from canid.analysis.proposal.name_patterns import POSSIBLE, STRONG, USUAL
from canid.analysis.proposal.name_score import Candidate, candidates
from canid.analysis.proposal.signal_agreement import References, correlation, moves, slope
from canid.analysis.proposal.track_groups import TrackGroup, track_groups
from canid.analysis.proposal.track_scale import scaled
from canid.analysis.proposal.wheel_reference import speed_reference, wheel_reference, wheel_signals
from canid.signals.vehicle.database import Dbc
from canid.values.roles import ROLES
from canid.values.types import Array

# points: a usual name with a fitting unit, or a strong name alone
SURE = 6.0
# below it a name is no more than similar
CLOSE = 3.0
# points by which the first must lead where the second may be another quantity: half a unit
MARGIN = 1.5
# `--yes` takes a first that is not sure where it leads by more than a message's context and a coarse resolution together
TAKEN_SCORE, TAKEN_MARGIN = 5.0, 2.5
# names this strong mean one quantity, so that two of them are copies of it
_COPY_POINTS = STRONG - 1.0
# gap and range rate of one message are one sensor's
_SAME_MESSAGE = 1.0
# messages of one name but for their numbers that are a radar's tracks
_MANY = 4
# points of a range rate whose message holds no gap
_ALONE = -4.0
# candidates of a role that are compared with the log
_MOST_SEEN = 10
# roles in the order in which each helps to judge the next
ORDER = (
    "speed", "accel", "steering_angle", "pedal", "gap", "range_rate", "lead_valid", "lead_speed",
    "cruise_active", "brake", *(role for role in ROLES),
)  # fmt: skip
# what is said of a role whose names say little, where there is no log
_BY_NAME_ALONE = {"steering_assist": ("by its name alone, a guess: a log shows more",)}
# roles about which a person is asked; without the others canid works
ASKED = ("pedal", "speed", "gap", "range_rate", "brake", "cruise_active")

State = Literal["sure", "close", "open"]
# asks which of several candidates is the role's; its index, or None for none of them
Ask = Callable[[str, Sequence["Choice"]], int | None]


class Choice(NamedTuple):
    """A candidate with what the log shows of it."""

    candidate: Candidate
    score: float  # of names, and with a log of names and log
    log_points: float = 0.0
    remarks: tuple[str, ...] = ()
    values: Array | None = None  # on the log's raster, in the role's unit
    low: float = float("nan")
    high: float = float("nan")
    rate: float = 0.0  # frames in a second

    @property
    def unit_is_known(self) -> bool:
        """Whether values can be converted to the role's unit."""
        wanted = ROLES[self.candidate.role].unit
        return not wanted or bool(self.candidate.unit)


class Decision(NamedTuple):
    """What a role ends as."""

    role: str
    state: State
    chosen: Choice | None  # written; None: nothing is
    others: tuple[Choice, ...]  # the next best
    absent: tuple[str, ...] = ()  # candidates that the log does not have
    empty: tuple[str, ...] = ()  # candidates whose message is in the log, never with a value
    asked: bool = False
    made: MadeRole | None = None  # of others, where no signal gives it


class Decisions(NamedTuple):
    """All roles, and the radar's tracks."""

    roles: dict[str, Decision]
    tracks: TrackGroup | None
    track_bus: int | None = None
    track_rate_sign: int = 1
    columns: LogColumns | None = None


def decide(files: Sequence[Dbc], columns: LogColumns | None = None, ask: Ask | None = None) -> Decisions:
    """Choose a signal for each role.

    Args:
        files: the DBC files.
        columns: the log, from `log_columns.read`; None: names alone.
        ask: asked where two are close; None: never, as `--yes`.
    """
    wheels = wheel_signals(files, columns)
    known = wheel_reference(wheels)
    roles: dict[str, Decision] = {}
    groups = [group for group in track_groups(files) if columns is None or _reports(group, columns)]
    lists = {(group.file, message.name) for group in groups for message in group.messages}
    rates = _without_tracks(candidates("range_rate", files), lists)
    for role in dict.fromkeys(ORDER):
        proposed = _without_tracks(candidates(role, files), lists)
        if role == "range_rate":
            proposed = _paired(proposed, roles["gap"])
        elif role == "gap":
            proposed = _with_partner(proposed, rates)
        if role == "speed" and columns is not None and known.wheels is None:
            known = speed_reference(proposed, columns)
        decision = _decision(role, proposed, columns, known, ask if role in ASKED else None)
        if role == "speed" and not _usable(decision):
            buses = () if columns is None else columns.buses
            bound = None if columns is None or not wheels else columns.file_bus[wheels[0].file]
            decision = decision._replace(made=speed_of_wheels(wheels, buses, bound))
        roles[role] = decision
        known = _with(known, decision)
    roles = _without_doubles(roles)
    tracks = None
    if groups and not all(_usable(roles[role]) for role in ("gap", "range_rate")):
        tracks = groups[0]
    elif not _usable(roles["range_rate"]):
        rate = range_rate_of_others(roles, known)
        roles["range_rate"] = roles["range_rate"]._replace(made=rate)
    made = Decisions(roles, tracks, None, 1, columns)
    if tracks is None or columns is None:
        return made
    bus = _track_buses(tracks, columns)[0]
    if tracks.unknown:
        return made._replace(tracks=scaled(tracks, bus, columns, known.speed), track_bus=bus)
    return made._replace(track_bus=bus, track_rate_sign=_track_sign(tracks, bus, columns))


def _without_tracks(proposed: list[Candidate], lists: set[tuple[int, str]]) -> list[Candidate]:
    """Leave out the signals of tracks and of numbered messages: each is one of many objects, not the lead."""
    proposed = [each for each in proposed if (each.file, each.message.name) not in lists]
    messages: dict[tuple[int, str], set[str]] = {}
    for each in proposed:
        messages.setdefault(_numbered(each), set()).add(each.message.name)
    return [each for each in proposed if len(messages[_numbered(each)]) < _MANY]


def _numbered(candidate: Candidate) -> tuple[int, str]:
    return candidate.file, re.sub(r"[0-9a-f]*[0-9][0-9a-f]*(?![a-z])", "#", candidate.message.name.lower())


def _usable(decision: Decision) -> bool:
    return decision.chosen is not None and decision.chosen.unit_is_known


def _with(known: References, decision: Decision) -> References:
    """The references, with a role that was decided."""
    chosen = decision.chosen
    if chosen is None or chosen.values is None or not chosen.unit_is_known:
        if decision.role == "speed" and known.wheels is not None and known.wheels_unit:
            return known._replace(speed=known.wheels, accel=slope(known.wheels))
        return known
    values = chosen.values
    if decision.role == "speed":
        return known._replace(speed=values, accel=slope(values))
    if decision.role == "pedal":
        return known._replace(pedal=values)
    if decision.role == "cruise_active":
        return known._replace(cruise=values)
    if decision.role == "steering_angle":
        return known._replace(steering=values)
    if decision.role == "gap":
        return known._replace(gap_rate=slope(values))
    return known


def _with_partner(gaps: list[Candidate], rates: list[Candidate]) -> list[Candidate]:
    """Gaps whose message also carries a range rate are a sensor's, not a display's."""
    partners = {(rate.file, rate.message.name) for rate in rates}
    made = [
        gap._replace(score=gap.score + _SAME_MESSAGE) if (gap.file, gap.message.name) in partners else gap
        for gap in gaps
    ]
    return sorted(made, key=lambda item: -item.score)


def _paired(rates: list[Candidate], gap: Decision) -> list[Candidate]:
    """Range rates by the message of the gap: one that comes alone may be of an object on any side."""
    messages = {gap.chosen.candidate.message.name: 2 * _SAME_MESSAGE} if gap.chosen is not None else {}
    for each in gap.others:
        messages.setdefault(each.candidate.message.name, 0.0)
    made = [rate._replace(score=rate.score + messages.get(rate.message.name, _ALONE)) for rate in rates]
    return sorted(made, key=lambda item: -item.score)


def _decision(
    role: str, proposed: list[Candidate], columns: LogColumns | None, known: References, ask: Ask | None
) -> Decision:
    choices: list[Choice] = []
    absent: list[str] = []
    empty: list[str] = []
    for candidate in proposed[: _MOST_SEEN if columns is not None else None]:
        if columns is None:
            remarks = (*candidate.remarks, *_BY_NAME_ALONE.get(role, ()))
            choices.append(Choice(candidate, candidate.score, 0.0, remarks))
            continue
        bus = log_columns.bus_of(candidate, columns)
        shown = log_evidence.seen(candidate, bus, columns, known) if bus is not None else None
        if shown is None:
            (absent if bus is None else empty).append(candidate.where)
        else:
            choices.append(_choice(shown))
    choices.sort(key=lambda item: (-item.score, -item.rate))
    state, taken = judged(choices)
    chosen = choices[0] if taken else None
    asked = False
    if ask is not None and state == "close":
        index = ask(role, choices[:_MOST_SEEN])
        chosen = None if index is None else choices[index]
        asked = True
    if asked:
        state = "sure" if chosen is not None else "open"
    others = tuple(each for each in choices if each is not chosen)
    return Decision(role, state, chosen, others, tuple(absent), tuple(empty), asked)


def _choice(shown: Seen) -> Choice:
    candidate = shown.candidate
    return Choice(
        candidate,
        candidate.score + shown.points,
        shown.points,
        (*candidate.remarks, *shown.remarks),
        shown.values,
        shown.low,
        shown.high,
        shown.rate,
    )


def judged(choices: Sequence[Choice]) -> tuple[State, bool]:
    """What a role's candidates, the best first, end as; and whether the first is taken where nobody is asked."""
    if not choices or choices[0].score < CLOSE:
        return "open", False
    first = choices[0]
    points = first.candidate.name_points
    # a name that may mean the role is no rival of one that hardly means anything else
    rivals = [each for each in choices[1:] if points < _COPY_POINTS or each.candidate.name_points > POSSIBLE]
    margin = first.score - rivals[0].score if rivals else np.inf
    contradicted = first.log_points < -MARGIN
    if first.score >= SURE and points >= USUAL - 1.0 and not contradicted:
        if margin >= MARGIN:
            return ("close", margin >= TAKEN_MARGIN) if first.candidate.against else ("sure", True)
        return "close", not first.candidate.against and _are_copies(first, rivals[0])
    leads = margin >= TAKEN_MARGIN and points >= USUAL - 1.0
    copied = bool(rivals) and points >= _COPY_POINTS and _are_copies(first, rivals[0])
    taken = first.score >= TAKEN_SCORE and (leads or copied)
    return "close", taken and not contradicted and not first.candidate.against


def _are_copies(first: Choice, second: Choice) -> bool:
    """Whether two names mean one quantity."""
    a, b = first.candidate, second.candidate
    if a.signal.name == b.signal.name:
        return True
    if a.name_points == b.name_points >= USUAL and a.unit == b.unit:
        return True
    strongest, weakest = max(a.name_points, b.name_points), min(a.name_points, b.name_points)
    return strongest >= _COPY_POINTS and weakest >= USUAL


def _without_doubles(roles: dict[str, Decision]) -> dict[str, Decision]:
    """A signal has one role: the first in `ORDER`."""
    taken: set[str] = set()
    made = {}
    for role, decision in roles.items():
        where = decision.chosen.candidate.where if decision.chosen is not None else ""
        if where and where in taken:
            decision = decision._replace(state="open", chosen=None)
        taken.add(where)
        made[role] = decision
    return {role: made[role] for role in ROLES}


def _reports(group: TrackGroup, columns: LogColumns) -> bool:
    """Whether a log has a radar's tracks; a list of which all reports have one id is the lead's own message."""
    buses = _track_buses(group, columns)
    if not buses or "id" not in group.parts:
        return bool(buses)
    message = group.messages[0]
    number = next(signal for signal in message.signals if signal.name == group.parts["id"].signal)
    came = log_columns.column(message, number, buses[0], columns, texts_are_values=True)
    return came is not None and moves(came[0].value)


def _track_buses(group: TrackGroup, columns: LogColumns) -> list[int]:
    buses = [{key.bus for key in log_columns.keys_of(message, columns)} for message in group.messages]
    counts = {bus: sum(bus in on_buses for on_buses in buses) for on_buses in buses for bus in on_buses}
    usual = columns.file_bus[group.file]
    return sorted(counts, key=lambda bus: (-counts[bus], bus != usual))


def _track_sign(group: TrackGroup, bus: int, columns: LogColumns) -> int:
    """Whether the tracks' speed is the change of their distance, or the opposite."""
    total = weight = 0.0
    for message, names in group.tracks:
        signals = {signal.name: signal for signal in message.signals}
        distance = log_columns.column(message, signals[names["distance"]], bus, columns)
        rate = log_columns.column(message, signals[names["rate"]], bus, columns)
        if distance is None or rate is None:
            continue
        change = slope(distance[1])
        change[np.abs(change) > log_evidence.MAX_GAP_RATE] = np.nan
        r, _, n = correlation(change, rate[1])
        if np.isfinite(r):
            total, weight = total + r * n, weight + n
    return -1 if weight and total / weight < -0.5 else 1
