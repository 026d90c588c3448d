"""The learning gate over a drive: how long each state lasted, what it means, and its strip."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.signal_checks.drive_time import usable
from canid.types import LearnGate, Trace
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


def gate_strip(trace: Trace) -> list[Stretch]:
    """What is used, and why not: the gate, the seconds of recovery after it, and findings on signals."""
    used = usable(trace)
    states = [
        "used"
        if mine
        else (_name(gate) if gate is not LearnGate.OPEN else ("finding" if learn else "recovery"))
        for mine, gate, learn in zip(used.tolist(), trace.gate, trace.learn.tolist(), strict=True)
    ]
    out: list[Stretch] = []
    begins = np.flatnonzero([a != b for a, b in zip(states, ["", *states], strict=False)])
    ends = [*begins[1:].tolist(), len(states)]
    for a, b in zip(begins.tolist(), ends, strict=True):
        out.append(Stretch("gate", states[a], float(trace.t[a]), float(trace.t[b - 1]) + trace.dt))
    return out


def _name(gate: LearnGate) -> str:
    return readable(gate.name.lower())
