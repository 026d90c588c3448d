"""Radar tracks in DBC files: numbered messages of one or several tracks, lists with ids, numbered signals or pages.

Each track has a distance and a relative speed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from canid.analysis.proposal.name_score import reach
from canid.analysis.proposal.signal_words import dbc_unit, words
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.units import factor_to

# a radar that reports fewer objects than this one by one would not number its messages, or its signals
_MIN_MESSAGES, _MIN_SIGNALS = 3, 4
# a number of a message that may be hexadecimal, such as its id
_HEX = re.compile(r"(?<![0-9A-Za-z])[0-9A-Fa-f]{2,4}(?![0-9A-Za-z])")
_NOT_A_MEASUREMENT = (
    r"\b(rate|std\w*|sigma|var\w*|valid|conf\w*|accel\w*|stat\w*|mode|count\w*|width|length|"
    r"loss|type|prob\w*|rms)\b"
)
# in a message's name: the radar sees another side of the car
_ELSEWHERE = r"\b(corner|side|blind|rear|bsm|bsd|rcta|left|right|sod\w*|f[lr]|r[lr])\b"
_DISTANCE = (
    (
        r"\b(long\w*|lgt) ?(dist|distance|range|pos|position)\b|\b(dist|distance|pos) ?(long\w*|"
        r"x)\b|\bx ?(rel|pos|dist)\b|\bdx\b",
        rf"{_NOT_A_MEASUREMENT}|\blat\w*\b",
    ),
    (r"\b(dist\w*|range|rng)\b", rf"{_NOT_A_MEASUREMENT}|\b(lat\w*|ambig\w*|min|max|med|super|res)\b"),
)
_RATE = (
    (
        r"\brel\w* ?(long\w* |x )?(spd|speed|vel\w*|v)\b|\brange ?rate\b|\brng ?rate\b|\bv ?rel\b|"
        r"\brelv\b|\br ?vel\b|\b(long\w*|lgt) ?(rel\w* )?(spd|speed|vel\w*)\b|\bvx\b|\bv ?x\b",
        r"\b(lat\w*|std\w*|sigma|var\w*|valid|accel\w*|prob\w*|rms|ambig\w*)\b",
    ),
)
_LATERAL = (
    (
        r"\blat\w* ?(dist|distance|pos\w*|offset|disp)\b|\b(dist|pos) ?(lat\w*|y)\b|\by ?(rel|pos|"
        r"dist)\b|\bdy\b",
        r"\b(rate|std\w*|sigma|var\w*|rms|spd|speed|vel\w*|accel\w*|prob\w*)\b",
    ),
)
_ANGLE = (
    (
        r"\b(angle|ang|azimuth\w*|azi?m?|bearing|theta|phi)\b",
        r"\b(rate|std\w*|sigma|var\w*|rms|elev\w*|vert\w*|steer\w*|yaw|prob\w*|err\w*|heading|orient\w*|valid)\b",
    ),
)
_VALID = (
    (
        r"\b(valid|measured|tracked|detection valid|det valid level)\b",
        r"\b(count\w*|level|spd|prob\w*|exist\w*)\b",
    ),
)
# a status whose value table says in which states there is an object that is measured
_STATUS = (
    (r"\b(stat|status|state|meas\w*|valid\w*|flag)\b", r"\b(count\w*|bridge|dyn\w*|mov\w*|prob\w*)\b"),
)
_OBJECT = re.compile(r"\b(target|track\w*|measured|updated?|valid|object|detected|new|ok|confirmed)\b")
_NO_OBJECT = re.compile(
    r"\b(no|not|non|none|in ?valid|coast\w*|merg\w*|predict\w*|lost|deleted|empty|free|error|fault|reserved|unused|sna)\b"
)
# which object of a list a report describes
_ID = re.compile(r"\b(obj\w*|target|tgt|trk|track) ?(id|no|num|number|index|idx)\b|^id$")
_NO_ID = re.compile(r"\b(valid|msg|message|sensor|count\w*)\b")
_ID_BITS = (3, 8)
# in a message's name: it is of one object that was chosen
_CHOSEN = r"\b(acc|aeb|fcw|cipv|lead\w*|clos\w*|primary|select\w*|threat|most)\b"
_NEW = ((r"\bnew\b", r"\b(level|count\w*)\b"),)
_PARTS = {
    "distance": _DISTANCE,
    "rate": _RATE,
    "lateral": _LATERAL,
    "angle": _ANGLE,
    "valid": _VALID,
    "new": _NEW,
}
_UNIT = {"distance": "m", "rate": "m/s", "lateral": "m", "angle": "rad"}
# m, m/s: ends of a signal's range between which it can be what its name says, where the DBC gives no unit
_REACH = {"distance": (40.0, 400.0), "rate": (15.0, 150.0), "lateral": (3.0, 200.0), "angle": (0.1, 1.6)}


class TrackPart(NamedTuple):
    """A signal of each track."""

    signal: str
    unit: str | None  # to be written where the DBC has none; None: its own
    on: tuple[float, ...] = ()  # values of a status that mean an object; (): it is yes or no
    scale: float = 1.0  # by a log
    valid: tuple[float, float] | None = None  # in the unit that is written; beyond it there is no object
    why: str = ""  # what says the unit, where the DBC does not
    names: tuple[str, ...] = ()  # of each track its own; (): `signal` is that of all


class TrackGroup(NamedTuple):
    """Messages that are the tracks of one radar."""

    file: int  # index of the DBC
    pattern: str  # TRACK_A_{0..15}
    messages: tuple[Message, ...]
    parts: dict[str, TrackPart]
    unknown: tuple[str, ...]  # parts whose unit is not known
    # of each track its message, and part -> signal; (): the tracks come under one name, as a list
    tracks: tuple[tuple[Message, dict[str, str]], ...] = ()


def track_groups(files: Sequence[Dbc]) -> list[TrackGroup]:
    """Find the tracks of radars, the most complete first.

    Example:
        >>> signals = [Signal(n, 0, 12, True, True, False, 0.1, 0.0, None, None, u, {}, False, None, ())
        ...            for n, u in (("LONG_DIST", "m"), ("REL_SPEED", "m/s"))]
        >>> messages = {f"T_{i}": Message(f"T_{i}", i, False, 8, 0.05, tuple(signals)) for i in range(5)}
        >>> track_groups([Dbc("radar.dbc", None, messages)])[0].pattern
        'T_{0..4}'
    """
    groups: dict[tuple[int, str, str, str], dict[int, Message]] = {}
    for index, file in enumerate(files):
        for message in file.messages.values():
            for match in _HEX.finditer(message.name):
                before, after = message.name[: match.start()], message.name[match.end() :]
                for prefix, digits in (("0x", match[0].lower()), ("0X", match[0].upper())):
                    if match[0] == digits:
                        groups.setdefault((index, before, after, prefix), {})[int(digits, 16)] = message
            for match in re.finditer(r"\d+", message.name):
                key = (index, message.name[: match.start()], message.name[match.end() :], "")
                if len(match[0]) <= 4:
                    groups.setdefault(key, {})[int(match[0])] = message
    # one of many messages whose names differ in a number is one track, not a list
    many = {
        (key[0], message.name)
        for key, numbered in groups.items()
        if len(_longest_run(numbered)) >= _MIN_MESSAGES
        for message in numbered.values()
    }
    track_lists = [
        made
        for index, file in enumerate(files)
        for message in file.messages.values()
        if (index, message.name) not in many
        and not re.search(_ELSEWHERE, words(message.name))
        and (made := _list(index, message) or _numbered_signals(index, message)) is not None
    ]
    for (index, before, after, prefix), numbered in groups.items():
        run = _longest_run(numbered)
        if len(run) < _MIN_MESSAGES or re.search(_ELSEWHERE, words(f"{before} {after}")):
            continue
        made = _group(index, before, after, prefix, {key: numbered[key] for key in run})
        if made is not None:
            track_lists.append(made)
    return sorted(
        track_lists, key=lambda group: (bool(group.unknown), -len(group.parts), -len(group.messages))
    )


def _number(message: Message, before: str, after: str) -> str:
    return message.name[len(before) : len(message.name) - len(after) or None]


def _longest_run(numbers: Iterable[int]) -> list[int]:
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return max(runs, key=len, default=[])


def _list(index: int, message: Message) -> TrackGroup | None:
    """Objects that come under one id of CAN, each with a number of its own in the frame."""
    number = next(
        (
            signal
            for signal in message.signals
            if _ID_BITS[0] <= signal.length <= _ID_BITS[1]
            and _ID.search(words(signal.name))
            and not _NO_ID.search(words(signal.name))
        ),
        None,
    )
    of_track = _found(message.signals) if number is not None else None
    if number is None or of_track is None or re.search(_CHOSEN, words(message.name)):
        return None
    # any object may be at the side
    if not {"lateral", "angle"} & set(of_track[0]):
        return None
    parts, unknown = of_track
    return TrackGroup(index, message.name, (message,), parts | {"id": TrackPart(number.name, None)}, unknown)


def _numbered_signals(index: int, message: Message) -> TrackGroup | None:
    """Objects whose signals are numbered in one message, side by side or on its pages."""
    stems = _stems(message.signals)
    runs = {stem: _longest_run(numbered) for stem, numbered in stems.items()}
    longest = max(runs.values(), key=len, default=[])
    if len(longest) < _MIN_SIGNALS:
        return None
    stem_of = {stems[stem][longest[0]].name: stem for stem, run in runs.items() if run == longest}
    of_track = _found([stems[stem][longest[0]] for stem in stem_of.values()])
    if of_track is None:
        return None
    parts, unknown = of_track
    tracks = tuple(
        (message, {part: stems[stem_of[track_part.signal]][k].name for part, track_part in parts.items()})
        for k in longest
    )
    named = {
        part: track_part._replace(
            signal=f"{stem_of[track_part.signal][0]}{{{longest[0]}..{longest[-1]}}}{stem_of[track_part.signal][1]}"
        )
        for part, track_part in parts.items()
    }
    return TrackGroup(index, message.name, (message,), named, unknown, tracks)


def _stems(signals: Sequence[Signal]) -> dict[tuple[str, str], dict[int, Signal]]:
    """Signals whose names differ in one number: what stands before and behind it -> number -> signal."""
    stems: dict[tuple[str, str], dict[int, Signal]] = {}
    for signal in signals:
        match = re.fullmatch(r"(\D*)(\d{1,3})(\D*)", signal.name)
        if match is not None and (match[2] == "0" or not match[2].startswith("0")):
            stems.setdefault((match[1], match[3]), {})[int(match[2])] = signal
    return stems


def _group(
    index: int, before: str, after: str, prefix: str, numbered: dict[int, Message]
) -> TrackGroup | None:
    messages = list(numbered.values())
    # names may differ from message to message, and the first may have the odd one
    for message in messages:
        names = _names_in_all(numbered, message)
        of_track = _found([signal for signal in message.signals if signal.name in names])
        if of_track is not None:
            break
    else:
        return None
    parts, unknown = of_track
    first, last = _number(messages[0], before, after), _number(messages[-1], before, after)
    if first.startswith("0") and len(first) != len(last) and first != "0":
        return None
    if "{" in before + after or "}" in before + after:
        return None
    pattern = f"{before}{{{prefix}{first}..{prefix}{last}}}{after}"
    if prefix and (len(first) != len(last) or all(_number(m, before, after).isdecimal() for m in messages)):
        return None
    several = _several_in_each(message, names, parts)
    if several is not None:
        parts, of_each = several
        tracks = tuple((each, of_one) for each in messages for of_one in of_each)
        return TrackGroup(index, pattern, tuple(messages), parts, unknown, tracks)
    tracks = tuple(
        (message, {part: names[track_part.signal][1][k] for part, track_part in parts.items()})
        for k, message in enumerate(messages)
    )
    parts = {part: _written(track_part, *names[track_part.signal]) for part, track_part in parts.items()}
    return TrackGroup(index, pattern, tuple(messages), parts, unknown, tracks)


def _written(track_part: TrackPart, written: str, names: tuple[str, ...]) -> TrackPart:
    """A part as a vehicle file names it."""
    return track_part._replace(signal=written) if written else track_part._replace(names=names)


def _names_in_all(numbered: dict[int, Message], model: Message) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Signals of a message that all have: by name, by a name with their own number, or by place and scale.

    Returns:
        name in the message -> how all are written ("FLRRTrk{1..20}Range"; "": one by one), and the name in each.
    """
    in_each = [{signal.name for signal in message.signals} for message in numbered.values()]
    places = [{_place(signal): signal.name for signal in message.signals} for message in numbered.values()]
    numbers = list(numbered)
    out: dict[str, tuple[str, tuple[str, ...]]] = {}
    for signal in model.signals:
        name = signal.name
        if all(name in names for names in in_each):
            out[name] = name, (name,) * len(in_each)
            continue
        for match in re.finditer(r"\d+", name):
            width = len(match[0]) if match[0].startswith("0") else 1
            written_names = tuple(
                f"{name[: match.start()]}{number:0{width}d}{name[match.end() :]}" for number in numbers
            )
            if name in written_names and all(
                own_name in names for own_name, names in zip(written_names, in_each, strict=True)
            ):
                written = f"{{{numbers[0]:0{width}d}..{numbers[-1]:0{width}d}}}"
                out[name] = f"{name[: match.start()]}{written}{name[match.end() :]}", written_names
                break
        else:
            if all(_place(signal) in of_message for of_message in places):
                out[name] = "", tuple(of_message[_place(signal)] for of_message in places)
    return out


