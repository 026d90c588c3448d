"""What of a drive is learned from: the learning gate as table and strip, and findings on the signals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from canid.signals.signal_checks.drive_time import Flags, trusted
from canid.ui.views import signal_text
from canid.ui.views.document.document import Listing, Table
from canid.ui.views.drive_report.strips import Stretch
from canid.values.text.names import readable
from canid.values.text.numbers import number
from canid.values.types import Array, DriveTime, LearnGate, SignalFinding


def gate_table(gates: Sequence[LearnGate], dt: float, time: DriveTime) -> Table:
    """Time in each state, the longest first.

    Example:
        >>> gates = [LearnGate.OPEN, LearnGate.OPEN, LearnGate.CRUISE, LearnGate.OPEN]
        >>> gate_table(gates, 0.5, DriveTime(2.0, 2.0, 2.0, 1.5)).rows[1][:3]
        ('cruise', '0.5 s', '25 %')
    """
    rows = [
        (
            _name(gate),
            number(n * dt, "s"),
            number(100.0 * n / len(gates), "%"),
            gate.value or "a person follows: learned from",
        )
        for gate, n in Counter(gates).most_common()
    ]
    return Table(("learning gate", ">time", ">share", "meaning"), rows, "time", signal_text.time(time))


def findings(several: Sequence[SignalFinding]) -> Listing | str:
    """Findings on the signals, or that there is none."""
    title = "while one of these stands on a signal that the model needs, no estimate may be quoted"
    return (
        Listing(signal_text.findings(several), title) if several else "No finding on the signals that came."
    )


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
