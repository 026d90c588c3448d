"""Drives of three simulators, measured by three radars, and the signal checks along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from canid.models.simulation import simulate
from canid.signals.samples import stamps
from canid.signals.samples.stamps import StampIntervals
from canid.signals.signal_checks import signal_checks
from canid.values.types import Driver, SignalFinding, SignalReport, Trace
from tests.plants import measurement, plant_one, plant_two
from tests.plants.monitor_runs import samples
from tests.plants.planted_drive import NOISES, PROFILES, Planted
from tests.plants.sensors import Message, sense

# the message of the lean vehicle that carries the radar's reports, by a role in it
RADAR, SPEED, PEDAL = "gap", "speed", "pedal"


class Drive(NamedTuple):
    """What the sensors of a drive say."""

    name: str
    messages: list[Message]
    planted: Planted


def simulated(*, seed: int, minutes: float, noise: str, profile: str) -> Planted:
    """A drive of canid's own simulation, as the plants give theirs."""
    drive = simulate(minutes=minutes, seed=seed, noise=noise, profile=profile)
    columns = dict(drive.columns)
    demand = columns.pop("demand")
    truth = {**drive.truth, "seed": seed, "effects": {}}
    return Planted(drive.dt, columns, demand, columns["noise"], truth)


def planted(seed: int, minutes: float) -> tuple[str, Planted]:
    """Draw a drive: its simulator, noise and profile by the seed, all of them in turn."""
    how: dict[str, Any] = {
        "seed": seed,
        "minutes": minutes,
        "noise": NOISES[seed % len(NOISES)],
        "profile": PROFILES[(seed // len(NOISES) + seed) % len(PROFILES)],
    }
    name = ("one", "two", "canid")[(seed + seed // len(NOISES)) % 3]
    if name == "canid":
        return name, simulated(**how)
    return name, {"one": plant_one.plant, "two": plant_two.plant}[name]({}, **how)


def good(message: Message, rng: np.random.Generator) -> Message:
    """A radar as the sensors draw it: 0.1 to 0.3 m, 0.05 to 0.12 m/s, 20 Hz."""
    return message


def coarse(message: Message, rng: np.random.Generator) -> Message:
    """A radar of 10 Hz in steps of 0.5 m and 0.25 m/s."""
    values = {role: x[::2] for role, x in message.values.items()}
    values["gap"] = np.rint(values["gap"] / 0.5) * 0.5
    values["range_rate"] = np.rint(values["range_rate"] / 0.25) * 0.25
    return message._replace(t=message.t[::2], values=values)


def noisy(message: Message, rng: np.random.Generator) -> Message:
    """A radar with 0.5 m and 0.25 m/s more noise, and one outlier in 500 reports."""
    values = dict(message.values)
    n = len(message.t)
    values["gap"] = values["gap"] + 0.5 * rng.standard_normal(n) + 4.0 * (rng.random(n) < 0.002)
    values["range_rate"] = values["range_rate"] + 0.25 * rng.standard_normal(n)
    return message._replace(values=values)


RADARS: tuple[Callable[[Message, np.random.Generator], Message], ...] = (good, coarse, noisy)


def drive(seed: int, minutes: float, radar: int = 0) -> Drive:
    """Measure a drive.

    Args:
        seed: of the drive and its sensors.
        minutes: of it.
        radar: which of `RADARS`.
    """
    simulator, of = planted(seed, minutes)
    rng = np.random.default_rng([seed, 71])
    car = measurement.lean()
    messages = [
        RADARS[radar](message, rng) if RADAR in message.values else message
        for message in sense(of, car, seed)
    ]
    name = f"{simulator}, {NOISES[seed % len(NOISES)]}, radar {RADARS[radar].__name__}, seed {seed}"
    return Drive(name, messages, of)


def trace(messages: list[Message], output: str = "pedal", declared: tuple[str, float] = ("", 1.0)) -> Trace:
    """Sample what the sensors say.

    Args:
        messages: of the sensors.
        output: role of the driver's output.
        declared: a role whose unit the vehicle file states wrongly, and by which factor.
    """
    car = measurement.lean()
    role, factor = declared
    if role:
        old = car.roles[role]
        low, high = sorted((old.how.low * factor, old.how.high * factor))
        how = old.how._replace(
            factor=old.how.factor * factor, offset=old.how.offset * factor, low=low, high=high
        )
        car = car._replace(roles={**car.roles, role: old._replace(how=how)})
        messages = [
            message._replace(values={**message.values, role: factor * message.values[role]})
            if role in message.values
            else message
            for message in messages
        ]
    return measurement.of_messages(messages, car._replace(driver=car.driver._replace(output=output)))


def intervals(messages: list[Message]) -> Iterator[StampIntervals]:
    """Intervals of the stamps of what the model needs, by time."""
    found: list[StampIntervals] = []
    for message in messages:
        role = next((role for role in (RADAR, SPEED, PEDAL) if role in message.values), None)
        if role is not None:
            _, spans = stamps.step(
                stamps.init(), "gap" if role == RADAR else role, message.t, np.arange(len(message.t))
            )
            found += [span for _, span in spans]
    return iter(sorted(found, key=lambda span: span.t))


def findings(of: Trace, came: Iterator[StampIntervals], output: str = "pedal") -> tuple[SignalFinding, ...]:
    """Run the signal checks along a trace."""
    state, driver = signal_checks.init(), Driver(output=output)
    reports: list[SignalReport] = []
    waiting = next(came, None)
    for sample in samples(of):
        while waiting is not None and waiting.t <= sample.t:
            state, waiting = signal_checks.put(state, waiting), next(came, None)
        state, report = signal_checks.step(state, sample, driver, of.dt)
        reports += [] if report is None else [report]
    return signal_checks.episodes(reports)
