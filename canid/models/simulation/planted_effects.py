"""Effects of the catalogue in a simulated drive: the same definitions that the diagnosis fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.models.effects.effect import Effect, Kind, Seen, SensorValues, Share, VehicleState
from canid.values.types import Array

# effects that can be planted by name alone: at one of their strengths `found_at`
PLANTABLE = tuple(dict.fromkeys(e.id for e in (*CATALOGUE, *LANE_CATALOGUE) if e.found_at))
# and those that can be planted with their parameters given
WITH_NUMBERS = tuple(
    dict.fromkeys(e.id for e in (*CATALOGUE, *LANE_CATALOGUE) if e.found_at or e in LANE_CATALOGUE)
)
# mean over top speed of the lead's profiles, and top level over the pedal that holds the mean speed: about what drives
# of 5 min show
MEAN_SPEED_SHARE, TOP_PEDAL_FACTOR = 0.65, 2.2
# s; mean time from one episode of a mask to the next
EPISODE_SPACING_S = 60.0


class Shares(NamedTuple):
    """A strength as in `Effect.found_at`: some of its numbers are shares of the drive's duration, speed or pedal."""

    values: tuple[float, ...]


Strength = Sequence[float] | Shares | None


class Placed(NamedTuple):
    """One effect in one drive."""

    effect: Effect
    params: tuple[float, ...]  # what its hooks get
    episodes: tuple[tuple[float, float], ...] = ()  # s, [start, stop)


class Planted(NamedTuple):
    """All effects of one drive."""

    placed: tuple[Placed, ...]
    truth: dict[str, Any]  # as JSON

    def of(self, where: str) -> tuple[Placed, ...]:
        """Effects of one block that act in the loop."""
        return tuple(p for p in self.placed if p.effect.where == where and p.effect.kind is not Kind.MASK)


def plant(
    hide: Mapping[str, Strength],
    duration: float,
    speed: float,
    hold: float,
    rng: np.random.Generator,
    catalogue: tuple[Effect, ...] = CATALOGUE,
) -> Planted:
    """Prepare what is planted.

    Args:
        hide: id -> parameters in the catalogue's order; None or empty: a strength that the drive must show. Of a mask:
            the duration of its episodes in s, and what more its `imitate` takes.
        duration: s.
        speed: m/s, the drive's mean.
        hold: %, the pedal that holds it.
        rng: source of random numbers.
        catalogue: effects that can be planted.

    Raises:
        ValueError: an unknown effect, one without a strength to be planted at, or too many numbers.

    Example:
        >>> first = CATALOGUE[0]
        >>> planted = plant({first.id: (0.25,)}, 600.0, 20.0, 7.0, np.random.default_rng(1))
        >>> planted.truth[first.id] == {first.parameters[0].name: 0.25}
        True
    """
    by_id = {effect.id: effect for effect in catalogue}
    scale = {
        Share.DURATION: duration,
        Share.TOP_SPEED: speed / MEAN_SPEED_SHARE,
        Share.TOP_PEDAL: TOP_PEDAL_FACTOR * hold,
    }
    placed, truth = list[Placed](), dict[str, Any]()
    for name, given in hide.items():
        if name not in by_id or not (given or by_id[name].found_at):
            able = ", ".join(effect.id for effect in catalogue if effect.found_at)
            raise ValueError(f"{name!r} cannot be hidden; choose from {able}")
        placement, truth[name] = _placed(by_id[name], given, scale, rng)
        placed.append(placement)
    return Planted(tuple(placed), truth)


def _placed(
    effect: Effect, given: Strength, scale: Mapping[Share, float], rng: np.random.Generator
) -> tuple[Placed, dict[str, Any]]:
    """Place one effect, and its truth as JSON."""
    default = effect.found_at[int(rng.integers(len(effect.found_at)))] if effect.found_at else ()
    default = given.values if isinstance(given, Shares) else default
    values = () if isinstance(given, Shares) else tuple(given or ())
    if effect.kind is Kind.MASK:
        numbers = (*values, *default[len(values) :])
        episodes = _episodes(numbers[0], scale[Share.DURATION], rng)
        return Placed(effect, numbers[1:], episodes), {"duration": numbers[0], "episodes": _json(episodes)}
    if len(values) > len(effect.parameters):
        names = ", ".join(f"{p.name} ({p.unit})" for p in effect.parameters)
        raise ValueError(f"{effect.id} takes {len(effect.parameters)} numbers, not {len(values)}: {names}")
    usual = [
        (default[k] if k < len(default) else 0.0) * (1.0 if p.share_of is None else scale[p.share_of])
        for k, p in enumerate(effect.parameters)
    ]
    full = (*(float(x) for x in values), *(float(x) for x in usual[len(values) :]))
    truth: dict[str, Any] = {p.name: x for p, x in zip(effect.parameters, full, strict=True)}
    if effect.draw is None:
        return Placed(effect, full), truth
    drawn = effect.draw(full, scale[Share.DURATION], rng)
    if drawn.episodes:
        truth["episodes"] = _json(drawn.episodes)
    return Placed(effect, drawn.params, drawn.episodes), truth


def _json(episodes: tuple[tuple[float, float], ...]) -> list[list[float]]:
    return [list(episode) for episode in episodes]


