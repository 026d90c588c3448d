"""Frozen signal: the sender hangs, and its last value is repeated while the true one moves."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, MaskInput, Params
from canid.values.findings import Flags
from canid.values.runs import repeats
from canid.values.types import Array

# s; shorter repeats are a coarse signal, or a steady drive
MIN_FREEZE_S = 2.0
# times the duration up to which the signal's repeats make 95 % of its time
UNUSUAL_FACTOR = 8.0
# m/s; below it every signal may truly stand still
MIN_SPEED = 2.0
# m of change of the gap that the other signal contradicts: the noise of a radar's report is 0.25 m, and its steps are
# 0.05 to 0.1 m
MIN_GAP_CHANGE_M = 1.5
# m/s by which an unchanged speed contradicts the acceleration, in addition to ACCEL_BIAS
MIN_SPEED_CHANGE = 0.7
# m/s²; an accelerometer also measures 0.1 per % of slope
ACCEL_BIAS = 0.4

Columns = dict[str, Array | None]


def recognise(drive: MaskInput) -> Flags:
    """Where speed, gap or range rate repeats itself exactly although it must move, or does not arrive, (n,).

    It must move where another signal says so, or where this one, which is noisy, has never repeated itself like that.
    The pedal is not tested: a driver may hold it.

    Example:
        >>> t = np.arange(100) * 0.1
        >>> signals = {"gap": np.where(t < 5, 30.0, 30.0 + t), "range_rate": 1 + 0.01 * t, "speed": 20 + t}
        >>> flags = recognise(MaskInput(t, 0.1, signals, np.zeros(100), True))
        >>> bool(flags[:50].all()), bool(flags[50:].any())
        (True, False)
    """
    signals = drive.signals
    columns: Columns = {
        "gap": signals.get("gap_reported", signals.get("gap")),
        "range_rate": signals.get("range_rate_reported", signals.get("range_rate")),
        "speed": signals.get("speed"),
        "accel": signals.get("accel"),
    }
    speed = columns["speed"]
    moving = np.ones(drive.t.size, dtype=bool) if speed is None else ~(speed < MIN_SPEED)
    out = np.zeros(drive.t.size, dtype=bool)
    for role in ("gap", "range_rate", "speed"):
        column = columns[role]
        if column is not None:
            out |= _frozen(role, column, columns, moving, drive.dt)
    return out | drive.missing if drive.missing.size else out


def _frozen(role: str, column: Array, columns: Columns, moving: Flags, dt: float) -> Flags:
    out = np.zeros(column.size, dtype=bool)
    stretches = [(first, stop) for first, stop in repeats(column) if moving[first:stop].all()]
    if not stretches:
        return out
    usual = _usual(column, dt)
    for first, stop in stretches:
        lasts = (stop - first) * dt
        contradicted = _contradicted(role, columns, first, stop, dt)
        if lasts >= MIN_FREEZE_S and (contradicted or lasts >= UNUSUAL_FACTOR * usual):
            out[first:stop] = True
    return out


def _usual(column: Array, dt: float) -> float:
    """Duration up to which repeats of one value make 95 % of what is known of the signal, s."""
    known = int(np.isfinite(column).sum())
    lengths = np.array([stop - first for first, stop in repeats(column)])
    lengths = np.sort(np.concatenate([lengths, np.ones(max(known - int(lengths.sum()), 0))]))
    share = np.cumsum(lengths) / lengths.sum()
    return float(lengths[np.searchsorted(share, 0.95)]) * dt


def _contradicted(role: str, columns: Columns, first: int, stop: int, dt: float) -> bool:
    """Do the other signals say that it moves meanwhile?"""
    here = {name: None if x is None else x[first:stop] for name, x in columns.items()}
    if role == "gap":
        return _span(_way(here["range_rate"], dt)) > MIN_GAP_CHANGE_M
    if role == "speed":
        return _span(_way(here["accel"], dt)) > MIN_SPEED_CHANGE + ACCEL_BIAS * (stop - first) * dt
    gap, way = here["gap"], _way(here["range_rate"], dt)
    return gap is not None and way is not None and _span(gap - way) > 2 * MIN_GAP_CHANGE_M


def _way(rate: Array | None, dt: float) -> Array | None:
    return None if rate is None else np.cumsum(rate) * dt


def _span(x: Array | None) -> float:
    """Return max − min; 0 where a part is not known."""
    return float(np.ptp(x)) if x is not None and x.size and np.isfinite(x).all() else 0.0


def imitate(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Repeat the last value of the speed."""
    columns["speed"][at] = columns["speed"][at.start]


EFFECT = Effect(
    id="stale_signal",
    says="A measured signal is frozen, or does not arrive.",
    where="driver",
    kind=Kind.MASK,
    judges=("gap_frozen", "range_rate_frozen", "speed_frozen"),
    parameters=(),
    needs=("speed", "gap", "range_rate"),
    source="exact repeats: a hung sender gives them, a sensor with noise does not",
    mask=recognise,
    recovery=2.0,  # s; the driver answered to other inputs than the recorded ones: a dead time and three lags
    breaks_redundancy=True,
    imitate=imitate,
    found_at=((3.0,),),
    silent_at=((1.0,),),
)
