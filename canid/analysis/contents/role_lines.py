"""What canid made of a log, as lines next to its signals: roles on the grid, lead, learning gate, masks."""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from canid.analysis.contents.signal_lines import Line, NamedLine
from canid.models.diagnosis import masks
from canid.values.roles import ROLES
from canid.values.text.names import readable
from canid.values.text.numbers import role_unit
from canid.values.types import Array, LearnGate, Trace

GROUP = "what canid made of it"
# what a driver does behind a lead, in the order in which it is read
FIRST = ("pedal", "speed", "gap", "range_rate", "headway")
_GATES = tuple(LearnGate)


def lines_of_trace(trace: Trace) -> tuple[NamedLine, ...]:
    """Roles, lead, learning gate and masks of a drive, each at the times of its samples.

    Args:
        trace: of a whole drive.

    Example:
        >>> from canid.analysis.drive.drive_reader import read_trace
        >>> from canid.values.shipped_files import shipped
        >>> trace = read_trace(shipped().parent / "replay_logs" / "following_lost_lead.blf", "generic")
        >>> [line.name for line in lines_of_trace(trace)][:3]
        ['learning gate', 'learned from', 'segment: +1 at another lead, driver or a break']
    """
    t = trace.t
    known = {name: value for name, value in trace.signals.items() if np.isfinite(value).any()}
    names = [
        *(name for name in FIRST if name in known),
        *(name for name in ROLES if name not in FIRST and name in known),
    ]
    roles = [_line(readable(name), t, known[name], role_unit(name), at_first=name in FIRST) for name in names]
    gates = {
        float(k): "open" if gate is LearnGate.OPEN else readable(gate.name.lower())
        for k, gate in enumerate(_GATES)
    }
    gate = np.array([float(_GATES.index(gate)) for gate in trace.gate])
    states = [
        _line("learning gate", t, gate, meanings=gates, at_first=True),
        _flags("learned from", t, trace.learn, ("no", "yes")),
        _line("segment: +1 at another lead, driver or a break", t, trace.segment.astype(float)),
    ]
    kept, masked = masks.recognise(trace)
    if masked:
        states.append(_flags("left out by the masks of diagnose", t, ~kept, ("no", "yes")))
    return (*states, *roles)


def _line(
    name: str,
    t: Array,
    value: Array,
    unit: str = "",
    *,
    meanings: dict[float, str] | None = None,
    at_first: bool = False,
) -> NamedLine:
    return NamedLine(name, GROUP, unit, meanings or {}, partial(Line, t, value), at_first)


def _flags(name: str, t: Array, flags: npt.NDArray[np.bool_], words: tuple[str, str]) -> NamedLine:
    return _line(name, t, flags.astype(float), meanings={0.0: words[0], 1.0: words[1]})
