"""Effects of the catalogue on a simulated driver who keeps the lane: the same definitions that the diagnosis fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from canid.models.effects.effect import Seen
from canid.models.simulation.planted_effects import Placed
from canid.values.types import NAN


class Sight(NamedTuple):
    """What a decision rests on."""

    offsets: tuple[float, float]  # m: now, and one decision earlier; times the gains' factor
    added: float  # °, into the demand


def in_curves(placed: Sequence[Placed]) -> bool:
    """Does an effect need a road with curves?"""
    return any(
        placement.effect.lane is not None and placement.effect.lane.curvature is not None
        for placement in placed
    )


def sight(
    placed: Sequence[Placed], duration: float, step: float, dt: float
) -> Callable[[float, Sequence[float], Callable[[float], float]], Sight]:
    """Return what the driver sees for the decision at time t, given all offsets until one `step` before it.

    Args:
        placed: effects on the driver.
        duration: of the drive, s.
        step: from one decision to the next, s; the dead time without effects.
        dt: of the offsets, s.

    Example:
        >>> see = sight((), 60.0, 0.1, 0.05)
        >>> see(0.2, [0.0, 1.0, 2.0], lambda t: 0.0)
        Sight(offsets=(2.0, 0.0), added=0.0)
    """

    def see(t: float, offsets: Sequence[float], road: Callable[[float], float]) -> Sight:
        seen = Seen(t, duration, NAN, NAN, NAN, NAN, NAN)
        later, gain, added = 0.0, 1.0, 0.0
        for effect, p, _ in placed:
            if effect.dead_time is not None:
                later += float(effect.dead_time(p, seen))
            if effect.gain is not None:
                gain *= float(effect.gain(p, seen))
            if effect.lane is not None and effect.lane.curvature is not None:
                added += float(effect.lane.curvature(p, lambda ahead: road(t + ahead)))
        # nobody sees what comes after the last decision
        at = len(offsets) - 1 - max(later, 0.0) / dt
        now, before = _at(offsets, at), _at(offsets, at - step / dt)
        for effect, p, _ in placed:
            if effect.lane is not None and effect.lane.offset is not None:
                now, before = float(effect.lane.offset(p, now)), float(effect.lane.offset(p, before))
        return Sight((gain * now, gain * before), added)

    return see


def _at(x: Sequence[float], index: float) -> float:
    """Value at an index, by a line between its neighbours; 0 before the drive."""
    if index < 0.0:
        return 0.0
    k = round(index)
    if abs(index - k) < 1e-6:
        return x[k]
    k = int(index)
    return x[k] + (index - k) * (x[k + 1] - x[k])
