"""Which signal the driver's output is."""

from __future__ import annotations

import numpy as np

from canid.values.types import Trace

# roles that may be an output, the first one first where several have the same column
OUTPUTS = ("pedal", "accel_command", "accel", "steering_angle")


def output_role(trace: Trace) -> str:
    """Return the role of the driver's output; "": none of the signals is it.

    A trace holds the output as a column of its own: the role is the one with the same column, wherever it is measured.

    Example:
        >>> import canid
        >>> output_role(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        'pedal'
    """
    known = np.isfinite(trace.output)
    for role in (*OUTPUTS, *sorted(trace.signals)):
        column = trace.signals.get(role)
        if column is not None and known.any() and np.array_equal(column[known], trace.output[known]):
            return role
    return ""