def _place(signal: Signal) -> tuple[object, ...]:
    """Where a signal lies and what its numbers are."""
    return (
        signal.start, signal.length, signal.motorola, signal.signed, signal.scale, signal.offset, signal.unit,
    )  # fmt: skip


def _several_in_each(
    message: Message, names: dict[str, tuple[str, tuple[str, ...]]], parts: dict[str, TrackPart]
) -> tuple[dict[str, TrackPart], list[dict[str, str]]] | None:
    """The parts and the tracks of messages that hold several each, in signals that are numbered; None: they hold one."""
    stems = _stems([signal for signal in message.signals if names.get(signal.name, ("",))[0] == signal.name])
    stem_of = {signal.name: stem for stem, numbered in stems.items() for signal in numbered.values()}
    runs = {
        part: _longest_run(stems[stem_of[track_part.signal]])
        for part, track_part in parts.items()
        if track_part.signal in stem_of
    }
    run = runs.get("distance", [])
    if len(run) < 2 or runs.get("rate") != run:
        return None
    numbers = f"{{{run[0]}..{run[-1]}}}"
    made: dict[str, TrackPart] = {}
    tracks: list[dict[str, str]] = [{} for _ in run]
    for part, track_part in parts.items():
        if part in runs and runs[part] != run:
            continue
        before, after = stem_of[track_part.signal] if part in runs else ("", "")
        written = f"{before}{numbers}{after}" if part in runs else track_part.signal
        made[part] = track_part._replace(signal=written)
        for track, number in zip(tracks, run, strict=True):
            track[part] = f"{before}{number}{after}" if part in runs else track_part.signal
    return made, tracks


