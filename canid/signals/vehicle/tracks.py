"""Radar tracks of the [lead] section: their messages, and the signals in them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.mapping import SignalMap, TrackMap
from canid.signals.vehicle.quoting import brief
from canid.signals.vehicle.schema import LeadSection, SignalEntry
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
# the measured parts; the others describe the same report
_MEASURED_PARTS = ("distance", "rate")
# A radar follows some ten to a hundred objects; a typing mistake such as {0..1500000} must not take for ever.
_MAX_TRACKS = 256


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
    numbered = {part: len(names) for part, names in named.items() if len(names) > 1}
    if not wrong and len(set(numbered.values())) > 1:
        wrong = [
            f"lead: {' and '.join(f'{part} numbers {n}' for part, n in numbered.items())}: as many in each"
        ]
    if wrong:
        mistakes.errors.extend(wrong)
        return None
    tracks = []
    warned: Counter[str] = Counter()
    for track in range(max(numbered.values(), default=1)):
        of_track = Mistakes([], [])
        numbered_entries = {
            part: None if entry is None else entry.model_copy(update={"signal": _of(named[part], track)})
            for part, entry in entries.items()
        }
        tracks.append(_track(track, _of(named["tracks"], track), lead, numbered_entries, files, of_track))
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


def _of(names: Sequence[str], track: int) -> str:
    """The name of a track; one without a number is that of all."""
    return names[track] if len(names) > 1 else names[0]


def _names(pattern: str, key: str) -> list[str] | str:
    """List the names that "TRACK_A_{0..15}" stands for, or say what is wrong with it."""
    match = re.fullmatch(r"([^{}]*)\{(\d{1,9})\.\.(\d{1,9})\}([^{}]*)", pattern)
    if match is None:
        if "{" in pattern or "}" in pattern:
            return f'{key}: write it as "TRACK_{{0..15}}", not "{brief(pattern)}"'
        return [pattern]
    before, first, last, after = match.groups()
    if not int(first) <= int(last) < int(first) + _MAX_TRACKS:
        return f'{key}: "{brief(pattern)}" is not a range of 1 to {_MAX_TRACKS} tracks'
    # {01..16} keeps its leading zero, as a shell's braces do.
    width = len(first) if first.startswith("0") else 0
    return [f"{before}{number:0{width}d}{after}" for number in range(int(first), int(last) + 1)]


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
