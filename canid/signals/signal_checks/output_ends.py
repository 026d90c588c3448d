"""At which limits the output of a drive was, and for how long: there the driver's answer is known to be beyond them only."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from canid.signals.samples.learning_gate import SHOWS_DEMAND
from canid.values.output_role import output_role
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import LearnGate, Trace


class OutputEnd(NamedTuple):
    """A limit of the output; a pedal at 0 % is none that is to be stated."""

    side: Literal["lower", "upper"]
    value: float  # in the output's unit
    seconds: float  # s at the limit
    share: float  # of the time in which the output shows what the driver demands
    says: str  # a clause


def reached(trace: Trace) -> tuple[OutputEnd, ...]:
    """Limits that a drive has met.

    Args:
        trace: of `learning_gate.with_limits`.

    Example:
        >>> from canid.values.types import Driver, LearnGate, Sample
        >>> from canid.signals.samples.trace_assembly import trace
        >>> at = Sample(0.0, 100.0, (0.1, 0.0), LearnGate.OUTPUT_LIMIT, False, 0, {"pedal": 100.0}, 99.5)
        >>> print(reached(trace([at, at._replace(t=0.1)], Driver(), 0.1))[0].says.partition(', and')[0])
        the pedal is at its upper limit, 100 %, for 0.2 s (100 % of the time)
    """
    at = np.array([gate is LearnGate.OUTPUT_LIMIT for gate in trace.gate], dtype=bool)
    if trace.bound is None or not at.any():
        return ()
    shown = sum(gate in SHOWS_DEMAND for gate in trace.gate)
    role, out = output_role(trace), []
    sides: tuple[tuple[Literal["lower", "upper"], bool], ...] = (("lower", False), ("upper", True))
    for side, above in sides:
        here = at & ((trace.output > trace.bound) == above)
        if not here.any():
            continue
        value = float(trace.output[here].max() if above else trace.output[here].min())
        seconds, share = float(here.sum()) * trace.dt, float(here.sum()) / shown
        says = (
            f"the {readable(role) or 'output'} is at its {side} limit, {number(value, role_unit(role))}, for "
            f"{number(seconds, 's')} ({100.0 * share:.0f} % of the time), and the driver's demand then known only to be "
            "beyond it"
        )
        out.append(OutputEnd(side, value, seconds, share, says))
    return tuple(out)
