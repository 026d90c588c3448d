"""Radar tracks in DBC files: numbered messages that all carry a distance and a relative speed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from canid.parsing import Message, Signal
from canid.proposal.name_score import reach
from canid.proposal.signal_words import dbc_unit, words
from canid.vehicle.database import Dbc
from canid.vehicle.units import factor_to

# a radar that reports fewer objects than this one by one would not number its messages
_MIN_TRACKS = 4
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
        r"\brelv\b|\b(long\w*|lgt) ?(rel\w* )?(spd|speed|vel\w*)\b|\bvx\b|\bv ?x\b",
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
_VALID = (
    (
        r"\b(valid|measured|tracked|detection valid|det valid level)\b",
        r"\b(count\w*|level|spd|prob\w*|exist\w*)\b",
    ),
)
_NEW = ((r"\bnew\b", r"\b(level|count\w*)\b"),)
_PARTS = {"distance": _DISTANCE, "rate": _RATE, "lateral": _LATERAL, "valid": _VALID, "new": _NEW}
_UNIT = {"distance": "m", "rate": "m/s", "lateral": "m"}
# m, m/s: ends of a signal's range between which it can be what its name says, where the DBC gives no unit
_REACH = {"distance": (40.0, 400.0), "rate": (15.0, 150.0), "lateral": (3.0, 200.0)}


class TrackPart(NamedTuple):
    """A signal of each track."""

    signal: str
    unit: str | None  # to be written where the DBC has none; None: its own
    scale: float = 1.0


class TrackGroup(NamedTuple):
    """Messages that are the tracks of one radar."""

    file: int  # index of the DBC
    pattern: str  # TRACK_A_{0..15}
    messages: tuple[Message, ...]
    parts: dict[str, TrackPart]
    unknown: tuple[str, ...]  # parts whose unit is not known


def track_groups(files: Sequence[Dbc]) -> list[TrackGroup]:
    """Find the tracks of radars, the most complete first.

    Example:
        >>> signals = [Signal(n, 0, 12, True, True, False, 0.1, 0.0, None, None, u, {}, False, None, ())
        ...            for n, u in (("LONG_DIST", "m"), ("REL_SPEED", "m/s"))]
        >>> messages = {f"T_{i}": Message(f"T_{i}", i, False, 8, 0.05, tuple(signals)) for i in range(5)}
        >>> track_groups([Dbc("radar.dbc", None, messages)])[0].pattern
        'T_{0..4}'
    """
    groups: dict[tuple[int, str, str], dict[int, Message]] = {}
    for index, file in enumerate(files):
        for message in file.messages.values():
            for match in re.finditer(r"\d+", message.name):
                key = (index, message.name[: match.start()], message.name[match.end() :])
                if len(match[0]) <= 4:
                    groups.setdefault(key, {})[_key(match[0])] = message
    found = []
    for (index, before, after), numbered in groups.items():
        run = _longest_run(numbered)
        if len(run) < _MIN_TRACKS or re.search(_ELSEWHERE, words(f"{before} {after}")):
            continue
        made = _group(index, before, after, [numbered[key] for key in run])
        if made is not None:
            found.append(made)
    return sorted(found, key=lambda of: (bool(of.unknown), -len(of.parts), -len(of.messages)))


def _key(digits: str) -> int:
    return int(digits)


def _longest_run(numbers: dict[int, Message]) -> list[int]:
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return max(runs, key=len, default=[])


def _group(index: int, before: str, after: str, messages: list[Message]) -> TrackGroup | None:
    shared = set.intersection(*[{signal.name for signal in message.signals} for message in messages])
    parts: dict[str, TrackPart] = {}
    unknown = []
    for part, patterns in _PARTS.items():
        signal = _first(patterns, [signal for signal in messages[0].signals if signal.name in shared], part)
        if signal is None:
            continue
        unit, known = _unit(part, signal, parts)
        if not known and part == "lateral":
            continue
        if not known:
            unknown.append(part)
        parts[part] = TrackPart(signal.name, unit)
    if not {"distance", "rate"} <= set(parts):
        return None
    first = messages[0].name[len(before) : len(messages[0].name) - len(after) or None]
    last = messages[-1].name[len(before) : len(messages[-1].name) - len(after) or None]
    if first.startswith("0") and len(first) != len(last) and first != "0":
        return None
    if "{" in before + after or "}" in before + after:
        return None
    return TrackGroup(index, f"{before}{{{first}..{last}}}{after}", tuple(messages), parts, tuple(unknown))


def _first(patterns: Sequence[tuple[str, str]], signals: Sequence[Signal], part: str) -> Signal | None:
    for found, excluded in patterns:
        for signal in signals:
            name = words(signal.name)
            wide = signal.length >= 6 if part in _UNIT else signal.length <= 2
            if wide and re.search(found, name) and not re.search(excluded, name):
                unit = dbc_unit(signal.unit)
                if part not in _UNIT or not unit or factor_to(unit, _UNIT[part]) is not None:
                    return signal
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