def _episodes(length: float, duration: float, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Draw episodes of one duration: the time between them varies by a half to either side."""
    t, out = EPISODE_SPACING_S * rng.uniform(0.5, 1.0), []
    while t + length < duration:
        out.append((round(float(t), 2), round(float(t + length), 2)))
        t += length + EPISODE_SPACING_S * rng.uniform(0.5, 1.5)
    return tuple(out)


class Perceived(NamedTuple):
    """What the driver acts on at one instant."""

    e: float  # s, headway error times the gains' factor
    w: float  # m/s
    extra: float  # %
    later: float  # s, added to both dead times


def perceive(driver: tuple[Placed, ...], e: float, w: float, seen: Seen) -> Perceived:
    """Apply the effects on the driver's inputs, gains and dead times.

    Example:
        >>> perceive((), -0.5, 1.0, Seen(0.0, 600.0, 1.5, 1.0, 30.0, 20.0, 0.0))
        Perceived(e=-0.5, w=1.0, extra=0.0, later=0.0)
    """
    extra = later = 0.0
    gain = 1.0
    for effect, p, _ in driver:
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
    return Perceived(gain * e, gain * w, extra, later)


def pedal_dynamics(driver: tuple[Placed, ...], dt: float) -> Callable[[float], float]:
    """Return the dynamics from demand to pedal; episodes come last, as they override everything."""
    chain: list[tuple[Any, tuple[float, ...], list[Any]]] = [
        (placement.effect.pedal, placement.params, [])
        for placement in sorted(driver, key=lambda placement: bool(placement.episodes))
        if placement.effect.pedal is not None
    ]

    def move(demand: float) -> float:
        for dynamics, p, state in chain:
            if not state:
                state.append(dynamics.init(p, demand))
            state[0], demand = dynamics.step(p, state[0], demand, dt)
        return demand

    return move


class Engine(NamedTuple):
    """What the effects on the vehicle make of its engine at one instant."""

    given: float  # %, what the engine gives
    push: float  # m/s²


def engine(
    vehicle: tuple[Placed, ...], first: float, strength: float, lag_decay: float, dt: float
) -> Callable[[float, VehicleState], Engine]:
    """Return the engine with its effects, a function of pedal and state that keeps its lags.

    Args:
        vehicle: effects with `vehicle` hooks.
        first: %, the pedal at the start.
        strength: m/s² per %.
        lag_decay: of the engine's own lag over one step.
        dt: s.
    """
    hooks = [
        (placement.effect.vehicle, placement) for placement in vehicle if placement.effect.vehicle is not None
    ]
    lags = [(hook.lag, placement.params) for hook, placement in hooks if hook.lag is not None]
    lagged = [first] * (1 + len(lags))

    def step(pressed: float, state: VehicleState) -> Engine:
        for hook, placement in hooks:
            if hook.pedal is not None:
                pressed = float(hook.pedal(placement.params, pressed))
        lagged[0] = x = lag_decay * lagged[0] + (1 - lag_decay) * pressed
        state = state._replace(lagged_pedal=x, strength=strength)
        for k, (lag, p) in enumerate(lags, start=1):
            decay = float(np.exp(-dt / max(float(lag(p, state)), 1e-4)))
            lagged[k] = x = decay * lagged[k] + (1 - decay) * x
        state = state._replace(lagged_pedal=x)
        push = 0.0
        for hook, placement in hooks:
            if hook.thrust is not None:
                x = float(hook.thrust(placement.params, x, state))
            if hook.push is not None and placement.effect.slope_sd is None:
                push += float(hook.push(placement.params, state))
        return Engine(x, push)

    return step


def slope_sd(vehicle: tuple[Placed, ...], usual: float) -> float:
    """Standard deviation of the road's slope, %: an effect's own, or the usual one."""
    slopes = [
        placement.effect.slope_sd(placement.params)
        for placement in vehicle
        if placement.effect.slope_sd is not None
    ]
    return slopes[-1] if slopes else usual


def measured(planted: Planted, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns as the sensors report them where effects change that; {} without any.

    Args:
        planted: sensing effects and masks are applied.
        columns: "t" and role -> (n,), as they truly were.
    """
    sensing = planted.of("sensing")
    masks = [placement for placement in planted.placed if placement.effect.kind is Kind.MASK]
    if not sensing and not masks:
        return {}
    t = columns["t"]
    sensors = SensorValues(
        t, float(t[-1]), columns["gap"], columns["range_rate"], columns["speed"], np.zeros(t.size)
    )
    for placement in sensing:
        if placement.effect.sense is not None:
            sensors = placement.effect.sense(placement.params, sensors)
    reported = {role: np.interp(t - sensors.age, t, getattr(sensors, role)) for role in ("gap", "range_rate")}
    out = {role: x.copy() for role, x in columns.items()} | reported | {"speed": sensors.speed + 0.0 * t}
    for placement in masks:
        for start, stop in placement.episodes:
            at = slice(int(np.searchsorted(t, start)), int(np.searchsorted(t, stop)))
            if placement.effect.imitate is not None:
                placement.effect.imitate(out, at, placement.params)
    return {role: x for role, x in out.items() if not np.array_equal(x, columns[role], equal_nan=True)}
