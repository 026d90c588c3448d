"""The learning gate over a drive: how long each state lasted, what it means, and its strip."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from canid.signal_checks.drive_time import Flags, trusted
from canid.types import Array, LearnGate, SignalFinding
from canid.views.drive_report.strips import Stretch
from canid.views.names import readable


class GateTime(NamedTuple):
    """Time in one state of the gate."""

    name: str
    seconds: float
    percent: float
    means: str


def gate_times(gates: Sequence[LearnGate], dt: float) -> list[GateTime]:
    """Time in each state, the longest first.

    Example:
        >>> gate_times([LearnGate.OPEN, LearnGate.OPEN, LearnGate.CRUISE, LearnGate.OPEN], 0.5)[1][:3]
        ('cruise', 0.5, 25.0)
    """
    counts = Counter(gates)
    return [
        GateTime(_name(gate), n * dt, 100.0 * n / len(gates), gate.value or "a person follows: learned from")
        for gate, n in counts.most_common()
    ]


def gate_strip(
    t: Array, gates: Sequence[LearnGate], learned: Flags, findings: Iterable[SignalFinding], dt: float
) -> list[Stretch]:
    """What is used, and why not: the gate, the seconds of settling after it, and findings on signals.

    Args:
        t: (n,) s.
        gates: (n,) of the samples.
        learned: (n,) of the samples.
        findings: on the signals.
        dt: s, of the grid.

    Example:
        >>> gates = [LearnGate.OPEN, LearnGate.OPEN, LearnGate.BRAKE]
        >>> [one.state for one in gate_strip(np.arange(3.0), gates, np.array([False, True, False]), (), 1.0)]
        ['settling', 'used', 'brake']
    """
    used = learned & trusted(t, findings)
    states = [
        "used"
        if mine
        else (_name(gate) if gate is not LearnGate.OPEN else ("finding" if learn else "settling"))
        for mine, gate, learn in zip(used.tolist(), gates, learned.tolist(), strict=True)
    ]
    out: list[Stretch] = []
    begins = np.flatnonzero([a != b for a, b in zip(states, ["", *states], strict=False)])
    ends = [*begins[1:].tolist(), len(states)]
    for a, b in zip(begins.tolist(), ends, strict=True):
        out.append(Stretch("gate", states[a], float(t[a]), float(t[b - 1]) + dt))
    return out


def _name(gate: LearnGate) -> str:
    return readable(gate.name.lower())
