"""What a log shows of switches: the brake is on while the car slows, cruise control while the accelerator is at rest."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from canid.proposal.name_score import Candidate
from canid.proposal.signal_agreement import (
    AGREES,
    AGREES_WEAKLY,
    CONTRADICTS,
    Judged,
    References,
    in_role_unit,
    moves,
)
from canid.types import Array


def brake(candidate: Candidate, raw: Array, known: References) -> Judged:
    """Compare the driver's brake switch with deceleration, accelerator and cruise control."""
    if not moves(raw):
        return 0.0, ["constant in the log"], candidate
    if known.accel is None:
        return 0.0, [], candidate
    if candidate.on is None and candidate.signal.length > 1:
        on = _braking_values(raw, known)
        if on:
            candidate = candidate._replace(
                on=on, remarks=(f"{list(on)}: the values with which the car brakes in the log",)
            )
            return AGREES + 1.0, ["on while the car brakes"], candidate
    return _while_on(candidate, raw, known)


def _while_on(candidate: Candidate, raw: Array, known: References) -> Judged:
    on = in_role_unit(candidate, raw) > 0.5
    off = np.isfinite(raw) & ~on
    assert known.accel is not None
    a_on, a_off = _mean(known.accel, on), _mean(known.accel, off)
    pressed = (
        _mean((known.pedal > 3.0).astype(float), on & np.isfinite(known.pedal))
        if known.pedal is not None
        else math.nan
    )
    remarks = []
    points = 0.0
    if math.isfinite(a_on) and math.isfinite(a_off):
        remarks.append(f"mean acceleration {a_on:.1f} m/s2 while on, {a_off:.1f} while off")
        points += AGREES if a_on < a_off - 0.3 else CONTRADICTS if a_on > a_off + 0.2 else 0.0
    if known.cruise is not None and _mean(known.cruise, on) > 0.5:
        # a driver who brakes ends cruise control: this is the controller's brake, or the lamp
        return CONTRADICTS, ["on while cruise control drives"], candidate
    if pressed > 0.5:
        points += CONTRADICTS
        remarks.append("the accelerator is pressed meanwhile")
    return points, remarks, candidate


def _braking_values(raw: Array, known: References) -> tuple[int, ...]:
    """The states in which the car brakes and the accelerator is at rest."""
    assert known.accel is not None
    found = []
    values = np.unique(raw[np.isfinite(raw)])
    means = {value: _mean(known.accel, raw == value) for value in values}
    usual = max(values, key=lambda value: int((raw == value).sum()))
    for value in values:
        pressed = _mean((known.pedal > 3.0).astype(float), raw == value) if known.pedal is not None else 0.0
        if value != usual and means[value] < min(-0.3, means[usual] - 0.3) and not pressed > 0.3:
            found.append(int(value))
    return tuple(found)


def _mean(values: Array, rows: npt.NDArray[np.bool_]) -> float:
    chosen = values[rows & np.isfinite(values)]
    return float(chosen.mean()) if len(chosen) >= 5 else math.nan


def cruise(candidate: Candidate, raw: Array, known: References) -> Judged:
    """Compare the state of cruise control with the accelerator: it is at rest while the speed is held."""
    if not moves(raw):
        return 0.0, ["constant in the log"], candidate
    if known.speed is None or known.pedal is None:
        return 0.0, [], candidate
    on = in_role_unit(candidate, raw) > 0.5
    moving = on & (known.speed > 5.0)
    held = _mean((np.abs(known.pedal) < 2.0).astype(float), moving & np.isfinite(known.pedal))
    if not math.isfinite(held):
        return 0.0, [], candidate
    remarks = [f"accelerator at rest in {100 * held:.0f} % of the time while on"]
    return (AGREES if held > 0.7 else -AGREES_WEAKLY if held < 0.2 else 0.0), remarks, candidate
