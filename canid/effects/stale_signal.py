"""A measured signal stands still while the world moves: a sender has hung up, and its last value is repeated."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Drive, Effect
from canid.effects.runs import repeats
from canid.findings import Flags
from canid.types import Array

# s; shorter repeats are a coarse signal, or a quiet moment
LASTS = 2.0
# times the longest repeat that this signal usually shows (up to the 95 % of its time)
UNUSUAL = 8.0
# m/s; below it everything may truly stand still
MOVES = 2.0
# m that the range rate says the gap has moved, or the gap that a steady range rate has not: the noise of a radar's
# report is 0.25 m, and its steps are 0.05 to 0.1 m
GAP_MOVES = 1.5
# m/s by which an unchanged speed contradicts the acceleration, on top of BIAS
SPEED_MOVES = 0.7
# m/s²; an accelerometer feels 0.1 per % of slope as well
BIAS = 0.4

Columns = dict[str, Array | None]


def recognise(drive: Drive) -> Flags:
    """Where speed, gap or range rate repeats itself to the last bit although it must move, (n,).

    A foot that holds still is not meant: the pedal is never judged. It must move: another signal says so, or this
    one, which is noisy, has never repeated itself like that.

    Example:
        >>> t = np.arange(100) * 0.1
        >>> signals = {"gap": np.where(t < 5, 30.0, 30.0 + t), "range_rate": 1 + 0.01 * t, "speed": 20 + t}
        >>> flags = recognise(Drive(t, 0.1, signals, np.zeros(100), True))
        >>> bool(flags[:50].all()), bool(flags[50:].any())
        (True, False)
    """
    of = drive.signals
    columns: Columns = {
        "gap": of.get("gap_reported", of.get("gap")),
        "range_rate": of.get("range_rate_reported", of.get("range_rate")),
        "speed": of.get("speed"),
        "accel": of.get("accel"),
    }
    speed = columns["speed"]
    moving = np.ones(drive.t.size, dtype=bool) if speed is None else ~(speed < MOVES)
    out = np.zeros(drive.t.size, dtype=bool)
    for role in ("gap", "range_rate", "speed"):
        column = columns[role]
        if column is not None:
            out |= _frozen(role, column, columns, moving, drive.dt)
    return out


def _frozen(role: str, column: Array, columns: Columns, moving: Flags, dt: float) -> Flags:
    out = np.zeros(column.size, dtype=bool)
    found = [(first, stop) for first, stop in repeats(column) if moving[first:stop].all()]
    if not found:
        return out
    usual = _usual(column, dt)
    for first, stop in found:
        lasts = (stop - first) * dt
        contradicted = _contradicted(role, columns, first, stop, dt)
        if lasts >= LASTS and (contradicted or lasts >= UNUSUAL * usual):
            out[first:stop] = True
    return out


def _usual(column: Array, dt: float) -> float:
    """How long this signal stays at one value, s: the time up to which repeats make 95 % of what is known of it."""
    known = int(np.isfinite(column).sum())
    lengths = np.array([stop - first for first, stop in repeats(column)])
    lengths = np.sort(np.concatenate([lengths, np.ones(max(known - int(lengths.sum()), 0))]))
    share = np.cumsum(lengths) / lengths.sum()
    return float(lengths[np.searchsorted(share, 0.95)]) * dt


def _contradicted(role: str, columns: Columns, first: int, stop: int, dt: float) -> bool:
    """Do the others say that it moves meanwhile?"""
    here = {name: None if x is None else x[first:stop] for name, x in columns.items()}
    if role == "gap":
        return _span(_way(here["range_rate"], dt)) > GAP_MOVES
    if role == "speed":
        return _span(_way(here["accel"], dt)) > SPEED_MOVES + BIAS * (stop - first) * dt
    gap, way = here["gap"], _way(here["range_rate"], dt)
    return gap is not None and way is not None and _span(gap - way) > 2 * GAP_MOVES


def _way(rate: Array | None, dt: float) -> Array | None:
    return None if rate is None else np.cumsum(rate) * dt


def _span(x: Array | None) -> float:
    """Return max − min; 0 where a part is not known."""
    return float(np.ptp(x)) if x is not None and x.size and np.isfinite(x).all() else 0.0


EFFECT = Effect(
    id="stale_signal",
    says="A measured signal stands still, or does not arrive.",
    where="driver",
    kind="mask",
    parameters=(),
    needs=("speed", "gap", "range_rate"),
    source="repeats to the last bit: a sensor's noise does not do that, a hung sender does",
    mask=recognise,
    recovery=2.0,  # s; what the driver answered meanwhile was not what is recorded: a dead time and three lags
)
