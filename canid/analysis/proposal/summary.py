"""What `init` found, a line a role: how sure, which signal, its range in the log, and why; or what would decide it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from canid.analysis.proposal.choice import Decision, Decisions
from canid.analysis.proposal.vehicle_text import LANE_KEEPING_ALONE, output_of, plain
from canid.values.roles import NEEDS, ROLES

# candidates of an open role that are named
_MOST_CANDIDATES = 3
# remarks on a signal: the file has the others
_MOST_REMARKS = 2
# roles that a radar's tracks give
_OF_TRACKS = ("gap", "range_rate", "lead_valid", "lead_speed")


def summary(decisions: Decisions) -> list[str]:
    """List the roles that were found, and the needed ones that are open.

    Example:
        >>> open_role = Decision("pedal", "open", None, ())
        >>> roles = {role: open_role._replace(role=role) for role in ROLES}
        >>> summary(Decisions(roles, None))[0]
        'pedal           open   nothing of that kind was found: name its signal, or one more DBC file'
    """
    tracks = decisions.tracks
    by_tracks = tracks is not None and not tracks.unknown
    needed = dict.fromkeys((output_of(decisions), *NEEDS["car_following"]))
    lines = []
    for role in dict.fromkeys((*needed, *decisions.roles)):
        decision = decisions.roles[role]
        if (by_tracks and role in _OF_TRACKS) or role in LANE_KEEPING_ALONE:
            continue
        if decision.chosen is not None or decision.made is not None or role in needed:
            lines.append(f"{role:15} {'; '.join(_says(decision))}")
    if tracks is not None:
        how = f"fill in the unit (and scale) of {' and '.join(tracks.unknown)}" if tracks.unknown else "found"
        parts = ", ".join(f"{part} {plain(shown.signal)}" for part, shown in tracks.parts.items())
        by_log = any(shown.why for shown in tracks.parts.values())
        if by_log:
            how = f"scales by the log ({next(shown.why for shown in tracks.parts.values() if shown.why)}); found"
        state = "open " if tracks.unknown else "check" if by_log else "sure "
        lines.append(f"{'lead':15} {state}  {plain(tracks.pattern)}: {parts}; {how} among the radar's tracks")
    return lines


def _says(decision: Decision) -> Iterator[str]:
    chosen = decision.chosen
    if decision.made is not None:
        yield f"made   {plain(decision.made.entry)}"
        yield from map(plain, decision.made.says)
        return
    if chosen is None:
        names = [plain(each.candidate.where) for each in decision.others if each.score >= 1.0]
        if names:
            yield f"open   one of {', '.join(names[:_MOST_CANDIDATES])}"
            yield "a log in which it moves decides, or you: write it into the file"
        else:
            yield "open   nothing of that kind was found: name its signal, or one more DBC file"
        return
    state = "sure " if decision.state == "sure" else "check"
    yield f"{state}  {plain(chosen.candidate.where)}"
    if not chosen.unit_is_known:
        yield "its unit is not known: fill in unit, or scale"
    elif math.isfinite(chosen.low) and ROLES[decision.role].unit:
        yield f"{chosen.low:.4g} to {chosen.high:.4g} {ROLES[decision.role].unit} in the log"
    yield from map(plain, chosen.remarks[:_MOST_REMARKS])
