"""Radar tracks of the [lead] section: their messages, and the signals in them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.mapping import SignalMap, TrackMap
from canid.signals.vehicle.quoting import brief
from canid.signals.vehicle.schema import MAX_TRACKS, LeadSection, SignalEntry
from canid.signals.vehicle.signal_resolution import (
    Mistakes,
    find_message,
    find_signal,
    find_source,
    signal_map,
)
from canid.values.roles import ROLES, Role

# the radar's signals as roles
_TRACK_ROLES = {
    "distance": ROLES["gap"],
    "rate": ROLES["range_rate"],
    "lateral": Role("m", "number", "from the own axis"),
    "angle": Role("rad", "number", "from the own axis, of a radar that reports along the beam"),
    "valid": ROLES["lead_valid"],
    "new": Role("", "bool", "the track names another object"),
    "id": Role("", "state", "which object of a list a report describes"),
}
# names that differ in a number: decimal; hexadecimal behind 0x, in capital letters behind 0X
_RANGE = re.compile(r"([^{}]*)\{(0x|0X|)([0-9A-Fa-f]{1,9})\.\.\2([0-9A-Fa-f]{1,9})\}([^{}]*)")
_DIGITS = {"": "d", "0x": "x", "0X": "X"}
# the measured parts; the others describe the same report
_MEASURED_PARTS = ("distance", "rate")


def resolve_tracks(
    lead: LeadSection, files: Sequence[Dbc], mistakes: Mistakes
) -> tuple[TrackMap, ...] | None:
    """Find the radar tracks that [lead] names.

    Args:
        lead: the section.
        files: the DBC files.
        mistakes: what is wrong is added here.

    Returns:
        One entry per track; None where the lead is given by plain signals.
    """
    entries = {part: getattr(lead, part) for part in _TRACK_ROLES}
    if lead.tracks is None:
        mistakes.errors.extend(
            f"lead.{part}: is a radar track's signal, but lead.tracks is missing"
            for part, entry in entries.items()
            if entry is not None
        )
        return None
    for part, entry in entries.items():
        if entry is None:
            continue
        if entry.bus is not None:
            mistakes.errors.append(
                f"lead.{part}.bus: a track is one message: write bus = {entry.bus} in [lead]"
            )
        if entry.source is not None:
            mistakes.errors.append(
                f"lead.{part}.source: a track is one message: write source = {entry.source} in [lead]"
            )
        if entry.stale is not None and part not in _MEASURED_PARTS:
            mistakes.errors.append(f"lead.{part}.stale: set stale in lead.distance instead")
    absent = [part for part in ("distance", "rate") if entries[part] is None]
    mistakes.errors.extend(f"lead.{part}: is missing; lead.tracks needs it" for part in absent)
    if lead.lateral is not None and lead.angle is not None:
        mistakes.errors.append("lead.angle: lead.lateral gives the side already; remove one of the two")
    named = {"tracks": _names(lead.tracks, "lead.tracks")}
    named |= {
        part: _names(entry.signal, f"lead.{part}") for part, entry in entries.items() if entry is not None
    }
    wrong = [names for names in named.values() if isinstance(names, str)]
    lists = {part: names for part, names in named.items() if not isinstance(names, str)}
    per_track = wrong[0] if wrong else _per_track(lists, lead, files)
    if isinstance(per_track, str):
        mistakes.errors.extend(wrong or [per_track])
        return None
    tracks = []
    warned: Counter[str] = Counter()
    for track in range(len(per_track["tracks"])):
        of_track = Mistakes([], [])
        numbered_entries = {
            part: None if entry is None else entry.of(per_track[part][track])
            for part, entry in entries.items()
        }
        tracks.append(_track(track, per_track["tracks"][track], lead, numbered_entries, files, of_track))
        warned.update(dict.fromkeys(of_track.warnings, 1))
        mistakes.errors.extend(of_track.errors)
        if of_track.errors:
            break  # the other tracks would only repeat it
    for says, n in warned.items():
        key, _, what = says.partition(": ")
        mistakes.warnings.append(f"{key}, {n} tracks: {what}" if n > 1 else says)
    return tuple(track for track in tracks if track is not None) if not absent else None


def track_age(lead: LeadSection) -> float | None:
    """Return the age in s up to which a track's report counts; None: the file does not say."""
    entries = [getattr(lead, part) for part in _MEASURED_PARTS]
    ages = [entry.stale for entry in entries if entry is not None and entry.stale is not None]
    return min(ages, default=None)


