"""A proposal as the text of a vehicle file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path

from canid.analysis.proposal.choice import Choice, Decision, Decisions
from canid.analysis.proposal.gap_limits import gap_limits
from canid.analysis.proposal.name_score import reach
from canid.analysis.proposal.track_groups import TrackPart
from canid.signals.vehicle.database import Dbc, bits_of
from canid.signals.vehicle.units import examples, factor_to
from canid.values.roles import NEEDS, ROLES
from canid.values.shipped_files import SHIPPED, shipped

# in a proposal for car following these are comments: logs of car following rarely have them
LANE_KEEPING_ALONE = {"curvature"}
# limits of what a car does, for signals whose DBC gives no range, in the role's unit
_PLAUSIBLE = {"pedal": (0.0, 100.0), "accel": (-15.0, 15.0), "yaw_rate": (-1.745, 1.745)}
# other candidates that a comment names
_MOST_OTHERS = 3


def vehicle_text(
    paths: Sequence[str | Path],
    files: Sequence[Dbc],
    decisions: Decisions,
    warnings: Sequence[str],
    home: Path,
    log: str | None,
) -> str:
    """Write the TOML.

    Args:
        paths: of the DBC files.
        files: what they hold.
        decisions: from `choice.decide`.
        warnings: of reading the files.
        home: the folder of the vehicle file, for relative paths.
        log: name of the log that was read; None: none was.
    """
    output = output_of(decisions)
    needed = {output, *NEEDS["car_following"]}
    basis = (
        f"names, units and the log {plain(log)}"
        if log
        else "names and units alone: check every line before you trust it"
    )
    lines = [
        f"# Proposed from {basis},",
        "# then run `canid check --vehicle THIS_FILE LOG`.",
        *(f"# {plain(warning)}" for warning in warnings),
        f"name = {quoted(Path(paths[0]).stem)}",
        "# Paths are relative to this file; { file = ..., bus = 1 } binds one to a bus.",
        f"dbc = [{_dbc(paths, decisions, home)}]",
        "",
        '[signals]  # role = "MESSAGE.SIGNAL"; the unit is the DBC\'s and is converted',
        "# range_rate: positive = opening (lead minus own speed);",
        "# if yours is the closing speed: scale = -1",
        "",
    ]
    by_tracks = decisions.tracks is not None and not decisions.tracks.unknown
    for role, decision in decisions.roles.items():
        if by_tracks and role in ("gap", "range_rate", "lead_valid", "lead_speed"):
            continue
        text = role_lines(decision, role in needed, decisions)
        lines += [f"# {line}  # lane keeping" for line in text] if role in LANE_KEEPING_ALONE else text
    lines += ["", *_lead(decisions), "[driver]", 'task = "car_following"', f'output = "{output}"']
    if output == "accel":
        lines += [
            "# If you know how the acceleration was smoothed, state it: K and the delays are then the driver's.",
            '# output_filter = { kind = "savitzky_golay", width = 1.1 }',
        ]
    return "\n".join(lines) + "\n"


def output_of(decisions: Decisions) -> str:
    """Whose output is identified: the pedal's, else a commanded or the own acceleration."""
    roles = ("pedal", "accel_command", "accel")
    chosen = {role: choice for role in roles if (choice := decisions.roles[role].chosen) is not None}
    known = [role for role, choice in chosen.items() if choice.unit_is_known]
    return next(iter([*known, *chosen]), "pedal")


def missing(decisions: Decisions) -> list[str]:
    """What must be filled in before canid can use the file, a sentence each."""
    said = []
    tracks = decisions.tracks
    for role in dict.fromkeys((output_of(decisions), *NEEDS["car_following"])):
        if role in ("gap", "range_rate") and tracks is not None and not tracks.unknown:
            continue
        decision = decisions.roles[role]
        if decision.made is not None:
            continue
        if decision.chosen is None:
            names = [plain(each.candidate.where) for each in decision.others if each.score >= 1.0][
                :_MOST_OTHERS
            ]
            why = f"candidates: {', '.join(names)}" if names else "nothing of that kind was found"
            said.append(f"{role} is open: {ROLES[role].meaning}; {why}")
        elif not decision.chosen.unit_is_known:
            said.append(f"{role}: fill in the unit of {plain(decision.chosen.candidate.where)}")
    return said


def quoted(text: str) -> str:
    r"""A basic string of TOML, in which names of files are data.

    >>> print(quoted('my "car"\n\x7f.dbc'))
    "my \"car\"\n\u007f.dbc"
    """
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False).replace("\x7f", "\\u007f")


