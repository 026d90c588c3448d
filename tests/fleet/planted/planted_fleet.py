"""Layout of a planted fleet: who drives what, when, and what is hidden in it; a function of its seed alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tests.fleet.planted.hidden_population import (
    VALUES,
    Person,
    Spread,
    drives,
    expected,
    people,
    shifted,
    spreads,
)

CARS = ("hatchback", "estate", "van")
GROUPS = ("north", "south")
# "state" is left out: a clean drive with it has a scale that canid names, and rightly so
NOISES = ("white", "ar1", "ar4", "resonant", "mix")
PROFILES, PROFILE_SHARES = ("mixed", "urban", "motorway"), (0.5, 0.25, 0.25)
# canid's own simulator for fewer than half: what suits only that one shows
SIMULATORS, SIMULATOR_SHARES = ("canid", "one", "two"), (0.4, 0.3, 0.3)
# a fault of one car each, at strengths that drives of 10 min of both planting simulators show (docs/evidence/diagnosis.md)
CAR_CAUSES: dict[str, dict[str, dict[str, float]]] = {
    "hatchback": {},
    "estate": {"speed_scale": {"share": 0.03}},
    "van": {"engine_braking": {"strength": 0.6}},
}
# habits of single drivers
DRIVER_CAUSES: tuple[dict[str, dict[str, float]], ...] = (
    {"asymmetric_gain": {"share": 0.35}},
    {"relative_speed_dead_zone": {"width": 0.8}},
)
# both gains of the driver who changes, first to last drive
CHANGE = (1.35, 0.65)
# days from the first drive of the fleet to the last
DAYS = 42
# share of drivers who also drive a second car
SECOND_CAR_SHARE = 0.2
# drives of each clean driver at least: what a pool needs to keep drives and drivers apart
MIN_DRIVES = 4
# drives of the driver who changes: two a week
CHANGED_DRIVES = 12
# 2026-03-02 06:00 UTC
FIRST_DAY_UTC = 1_772_431_200.0

Effects = Mapping[str, Mapping[str, float]]


class Size(NamedTuple):
    """How large a fleet is, and what is hidden in it."""

    drivers: int = 30
    drives: int = 200
    minutes: tuple[float, float] = (3.0, 8.0)
    cars: tuple[str, ...] = CARS
    causes: bool = True  # faults of cars and habits of drivers
    habit_drivers: int = 3  # drivers with each habit
    changed: bool = True  # one driver changes over the weeks
    swapped: bool = True  # two drives lie in each other's folder
    groups_differ: bool = True
    simulators: tuple[str, ...] = SIMULATORS


class Driver(NamedTuple):
    """One driver."""

    name: str
    group: str
    cars: tuple[str, ...]
    person: tuple[float, ...]  # (7,) logarithms of `Person`
    noise: str
    habit: Effects
    changed: bool


class Drive(NamedTuple):
    """One drive."""

    path: str  # CAR/DRIVER/NAME.blf; DRIVER is another one's where the drive is swapped
    driver: str  # who drives
    label: str  # whose folder it lies in
    car: str
    person: Person
    effects: Effects
    start_utc: float
    minutes: float
    simulator: str
    profile: str
    noise: str
    seed: int


class Fleet(NamedTuple):
    """All that is decided before the first drive begins."""

    seed: int
    size: Size
    drivers: tuple[Driver, ...]
    drives: tuple[Drive, ...]


def layout(seed: int, size: Size | None = None) -> Fleet:
    """Lay out a fleet.

    Args:
        seed: of everything that is drawn.
        size: None: 200 drives of 30 drivers in 3 cars.

    Example:
        >>> of = layout(7)
        >>> len(of.drives), len({one.driver for one in of.drives}), of == layout(7)
        (200, 30, True)
    """
    size = size or Size()
    rng = np.random.default_rng([seed, 0])
    drivers = _drivers(size, rng)
    numbers = _numbers(drivers, size, rng)
    made = [
        one
        for driver, number in zip(drivers, numbers, strict=True)
        for one in _drives(driver, number, size, rng)
    ]
    if size.swapped:
        made = _swapped(made, drivers)
    seeds = rng.permutation(10**6)[: len(made)]
    return Fleet(
        seed,
        size,
        tuple(drivers),
        tuple(one._replace(seed=int(s)) for one, s in zip(made, seeds, strict=True)),
    )


def truth(fleet: Fleet) -> dict[str, object]:
    """What a judge needs, as JSON."""
    second = sum(one.group == GROUPS[1] for one in fleet.drivers) / len(fleet.drivers)
    population = spreads(second if fleet.size.groups_differ else 0.0)
    return {
        "seed": fleet.seed,
        "size": fleet.size._asdict(),
        "population": {name: of._asdict() for name, of in population.items()},
        "car_causes": {car: CAR_CAUSES[car] if fleet.size.causes else {} for car in fleet.size.cars},
        "drivers": {
            one.name: {
                "group": one.group,
                "cars": list(one.cars),
                "habit": one.habit,
                "changed": one.changed,
                "expected": expected(np.array(one.person)),
                "driven": _driven(fleet, one.name),
            }
            for one in fleet.drivers
        },
        "drives": {one.path: {**one._asdict(), "person": one.person._asdict()} for one in fleet.drives},
    }


def population_of(truth: Mapping[str, object]) -> dict[str, Spread]:
    """Spreads of the population from the JSON."""
    stored = truth["population"]
    assert isinstance(stored, Mapping)
    return {name: Spread(**of) for name, of in stored.items()}


def _driven(fleet: Fleet, name: str) -> dict[str, float]:
    """Means of the parameters over the drives that the driver has driven."""
    x = np.array([one.person for one in fleet.drives if one.driver == name])
    return {parameter: float(value(x).mean()) for parameter, value in VALUES.items()}


def _drivers(size: Size, rng: np.random.Generator) -> list[Driver]:
    n = size.drivers
    second = rng.permutation(np.arange(n) % 2 == 1)
    logs = people(n, rng)
    if size.groups_differ:
        logs = shifted(logs, second)
    habits: list[Effects] = [{} for _ in range(n)]
    order = rng.permutation(n)
    changed = int(order[0]) if size.changed else -1
    if size.causes:
        at = 1
        for cause in DRIVER_CAUSES:
            for k in order[at : at + size.habit_drivers]:
                habits[k] = cause
            at += size.habit_drivers
    homes = [size.cars[k % len(size.cars)] for k in rng.permutation(n)]
    out = []
    for k in range(n):
        others = [car for car in size.cars if car != homes[k]]
        more = bool(others) and k != changed and rng.uniform() < SECOND_CAR_SHARE
        cars = (homes[k], str(rng.choice(others))) if more else (homes[k],)
        noise = str(rng.choice(NOISES))
        name = f"driver {k + 1:02d}"
        out.append(
            Driver(
                name, GROUPS[int(second[k])], cars, tuple(logs[k].tolist()), noise, habits[k], k == changed
            )
        )
    return out


def _numbers(drivers: list[Driver], size: Size, rng: np.random.Generator) -> list[int]:
    """Number of drives of each driver."""
    least = min(MIN_DRIVES, size.drives // size.drivers)
    most = min(CHANGED_DRIVES, size.drives - least * (len(drivers) - 1))
    numbers = [most if one.changed else least for one in drivers]
    open_to_more = [k for k, one in enumerate(drivers) if not one.changed]
    for k in rng.choice(open_to_more, size.drives - sum(numbers)):
        numbers[k] += 1
    return numbers


def _drives(driver: Driver, number: int, size: Size, rng: np.random.Generator) -> list[Drive]:
    days = np.sort(rng.uniform(0.0, DAYS, number))
    if driver.changed:
        days = np.linspace(0.0, DAYS - 1.0, number)
    factors = np.linspace(*CHANGE, number) if driver.changed else np.ones(number)
    persons = drives(np.array(driver.person), number, rng)
    shares = np.array([SIMULATOR_SHARES[SIMULATORS.index(name)] for name in size.simulators])
    out = []
    for k, (day, factor) in enumerate(zip(days.tolist(), factors.tolist(), strict=True)):
        person = Person(*persons[k].tolist())
        person = person._replace(K1=person.K1 * factor, K2=person.K2 * factor)
        # every third drive in the second car
        car = driver.cars[1] if len(driver.cars) > 1 and k % 3 == 2 else driver.cars[0]
        fault = CAR_CAUSES[car] if size.causes else {}
        name = f"drive {k + 1:02d}.blf"
        out.append(
            Drive(
                path=f"{car}/{driver.name}/{name}",
                driver=driver.name,
                label=driver.name,
                car=car,
                person=person,
                effects={**fault, **driver.habit},
                start_utc=round(FIRST_DAY_UTC + 86400.0 * day),
                minutes=round(float(rng.uniform(*size.minutes)), 2),
                simulator=str(rng.choice(size.simulators, p=shares / shares.sum())),
                profile=str(rng.choice(PROFILES, p=PROFILE_SHARES)),
                noise=driver.noise,
                seed=0,
            )
        )
    return out


def _swapped(made: list[Drive], drivers: list[Driver]) -> list[Drive]:
    """Put one drive each of two unlike clean drivers of one car into the other one's folder."""
    clean = [one for one in drivers if not one.habit and not one.changed]
    pairs = [(a, b) for i, a in enumerate(clean) for b in clean[i + 1 :] if a.cars[0] == b.cars[0]]
    if not pairs:
        return made

    def apart(pair: tuple[Driver, Driver]) -> float:
        # of both gains' logarithms: what a drive of some minutes shows
        return float(np.abs(np.array(pair[0].person[:2]) - np.array(pair[1].person[:2])).sum())

    pair = max(pairs, key=apart)
    out = list(made)
    places = [
        next(k for k, one in enumerate(made) if one.driver == of.name and one.car == of.cars[0])
        for of in pair
    ]
    i, j = places
    out[i] = made[i]._replace(path=made[j].path, label=made[j].label)
    out[j] = made[j]._replace(path=made[i].path, label=made[i].label)
    return out
