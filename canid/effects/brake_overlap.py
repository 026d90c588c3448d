"""Both pedals at once: the accelerator does not carry the answer alone (two-footed driving, a resting foot)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Drive, Effect
from canid.effects.runs import lasting
from canid.findings import Flags

# %; five steps of an 8-bit pedal sensor: a foot that rests on it without pressing gives less
PRESSED = 2.0
# s; while the foot changes pedals, and between the cycles of two messages, both may seem pressed for less than this
LASTS = 0.6


def recognise(drive: Drive) -> Flags:
    """Where accelerator and brake are pressed together for `LASTS` s, (n,).

    Example:
        >>> signals = {"pedal": np.full(8, 9.0), "brake": np.array([0, 1, 1, 1, 1, 1, 1, 0.0])}
        >>> int(recognise(Drive(np.arange(8) * 0.1, 0.1, signals, np.zeros(8), True)).sum())
        6
    """
    if not {"pedal", "brake"} <= drive.signals.keys():
        return np.zeros(drive.t.size, dtype=bool)
    both = (drive.signals["pedal"] > PRESSED) & (np.nan_to_num(drive.signals["brake"]) > 0.5)
    return lasting(both, round(LASTS / drive.dt))


EFFECT = Effect(
    id="brake_overlap",
    says="Accelerator and brake are pressed at the same time.",
    where="driver",
    kind="mask",
    parameters=(),
    needs=("pedal", "brake"),
    source="pedal misapplication: two-footed driving, Schmidt 1989",
    mask=recognise,
    recovery=0.5,  # s; the foot goes from brake to pedal in 0.2 to 0.5 s
)
