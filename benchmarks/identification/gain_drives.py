"""Drives whose driver's gains step, and clean ones, with what the live estimators say along them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.identification import acceleration, bus, loop_a, loop_b
from benchmarks.identification.loops import NORMAL, Gain, Lead, constant
from benchmarks.identification.noise_models import HEAVY_TAILED, NOISE_MODELS, NoiseModel
from canid.mathematics.estimators import ESTIMATORS, agreement, status
from canid.values.types import Driver, Estimate, LearnGate, OutputFilter, Sample

NAMES = ("headway_error", "range_rate")
SIX_NOISES = (*NOISE_MODELS, HEAVY_TAILED)
# how the accelerations of public data come about
PUBLISHED = acceleration.Measured("Savitzky-Golay 1.1 s", "savitzky_golay", 1.1, 0.003)


class World(NamedTuple):
    """One plant, its lead and its noise."""

    name: str
    plant: str  # "A", "B" or "acceleration"
    lead: Lead = NORMAL
    noise: NoiseModel = NOISE_MODELS[3]


class Seen(NamedTuple):
    """A drive as the estimators get it."""

    samples: bus.Seen
    K2: float  # before any change
    output_filter: OutputFilter | None


def stepped(t: np.ndarray, at: float, factor: float) -> np.ndarray:
    """Return the factor on the gains of a driver who steps once."""
    return np.where(t < at, 1.0, factor)


def drive(world: World, seed: int, seconds: float, gain: Gain = constant) -> Seen:
    """Draw a drive and put it on a bus."""
    if world.plant == "acceleration":
        made = acceleration.drive(seed, seconds / 60.0, world.noise, gain=gain)
        output = acceleration.published(made, PUBLISHED, seed)
        n = len(output)
        samples = bus.Seen(
            output, made.inputs, np.full(n, True), np.zeros(n, dtype=np.int64), np.full(n, np.nan)
        )
        return Seen(samples, made.channels[1].K, OutputFilter(PUBLISHED.kind, PUBLISHED.width))  # type: ignore[arg-type]
    if world.plant == "A":
        found = loop_a.drive(seed, seconds, lead=world.lead, noise_model=world.noise, gain=gain)
    else:
        found = loop_b.drive(seed, seconds, lead=world.lead, gain=gain)
    samples = bus.through_canid(bus.sensed(found, seed), Driver(headway_desired=found.headway_desired))
    return Seen(samples, found.channels[1].K, None)


def estimates(seen: Seen, since: float, names: tuple[str, ...] = ("fopdt", "armax")) -> Iterator[Estimate]:
    """Run the live estimators; yields their checked estimates from `since` s on, and all that report a change.

    Before, only those are made that later ones rest on (canid.mathematics.estimators.windows).
    """
    running = []
    for one in ESTIMATORS:
        if one.name in names:
            settings = one.settings()
            if hasattr(settings, "output_filter"):
                settings = settings._replace(output_filter=seen.output_filter)
            running.append(one.make(NAMES, bus.GRID, settings))
    states, agreed = [one.init() for one in running], agreement.State()
    emitted = [float("nan")] * len(running)
    for k, (y, u, learn, segment, bound) in enumerate(zip(*(x.tolist() for x in seen.samples), strict=True)):
        t = round(k * bus.GRID, 6)
        gate = LearnGate.OPEN if learn else LearnGate.PEDAL_FLOOR
        sample = Sample(t, y, tuple(u), gate, learn, segment, {}, bound)
        made = []
        for i, one in enumerate(running):
            states[i], due = one.advance(states[i], sample)
            if not due:
                continue
            report = status.reported(status.Pace(emitted=emitted[i]), t)
            emitted[i] = t
            watch = getattr(states[i], "watch", None)
            if report or t >= since or (watch is not None and watch.new):
                states[i], estimate = one.estimate(states[i], sample)
                made.append(estimate)
        agreed, checked = agreement.step(agreed, made)
        yield from checked


class Followed(NamedTuple):
    """What became of one step."""

    held: float  # s until the headline's interval holds the new K2 for `HELD_S`; inf: never
    detected: float  # s; inf: not
    error: float  # s, of the time of the change; NaN: not detected
    inside: bool  # the interval of the time holds the truth
    after: bool  # the interval of K2 after the change holds the truth
    early: int  # alarms before the change


# s in which the interval must hold without a break: crossing by chance is no following
HELD_S = 5.0
STEP_AT_S, AFTER_S = 150.0, 60.0


def step_time(seed: int) -> float:
    """Draw when the gains step, s."""
    return STEP_AT_S + float(np.random.default_rng([seed, 7]).uniform(0.0, 20.0))


def follow(seed: int, world: World, factor: float) -> Followed:
    """Let the gains step by a factor."""
    at = step_time(seed)
    seen = drive(world, seed, at + AFTER_S, partial(stepped, at=at, factor=factor))
    truth = seen.K2 * factor
    first, held, began = np.inf, np.inf, np.nan
    error, inside, after, early = np.nan, False, False, 0
    for e in estimates(seen, at):
        if e.change is not None and e.change.new:
            if e.t < at:
                early += 1
            elif not np.isfinite(first):
                first, error = e.t - at, e.change.t.value - at
                # grid of one second
                inside = e.change.t.low - 1.0 <= at <= e.change.t.high + 1.0
                K = e.change.after["range_rate"]
                after = K.low <= truth <= K.high
        if e.t >= at and e.headline and not np.isfinite(held):
            K = e.channels["range_rate"].K
            holds = K.low <= truth <= K.high
            began = (began if began == began else e.t - at) if holds else np.nan
            if e.t - at - began >= HELD_S:
                held = began
    return Followed(held, first, error, inside, after, early)


def false_alarms(seed: int, world: World, seconds: float) -> int:
    """Count the alarms on a clean drive."""
    seen = drive(world, seed, seconds)
    return sum(e.change is not None and e.change.new for e in estimates(seen, np.inf, ("fopdt",)))
