"""What a log shows of switches: the brake is on while the car slows, cruise control while the accelerator is at rest."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from canid.analysis.proposal.name_score import Candidate
from canid.analysis.proposal.signal_agreement import (
    AGREES,
    AGREES_WEAKLY,
    CONTRADICTS,
    MIN_ROWS,
    Judged,
    References,
    in_role_unit,
    moves,
)
from canid.values.types import Array

# m/s, degrees: no assistant steers a car that stands, or around a corner; and a share of the time that is noise of both
_STANDS_M_S, _TURNED_DEG, _SELDOM = 0.5, 120.0, 0.1


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


def lead_valid(candidate: Candidate, raw: Array, known: References) -> Judged:
    """Compare a flag of the lead with the gap: where that moves, there is a lead."""
    on = in_role_unit(candidate, raw) > 0.5
    moving = (
        np.isfinite(known.gap_rate) & (known.gap_rate != 0.0) if known.gap_rate is not None else on & False
    )
    if int(moving.sum()) >= MIN_ROWS and not on[moving].any():
        return CONTRADICTS, ["never true in the log, although the gap changes"], candidate
    return AGREES_WEAKLY if moves(raw) else 0.0, [] if moves(raw) else ["constant in the log"], candidate


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
    braking = []
    values = np.unique(raw[np.isfinite(raw)])
    means = {value: _mean(known.accel, raw == value) for value in values}
    usual = max(values, key=lambda value: int((raw == value).sum()))
    for value in values:
        pressed = _mean((known.pedal > 3.0).astype(float), raw == value) if known.pedal is not None else 0.0
        if value != usual and means[value] < min(-0.3, means[usual] - 0.3) and not pressed > 0.3:
            braking.append(int(value))
    return tuple(braking)


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


def steering_assist(candidate: Candidate, raw: Array, known: References) -> Judged:
    """Compare the state of a steering assistant with speed and steering wheel: it steers a car that drives, and gently.

    That fits a warning lamp as well: what the log shows can only speak against the name.
    """
    if not moves(raw):
        return 0.0, ["constant in the log: by its name alone, a guess"], candidate
    on = in_role_unit(candidate, raw) > 0.5
    stands = _share(known.speed, on, lambda speed: speed < _STANDS_M_S)
    turned = _share(known.steering, on, lambda angle: np.abs(angle) > _TURNED_DEG)
    if stands > _SELDOM or turned > _SELDOM:
        what = (
            f"the car stands in {100 * stands:.0f} % of the time"
            if stands > _SELDOM
            else f"the wheel is turned by more than {_TURNED_DEG:.0f}° in {100 * turned:.0f} % of the time"
        )
        return CONTRADICTS, [f"{what} while on"], candidate
    shown = [
        *(["the car drives"] if math.isfinite(stands) else []),
        *([f"the wheel is turned by less than {_TURNED_DEG:.0f}°"] if math.isfinite(turned) else []),
    ]
    if not shown:
        return 0.0, ["by its name alone, a guess"], candidate
    return AGREES_WEAKLY, [f"while on {' and '.join(shown)}: it may be a lamp all the same"], candidate


def _share(
    values: Array | None, on: npt.NDArray[np.bool_], is_so: Callable[[Array], npt.NDArray[np.bool_]]
) -> float:
    """How often something is so while a switch is on; NaN: not known."""
    return math.nan if values is None else _mean(is_so(values).astype(float), on & np.isfinite(values))