def _found(present: Sequence[Signal]) -> tuple[dict[str, TrackPart], tuple[str, ...]] | None:
    """The parts of a track among its signals, and those whose unit is not known; None: they are no track."""
    parts: dict[str, TrackPart] = {}
    unknown: list[str] = []
    for part, patterns in _PARTS.items():
        signal = _first(patterns, present, part)
        if signal is None and part == "valid":
            status = _status(present)
            if status is not None:
                parts[part] = status
            continue
        if signal is None or (part == "angle" and "lateral" in parts):
            continue
        unit, known = _unit(part, signal, parts)
        if not known:
            unknown.append(part)
        parts[part] = TrackPart(signal.name, unit)
    if not {"distance", "rate"} <= set(parts):
        return None
    if "distance" not in unknown and "rate" not in unknown:
        # without a side the lead is weaker, with a wrong one it is none
        parts = {part: track_part for part, track_part in parts.items() if part not in unknown}
        unknown = []
    return parts, tuple(unknown)


def _first(patterns: Sequence[tuple[str, str]], signals: Sequence[Signal], part: str) -> Signal | None:
    for pattern, excluded in patterns:
        for signal in signals:
            name = words(signal.name)
            wide = signal.length >= 6 if part in _UNIT else signal.length <= 2
            if wide and re.search(pattern, name) and not re.search(excluded, name):
                unit = dbc_unit(signal.unit)
                if part not in _UNIT or not unit or factor_to(unit, _UNIT[part]) is not None:
                    return signal
    return None


def _status(signals: Sequence[Signal]) -> TrackPart | None:
    """A status that says by its value table whether there is an object."""
    for pattern, excluded in _STATUS:
        for signal in signals:
            name = words(signal.name)
            if not signal.choices or not re.search(pattern, name) or re.search(excluded, name):
                continue
            texts = {value: words(text) for value, text in signal.meanings.items()}
            on = [
                value for value, text in texts.items() if _OBJECT.search(text) and not _NO_OBJECT.search(text)
            ]
            if on and len(on) < len(texts):
                return TrackPart(signal.name, None, tuple(sorted(on)))
    return None


def _unit(part: str, signal: Signal, parts: dict[str, TrackPart]) -> tuple[str | None, bool]:
    """The unit to write (None: the DBC's), and whether it is known."""
    if part not in _UNIT:
        return None, True
    unit = dbc_unit(signal.unit)
    if unit:
        return (None if factor_to(signal.unit, _UNIT[part]) is not None else unit), True
    low, high = reach(signal)
    least, most = _REACH[part]
    fits = least <= max(abs(low), abs(high)) <= most and abs(signal.scale) < 0.5
    return _UNIT[part], fits