def _per_track(
    named: Mapping[str, Sequence[str]], lead: LeadSection, files: Sequence[Dbc]
) -> dict[str, list[str]] | str:
    """The message and the signals of each track, or what is wrong with how many they are.

    One name is that of all. As many signals as messages are one each; but where each message has all of them, it holds as
    many tracks as there are names.
    """
    messages = named["tracks"]
    several = {part: names for part, names in named.items() if part != "tracks" and len(names) > 1}
    counts = {part: len(names) for part, names in several.items()}
    n = max(counts.values(), default=1)
    if len(messages) > 1 and len(set(counts.values())) == 1 and _in_each(messages, several, lead, files):
        order = [(message, k) for message in messages for k in range(n)]
        if len(order) > MAX_TRACKS:
            return f"lead: {len(order):,} tracks; at most {MAX_TRACKS}"
        made = {"tracks": [message for message, _ in order]}
        signals = ((part, names) for part, names in named.items() if part != "tracks")
        return made | {
            part: [names[k if part in several else 0] for _, k in order] for part, names in signals
        }
    if len(messages) > 1:
        counts = {"tracks": len(messages)} | counts
    if len(set(counts.values())) > 1:
        return f"lead: {' and '.join(f'{part} numbers {k}' for part, k in counts.items())}: as many in each"
    n = max(counts.values(), default=1)
    return {part: list(names) * (n if len(names) == 1 else 1) for part, names in named.items()}


def _in_each(
    messages: Sequence[str], several: Mapping[str, Sequence[str]], lead: LeadSection, files: Sequence[Dbc]
) -> bool:
    """Whether each message has all of the signals."""
    names = [name for part in several.values() for name in part]
    if len(set(names)) < len(names) or not names:
        return False
    for message in messages:
        match = find_message(message, lead.bus, files, "")
        if isinstance(match, str) or not {*names} <= {signal.name for signal in match[1].signals}:
            return False
    return True


def _names(patterns: Sequence[str], key: str) -> list[str] | str:
    """List the names that ["TRACK_A_{0..15}"] stands for, or say what is wrong with it."""
    names: list[str] = []
    for pattern in patterns:
        match = _RANGE.fullmatch(pattern)
        if match is None or not (match[2] or (match[3] + match[4]).isdecimal()):
            if "{" in pattern or "}" in pattern:
                return f'{key}: write it as "TRACK_{{0..15}}", not "{brief(pattern)}"'
            names.append(pattern)
            continue
        before, prefix, *ends, after = match.groups()
        first, last = (int(end, 16 if prefix else 10) for end in ends)
        if not first <= last < first + MAX_TRACKS:
            return f'{key}: "{brief(pattern)}" is not a range of 1 to {MAX_TRACKS} tracks'
        # {01..16} keeps its leading zero, as a shell's braces do.
        width = len(ends[0]) if ends[0].startswith("0") else 0
        form = f"0{width}{_DIGITS[prefix]}"
        names += [f"{before}{number:{form}}{after}" for number in range(first, last + 1)]
    return names if len(names) <= MAX_TRACKS else f"{key}: {len(names):,} tracks; at most {MAX_TRACKS}"


def _track(
    track: int,
    name: str,
    lead: LeadSection,
    entries: Mapping[str, SignalEntry | None],
    files: Sequence[Dbc],
    mistakes: Mistakes,
) -> TrackMap | None:
    match = find_message(name, lead.bus, files, "lead.tracks")
    if isinstance(match, str):
        mistakes.errors.append(match)
        return None
    dbc, message = match
    parts: dict[str, SignalMap | None] = {}
    for part, entry in entries.items():
        parts[part] = None
        if entry is None:
            continue
        signal = find_signal(entry.signal, message, f"lead.{part}")
        if isinstance(signal, str):
            mistakes.errors.append(signal)
            continue
        parts[part] = signal_map(entry, message, signal, _TRACK_ROLES[part], f"lead.{part}", mistakes)
    distance, rate = parts["distance"], parts["rate"]
    if distance is None or rate is None:
        return None
    if lead.rate_sign < 0:
        rate = rate._replace(factor=-rate.factor, offset=-rate.offset, low=-rate.high, high=-rate.low)
    return TrackMap(
        track,
        message.name,
        message.id,
        message.extended,
        lead.bus if lead.bus is not None else dbc.bus,
        distance,
        rate,
        parts["lateral"],
        parts["valid"],
        parts["new"],
        find_source(lead.source, message, dbc, "lead", mistakes),
        parts["angle"],
        parts["id"],
    )
