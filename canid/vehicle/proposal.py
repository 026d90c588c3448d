"""Proposal of a vehicle file for DBC files, by the names and units of their signals."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from canid.parsing import Parser, Signal
from canid.vehicle.database import MAX_DBC_BYTES, Dbc, load
from canid.vehicle.roles import NEEDS, ROLES
from canid.vehicle.signal_name_patterns import NAME_PATTERNS
from canid.vehicle.units import factor_to, unit_of

# Yes/no roles are one or two bits wide; a wider signal of that name is a state with several values.
_MAX_SWITCH_BITS = 2
# A radar that reports fewer objects than this one by one would not number its messages.
_MIN_TRACKS = 4
# what a proposal for car following holds as a comment: logs of car following rarely have it
LANE_KEEPING_ALONE = {"curvature"}


class _Named(NamedTuple):
    message: str
    signal: Signal
    name: str  # of the signal, as separate words
    full_name: str  # with the message's before it


class _Found(NamedTuple):
    score: float
    message: str
    signal: Signal


def propose(paths: str | Path | Sequence[str | Path], folder: str | Path | None = None) -> str:
    """Propose a vehicle file.

    Args:
        paths: DBC file, or several.
        folder: where the vehicle file will be, for its relative paths; None: the folder of the first DBC.

    Returns:
        The TOML's text: what was found, with its unit; alternatives and uncertain entries as comments. Where
        something that canid needs was not found, or has no unit, `read_vehicle` says so again.

    Raises:
        ConfigError: a file is missing or no DBC.

    Example:
        >>> from canid.vehicle.vehicle_file import shipped
        >>> print(propose(shipped() / "generic.dbc").splitlines()[9])
        pedal = "ENGINE_DATA.PedalPosition"  # "%"
    """
    paths = [paths] if isinstance(paths, str | Path) else paths
    files, warnings, bytes_left = [], [], MAX_DBC_BYTES
    with Parser() as parser:
        for path in paths:
            file, warned, size = load(Path(path), None, parser, bytes_left)
            bytes_left -= size
            files.append(file)
            warnings += warned
    named = [
        _Named(message_name, signal, words(signal.name), f"{words(message_name)} {words(signal.name)}")
        for message_name, signal in _signals(files)
    ]
    home = Path(paths[0]).parent if folder is None else Path(folder)
    names = ", ".join(_quoted(Path(os.path.relpath(path, home)).as_posix()) for path in paths)
    found = {role: _candidates(role, named) for role in ROLES}
    tracks = None if found["gap"] and found["range_rate"] else _tracks(files)
    output = next((role for role in ("pedal", "accel_command", "accel") if found[role]), "pedal")
    lines = [
        "# Proposed from names and units alone: check every line before you trust it,",
        "# then run `canid check --vehicle THIS_FILE LOG`.",
        *(f"# {_plain(warning)}" for warning in warnings),
        f"name = {_quoted(Path(paths[0]).stem)}",
        "# Paths are relative to this file; { file = ..., bus = 1 } binds a file to a bus.",
        f"dbc = [{names}]",
        "",
        '[signals]  # role = "MESSAGE.SIGNAL"; the unit is the DBC\'s and is converted',
        "# range_rate: positive = opening (lead minus own speed); if yours is closing speed: scale = -1",
        "",
    ]
    needed = {output, *NEEDS["car_following"]}
    for role in ROLES:
        if tracks and role in ("gap", "range_rate", "lead_valid", "lead_speed"):
            continue
        proposed = _lines(role, found[role], role in needed)
        lines += (
            [f"# {line}  # lane keeping" for line in proposed] if role in LANE_KEEPING_ALONE else proposed
        )
    lines += ["", *(tracks or []), "[driver]", 'task = "car_following"', f'output = "{output}"']
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    r"""A basic string of TOML, in which names of files are data.

    >>> print(_quoted('my "car"\n\x7f.dbc'))
    "my \"car\"\n\u007f.dbc"
    """
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    r"""Text for a comment, in one line: what cannot be printed is escaped.

    >>> print(_plain("m\nname = 1"))
    m\nname = 1
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def words(name: str) -> str:
    """Split the name of a signal into words.

    Example:
        >>> words("LeadRelSpeed"), words("GAS_PEDAL")
        ('lead rel speed', 'gas pedal')
    """
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return " ".join(split.replace("_", " ").split()).lower()


def _candidates(role: str, named: Sequence[_Named]) -> list[_Found]:
    """List the signals that may be the role, best first."""
    pattern, excluded = NAME_PATTERNS[role]
    unit = ROLES[role].unit
    found = []
    for message_name, signal, name, full_name in named:
        if re.search(excluded, name):
            continue
        score = 2.0 if re.search(pattern, name) else 1.0 if re.search(pattern, full_name) else 0.0
        if not score:
            continue
        if ROLES[role].kind == "bool":
            if signal.length > _MAX_SWITCH_BITS:
                continue
        elif signal.length <= 1:
            continue
        if unit:
            if factor_to(signal.unit or "", unit) is not None:
                score += 2.0
            elif unit_of(signal.unit or ""):
                continue  # it has a unit of another dimension
        found.append(_Found(score, message_name, signal))
    return sorted(found, key=lambda item: -item.score)


def _signals(files: Sequence[Dbc]) -> Iterator[tuple[str, Signal]]:
    for file in files:
        for message in file.messages.values():
            for signal in message.signals:
                yield message.name, signal


def _lines(role: str, found: list[_Found], needed: bool) -> list[str]:
    if not found:
        return (
            [f'# {role} = "MESSAGE.SIGNAL"  # not found, but needed: {ROLES[role].meaning}'] if needed else []
        )
    best = found[0]
    where = f"{best.message}.{best.signal.name}"
    unit = ROLES[role].unit
    if unit and factor_to(best.signal.unit or "", unit) is None:
        entry = f'{{ signal = "{where}", unit = "" }}'
        remark = f'  # the DBC says "{_plain(best.signal.unit or "")}": fill in its unit'
    else:
        entry, remark = f'"{where}"', f'  # "{_plain(best.signal.unit or "")}"' if unit else ""
    others = ", ".join(f"{item.message}.{item.signal.name}" for item in found[1:4])
    return [f"{role} = {entry}{remark}", *([f"#   or: {others}"] if others else [])]


def _tracks(files: Sequence[Dbc]) -> list[str] | None:
    """Propose [lead] from numbered messages that all carry a distance and a relative speed."""
    parts = {
        "distance": r"long\w* ?(dist|range|pos)|^(dist\w*|range)$",
        "rate": NAME_PATTERNS["range_rate"][0],
        "lateral": r"lat\w* ?(dist|pos|offset)",
        "valid": r"\bvalid\b",
        "new": r"\bnew\b",
    }
    groups: dict[str, list[int]] = {}
    samples: dict[str, list[str]] = {}
    for file in files:
        for message in file.messages.values():
            match = re.fullmatch(r"(.*?)(\d+)", message.name)
            if match:
                groups.setdefault(match[1], []).append(int(match[2]))
                samples[match[1]] = [signal.name for signal in message.signals]
    for prefix, numbers in groups.items():
        chosen = {
            part: name
            for part, pattern in parts.items()
            for name in reversed(samples[prefix])
            if re.search(pattern, words(name))
        }
        if len(numbers) >= _MIN_TRACKS and {"distance", "rate"} <= set(chosen):
            tracks = f"{prefix}{{{min(numbers)}..{max(numbers)}}}"
            signals = [f'{part} = "{chosen[part]}"' for part in parts if part in chosen]
            return ["[lead]", f'tracks = "{tracks}"', *signals, ""]
    return None