def plain(text: str) -> str:
    r"""Text for a comment, in one line: what cannot be printed is escaped.

    >>> print(plain("m\nname = 1"))
    m\nname = 1
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _dbc(paths: Sequence[str | Path], decisions: Decisions, home: Path) -> str:
    entries = []
    for index, path in enumerate(paths):
        is_shipped = Path(path).parent == shipped() != home
        name = quoted(
            SHIPPED + Path(path).name if is_shipped else Path(os.path.relpath(path, home)).as_posix()
        )
        bus = _file_bus(index, decisions)
        entries.append(name if bus is None else f"{{ file = {name}, bus = {bus} }}")
    return ", ".join(entries)


def _file_bus(index: int, decisions: Decisions) -> int | None:
    """The bus to which a file is bound: only a log with several buses needs it."""
    columns = decisions.columns
    return columns.file_bus[index] if columns is not None and len(columns.buses) > 1 else None


def role_lines(decision: Decision, needed: bool, decisions: Decisions) -> list[str]:
    """The lines of one role: an entry with what speaks for it, or a comment that says what to fill in."""
    role, chosen = decision.role, decision.chosen
    if decision.made is not None:
        made = f"{role} = {decision.made.entry}  # {plain('; '.join(decision.made.says))}"
        return [made, *_others(decision)]
    if chosen is None:
        return _open_lines(decision, needed)
    unit_missing = not chosen.unit_is_known
    if unit_missing and not needed:
        unit = plain(chosen.candidate.signal.unit)
        entry = f'# {role} = {{ signal = {quoted(chosen.candidate.where)}, unit = "" }}'
        return [f'{entry}  # the DBC says "{unit}": fill in its unit']
    entry = f"{role} = {entry_text(chosen, decisions)}"
    lines = [f"{entry}  # {plain('; '.join(_remarks(decision)))}"]
    return lines + _others(decision)


def entry_text(chosen: Choice, decisions: Decisions) -> str:
    """The value of one entry: a text where the DBC says all, else a table."""
    candidate = chosen.candidate
    parts = [f"signal = {quoted(candidate.where)}"]
    wanted = ROLES[candidate.role].unit
    if wanted and (not candidate.unit or factor_to(candidate.signal.unit, wanted) is None):
        parts.append(f"unit = {quoted(candidate.unit)}")
    if candidate.scale != 1.0:
        parts.append(f"scale = {candidate.scale:.6g}")
    if candidate.on is not None:
        parts.append(
            f"on = [{', '.join(f'{raw * candidate.signal.scale + candidate.signal.offset:g}' for raw in candidate.on)}]"
        )
    parts += _valid(chosen) or _valid_gap(chosen, decisions)
    if (
        candidate.bus is not None
        and candidate.bus != _file_bus(candidate.file, decisions)
        and decisions.columns
        and len(decisions.columns.buses) > 1
    ):
        parts.append(f"bus = {candidate.bus}")
    return quoted(candidate.where) if len(parts) == 1 else f"{{ {', '.join(parts)} }}"


def _valid(chosen: Choice) -> list[str]:
    """Limits where the DBC gives none, or gives them in raw numbers, and the bits reach far beyond what a car does."""
    candidate = chosen.candidate
    limits = _PLAUSIBLE.get(candidate.role)
    if limits is None or not candidate.unit:
        return []
    signal = candidate.signal
    to_role = factor_to(candidate.unit, ROLES[candidate.role].unit) or 1.0
    if (
        candidate.role == "pedal"
        and signal.maximum is not None
        and chosen.high > signal.maximum * candidate.scale * to_role + 1.0
    ):
        # the readings leave the DBC's range, by which they would be left out
        return [f"valid = [0, {limits[1] / to_role:g}]"]
    factor = to_role * candidate.scale
    low, high = (end * factor for end in reach(signal))
    stated = signal.minimum is not None and signal.maximum is not None and signal.minimum < signal.maximum
    ends = signal.scale * 2**signal.length + signal.offset
    if stated and signal.maximum is not None and signal.maximum <= max(ends, 1.0):
        return []
    if max(low, high) > 1.1 * limits[1] and math.isfinite(factor):
        top = limits[1] / abs(factor) * abs(candidate.scale)
        bottom = limits[0] / abs(factor) * abs(candidate.scale)
        return [f"valid = [{bottom:.3g}, {top:.3g}]"]
    return []


def _valid_gap(chosen: Choice, decisions: Decisions) -> list[str]:
    """Limits without what stands for no vehicle ahead in the log."""
    candidate, speed, columns = chosen.candidate, decisions.roles["speed"].chosen, decisions.columns
    if candidate.role != "gap" or not candidate.unit or chosen.values is None or columns is None:
        return []
    if speed is None or speed.values is None or not speed.unit_is_known:
        return []
    signal, to_role = candidate.signal, factor_to(candidate.unit, ROLES["gap"].unit) or 1.0
    factor = to_role * candidate.scale
    low, high = sorted((raw * signal.scale + signal.offset) * factor for raw in bits_of(signal).reach)
    limits = gap_limits(columns.t, chosen.values, speed.values, (low, high), abs(signal.scale * factor))
    return [] if limits is None else [f"valid = [{limits[0] / to_role:.6g}, {limits[1] / to_role:.6g}]"]


def _remarks(decision: Decision) -> list[str]:
    chosen = decision.chosen
    assert chosen is not None
    unit = ROLES[decision.role].unit
    said: list[str] = []
    if not chosen.unit_is_known:
        said.append(
            f'FILL IN its unit, one of {examples(unit)}: the DBC says "{chosen.candidate.signal.unit}"'
        )
    elif unit:
        said.append(f'"{chosen.candidate.signal.unit}"')
    if math.isfinite(chosen.low) and unit and chosen.unit_is_known:
        said.append(f"{chosen.low:.4g} to {chosen.high:.4g} {unit} in the log")
    said += chosen.remarks
    if decision.asked:
        said.append("you chose it")
    elif decision.state == "close":
        said.append("taken as the first of several: check it")
    return said or [decision.state]


def _others(decision: Decision) -> list[str]:
    others = [each.candidate.where for each in decision.others if each.score >= 1.0][:_MOST_OTHERS]
    return [f"#   or: {', '.join(map(plain, others))}"] if others else []


def _open_lines(decision: Decision, needed: bool) -> list[str]:
    role = decision.role
    names = [plain(each.candidate.where) for each in decision.others if each.score >= 1.0]
    missing = "".join(
        f"; {where}: {', '.join(map(plain, names[:_MOST_OTHERS]))}"
        for where, names in (
            ("not in the log", decision.absent),
            ("in the log, never with a value", decision.empty),
        )
        if names
    )
    if names:
        word = "needed" if needed else "open"
        shown = f"{{ signal = {quoted(decision.others[0].candidate.where)} }}"
        lines = [
            f"# {role} = {shown}  # {word}: {ROLES[role].meaning}. Candidates, none of them clear{missing}:"
        ]
        return lines + [
            f"#   {name}{_why(each)}" for name, each in zip(names[:5], decision.others, strict=False)
        ]
    if needed:
        return [f'# {role} = "MESSAGE.SIGNAL"  # not found, but needed: {ROLES[role].meaning}{missing}']
    return [f"# {role}: in the DBC{missing}"] if missing else []


def _why(each: Choice) -> str:
    said = [f'"{plain(each.candidate.signal.unit)}"', *map(plain, each.remarks)]
    return f"  ({'; '.join(said)})"


def _lead(decisions: Decisions) -> list[str]:
    tracks = decisions.tracks
    if tracks is None:
        return []
    lines = ["[lead]  # the lead is chosen among the radar's tracks", f"tracks = {quoted(tracks.pattern)}"]
    for part, track_part in tracks.parts.items():
        value = _track_signal(track_part)
        if part in tracks.unknown:
            value = f'{{ signal = {value}, unit = "", scale = 1 }}  # FILL IN its unit, and its scale where a step is not 1'
        elif track_part.on:
            states = ", ".join(f"{state:g}" for state in track_part.on)
            value = f"{{ signal = {value}, on = [{states}] }}  # by its value table"
        elif track_part.why:
            value = f"{{ {', '.join(_scaled(track_part))} }}  # {plain(track_part.why)}"
        elif track_part.unit is not None:
            value = f"{{ signal = {value}, unit = {quoted(track_part.unit)} }}  # no unit in the DBC; its range fits"
        lines.append(f"{part} = {value}")
    if decisions.track_rate_sign < 0:
        lines.append("rate_sign = -1  # closing speed, by the change of the distances in the log")
    bus = decisions.track_bus
    if (
        bus is not None
        and bus != _file_bus(tracks.file, decisions)
        and decisions.columns
        and len(decisions.columns.buses) > 1
    ):
        lines.append(f"bus = {bus}")
    if tracks.unknown:
        lines = [f"# {line}" for line in lines]
    return [*lines, ""]


def _scaled(track_part: TrackPart) -> list[str]:
    """The entry of a track's signal whose unit and scale a log showed."""
    valid = (
        [] if track_part.valid is None else [f"valid = [{track_part.valid[0]:g}, {track_part.valid[1]:g}]"]
    )
    return [
        f"signal = {_track_signal(track_part)}",
        f'unit = "{track_part.unit}"',
        f"scale = {track_part.scale:g}",
        *valid,
    ]


def _track_signal(track_part: TrackPart) -> str:
    """A track's signal: one name or pattern for all, or a name for each."""
    names = ", ".join(map(quoted, track_part.names))
    return f"[{names}]" if names else quoted(track_part.signal)
