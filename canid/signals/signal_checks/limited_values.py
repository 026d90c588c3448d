"""A signal that its sensor or a logger limits, as its readings show (`signals/samples/limited_values.py`).

Readings at a limit are left out from then on. The finding holds from the first of them on, as those before it was known were
taken for measured ones, and no longer than any other finding.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from canid.signals.signal_checks.blocks import Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.roles import ROLES
from canid.values.types import SignalFinding


class State(NamedTuple):
    """Nothing: what is found is in the block."""


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block.

    Example:
        >>> import numpy as np
        >>> from canid.signals.samples.reading_facts import Limited
        >>> limited = Limited("range_rate", 28.0, -0.8, 0.8)
        >>> block = Block(41.0, 0.1, np.zeros((10, 10)), (), (), True, True, limited=(limited,))
        >>> step(init(), block)[1].says
        'range_rate is limited at ±0.8 m/s'
    """
    if not block.limited:
        return state, None
    role, age, low, high = block.limited[-1]
    both = low > -math.inf and high < math.inf
    if both:
        name, where = "", f"±{high:.4g}" if math.isclose(high, -low) else f"{low:.4g} and {high:.4g}"
    else:
        name, where = ("_above", f"{high:.4g}") if high < math.inf else ("_below", f"{low:.4g}")
    says = f"{role} is limited at {where} {ROLES[role].unit}"
    remedy = "it says nothing there: what it has at its limit is left out; log it with a wider range"
    return state, Found(f"{role}_limited{name}", (role,), max(block.t - age, 0.0), says, remedy)


def sides(finding: SignalFinding) -> tuple[str, tuple[bool, bool]]:
    """Role that a finding calls limited, and whether below and above; "": another kind of finding.

    Example:
        >>> sides(SignalFinding("gap_limited_above", ("gap",), 3.0, 90.0, "", "", True))
        ('gap', (False, True))
    """
    role, limited, side = finding.name.partition("_limited")
    return (role if limited else "", (side != "_above", side != "_below"))


CHECK = Check("limited_values", init, step)
