"""Causes of the catalogue planted in a simulated driver: the same definitions that the diagnosis fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.effects import CATALOGUE
from canid.effects.cause import Effect, Seen
from canid.effects.headway_drift import EVERY

BY_ID = {effect.id: effect for effect in CATALOGUE}
# kinds that a simulated driver can carry; masks and sensing are no manner of driving
PLANTABLE = tuple(
    effect.id for effect in CATALOGUE if effect.where == "driver" and effect.kind != "mask" and effect.planted
)


class Hidden(NamedTuple):
    """What is planted, ready for one drive."""

    effects: tuple[tuple[Effect, tuple[float, ...]], ...]
    episodes: tuple[tuple[float, float], ...]  # s, [start, stop) in which the pedal is held
    truth: dict[str, Any]  # as JSON


def plant(
    hide: Mapping[str, Sequence[float] | None],
    duration: float,
    speed: float,
    hold: float,
    rng: np.random.Generator,
) -> Hidden:
    """Prepare what is hidden.

    Args:
        hide: id -> parameters in the catalogue's order; None or empty: a strength that the drive must show.
        duration: s.
        speed: m/s, the drive's mean.
        hold: %, the pedal that holds it.
        rng: source of chance.

    Raises:
        ValueError: an unknown cause, one that cannot be planted, or too many numbers.

    Example:
        >>> plant({"looming_gain": (1.0,)}, 600.0, 20.0, 7.0, np.random.default_rng(1)).truth
        {'looming_gain': {'exponent': 1.0}}
    """
    effects, truth = [], dict[str, Any]()
    episodes: tuple[tuple[float, float], ...] = ()
    for name, given in hide.items():
        if name not in PLANTABLE:
            raise ValueError(f"{name!r} cannot be hidden; choose from {', '.join(PLANTABLE)}")
        effect = BY_ID[name]
        values = tuple(given or ())
        if len(values) > len(effect.parameters):
            names = ", ".join(f"{p.name} ({p.unit})" for p in effect.parameters)
            raise ValueError(f"{name} takes {len(effect.parameters)} numbers, not {len(values)}: {names}")
        default = effect.planted[int(rng.integers(len(effect.planted)))]
        # a planted time, speed or level is a share of the drive's, its mean's or of what is pressed
        scale = {"time": duration, "speed": speed / 0.65, "level": 2.2 * hold}
        full = [
            *values,
            *(x * scale.get(p.name, 1.0) for x, p in zip(default, effect.parameters, strict=False)),
        ][: len(effect.parameters)]
        for k, p in enumerate(effect.parameters[len(values) :], start=len(values)):
            full[k] = default[k] * scale.get(p.name, 1.0) if k < len(default) else 0.0
        told = {p.name: float(x) for p, x in zip(effect.parameters, full, strict=True)}
        if name == "headway_drift":
            knots = np.cumsum(rng.standard_normal(int(duration / EVERY) + 2))
            knots -= knots.mean()
            full = (told["sd"] * knots / max(float(np.std(knots)), 1e-9)).tolist()
        if name == "attention_gap":
            episodes = _episodes(told["per_minute"], told["duration"], duration, rng)
            truth[name] = told | {"episodes": [list(e) for e in episodes]}
            continue
        truth[name] = told
        effects.append((effect, tuple(full)))
    return Hidden(tuple(effects), episodes, truth)


def _episodes(
    per_minute: float, length: float, duration: float, rng: np.random.Generator
) -> tuple[tuple[float, float], ...]:
    """Draw when he looks away: Poisson moments, lengths a third to either side."""
    t, out = float(rng.exponential(60 / per_minute)), []
    while t < duration:
        stop = t + length * rng.uniform(0.67, 1.33)
        out.append((round(t, 2), round(float(stop), 2)))
        t = float(stop) + float(rng.exponential(60 / per_minute))
    return tuple(out)


class Acted(NamedTuple):
    """What the driver acts upon at one instant."""

    e: float  # s, headway error times the gains' factor
    w: float  # m/s
    extra: float  # %
    later: float  # s, added to both dead times


def perceive(hidden: Hidden, e: float, w: float, seen: Seen) -> Acted:
    """Pass what is seen through every cause.

    Example:
        >>> none = plant({}, 600.0, 20.0, 7.0, np.random.default_rng(1))
        >>> perceive(none, -0.5, 1.0, Seen(0.0, 600.0, 1.5, 1.0, 30.0, 20.0, 0.0))
        Acted(e=-0.5, w=1.0, extra=0.0, later=0.0)
    """
    extra = later = 0.0
    gain = 1.0
    for effect, p in hidden.effects:
        if effect.headway is not None:
            e = float(effect.headway(p, e, seen))
        if effect.range_rate is not None:
            w = float(effect.range_rate(p, w, seen))
        if effect.extra is not None:
            extra += float(effect.extra(p, seen))
        if effect.gain is not None:
            gain *= float(effect.gain(p, seen))
        if effect.dead_time is not None:
            later += float(effect.dead_time(p, seen))
    return Acted(gain * e, gain * w, extra, later)


def foot(hidden: Hidden, dt: float) -> Callable[[float, float], float]:
    """Return what the foot makes of a demand at a time: the causes between the two, each with its own memory."""
    chain: list[tuple[Any, tuple[float, ...], list[Any]]] = [
        (effect.foot, p, []) for effect, p in hidden.effects if effect.foot is not None
    ]
    held: list[float] = []
    coming = list(hidden.episodes)

    def move(demand: float, t: float) -> float:
        for dynamics, p, state in chain:
            if not state:
                state.append(dynamics.init(p, demand))
            state[0], demand = dynamics.step(p, state[0], demand, dt)
        if coming and t >= coming[0][0]:
            if t >= coming[0][1]:
                coming.pop(0)
                held.clear()
            else:
                held[:] = held or [demand]
                return held[0]
        return demand

    return move
