"""May a lane drive be diagnosed: is enough measured, and does the baseline describe it?"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.lane import lane_intervals
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.diagnosis.lane.lane_model import KD, TAU, THETA, K
from canid.findings import Flags
from canid.types import LearnGate, Trace

# ° and m; a wheel or an offset that moves less shows no answer
STILL_ANGLE, STILL_OFFSET_M = 0.05, 0.01
# of a parameter's range; nearer than this it stands at its bound
BOUND_RANGE_SHARE = 1e-3
NAMES = {K: "the gain", KD: "the gain on lateral speed", TAU: "the lag", THETA: "the dead time"}


def lacking(trace: Trace, usable: Flags, minimum: float) -> str:
    """Say what is missing for a diagnosis, and what to do; "": nothing.

    Args:
        trace: of a drive.
        usable: (n,) samples without a finding on a signal.
        minimum: s of steering that must be there.
    """
    need = f"drive {minimum / 60:.2g} min or more between lane markings, without a steering assistant"
    n, dt = trace.t.size, trace.dt
    if n * dt < minimum:
        return f"the log shows {n * dt:.0f} s of lane keeping; {need}"
    offset = trace.inputs[:, 0]
    if np.isfinite(offset).sum() * dt < minimum:
        return f"no lane: `lateral_offset` is there for {np.isfinite(offset).sum() * dt:.0f} s only; {need}"
    if np.isfinite(trace.output).sum() * dt < minimum:
        return "the driver's output is not in the log; map it in the vehicle file ([driver] output)"
    here = usable & np.isfinite(offset) & np.isfinite(trace.output)
    here &= np.array([gate is LearnGate.OPEN for gate in trace.gate], dtype=bool)
    if here.sum() * dt < minimum:
        return f"a person keeps the lane for {here.sum() * dt:.0f} s only; {need}"
    if float(np.std(trace.output[here])) < STILL_ANGLE:
        return "the driver's output never moves: is it the right signal, and does a person steer?"
    if float(np.std(offset[here])) < STILL_OFFSET_M:
        return f"the lateral offset never moves, so nothing is answered; {need}"
    return ""


def refusal(data: LaneData, solved: FittedLane) -> str:
    """Why the baseline does not describe the drive, and what would help; "": it may be judged."""
    y = data.output.y[data.output.usable]
    left = y - solved.fitted.model[data.output.usable]
    fit = 100 * (1 - float(np.linalg.norm(left)) / max(float(np.linalg.norm(y - y.mean())), 1e-9))
    if fit <= 0.0:
        return (
            f"its simulation fits worse than the mean of the wheel angle (fit {fit:.0f} %): something else than the lateral "
            "offset turns the wheel. What would help: 10 min on a straighter road, without a steering assistant"
        )
    low, high = solved.model.low, solved.model.high
    at = [
        name
        for k, name in NAMES.items()
        if min(high[k] - solved.q[k], solved.q[k] - low[k] if low[k] < 0.0 else np.inf)
        < BOUND_RANGE_SHARE * (high[k] - low[k])
    ]
    if at:
        return f"{' and '.join(at)} at the bound of what is searched: check units and signs of the signals (canid check)"
    gain = lane_intervals.channels(solved, data)["lateral_offset"].K
    if gain.low > 0.0:
        return (
            f"the wheel is turned with the offset, not against it (gain {gain.value:.2g} [{gain.low:.2g}, {gain.high:.2g}] "
            "° per m): check the signs of lateral_offset and steering_angle, both are positive to the left"
        )
    return ""
