"""Accelerator and brake pressed together: the accelerator alone does not carry the response (two-footed driving)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, MaskInput, Params
from canid.values.findings import Flags
from canid.values.runs import lasting
from canid.values.types import Array

# %; five steps of an 8-bit pedal sensor: a foot that rests on the pedal without pressing gives less
PRESSED_PERCENT = 2.0
# s; during a change between the pedals, and between the cycles of two messages, both may seem pressed for less
MIN_OVERLAP_S = 0.6


def recognise(drive: MaskInput) -> Flags:
    """Where accelerator and brake are pressed together for `MIN_OVERLAP_S` s, (n,).

    Example:
        >>> signals = {"pedal": np.full(8, 9.0), "brake": np.array([0, 1, 1, 1, 1, 1, 1, 0.0])}
        >>> int(recognise(MaskInput(np.arange(8) * 0.1, 0.1, signals, np.zeros(8), True)).sum())
        6
    """
    if not {"pedal", "brake"} <= drive.signals.keys():
        return np.zeros(drive.t.size, dtype=bool)
    both = (drive.signals["pedal"] > PRESSED_PERCENT) & (np.nan_to_num(drive.signals["brake"]) > 0.5)
    return lasting(both, round(MIN_OVERLAP_S / drive.dt))


def imitate(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Press the brake as well."""
    columns["pedal"][at] = np.maximum(columns["pedal"][at], 3 * PRESSED_PERCENT)
    columns["brake"][at] = 1.0


EFFECT = Effect(
    id="brake_overlap",
    says="Accelerator and brake are pressed at the same time.",
    where="driver",
    kind=Kind.MASK,
    parameters=(),
    needs=("pedal", "brake"),
    source="pedal misapplication: two-footed driving, Schmidt 1989",
    mask=recognise,
    recovery=0.5,  # s; moving the foot from brake to pedal takes 0.2 to 0.5 s
    imitate=imitate,
    found_at=((3.0,),),
    silent_at=((0.3,),),
)
