"""The closed loop: lead, driver, pedal, car, road; and what else happens on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from tests.plants.plant_one import car as cars
from tests.plants.plant_one import driver as drivers
from tests.plants.plant_one import episodes, lead, remnant, strengths
from tests.plants.plant_one.car import Car
from tests.plants.plant_one.driver import Driver
from tests.plants.plant_one.episodes import Episodes
from tests.plants.plant_one.pedal_dynamics import PedalDynamics, pedal_dynamics
from tests.plants.plant_one.uneven_remnant import UNEVEN, stepwise
from tests.plants.planted_drive import EFFECTS, NOISES, OUTSIDE, PROFILES, Array, Planted

DT = 0.02  # s
NAME = "plant_one"
MIN_MINUTES = 1.0  # min
# s, lengths of what lasts for a while; `attention_gap` and `cruise_control` have their own
EPISODE_LENGTHS_S = {
    "gear_shift": (0.4, 1.0),
    "cut_in": (2.0, 2.0),
    "brake_overlap": (0.6, 2.5),
    "stale_signal": (2.0, 10.0),
}
ATTENTION_GAP_S = (1.5, 6.0)  # the shortest and the longest
CUTTER = (
    0.5,
    2.0,
    4.0,
)  # m/s by which the vehicle that cuts in is slower at first (from, to), and s until it is not
VEHICLE = 5.0  # m, length of the vehicle that cuts in with the gap that it needs
TWO_FEET = 5.0  # % of brake pressed while the other foot is on the accelerator
# s, s: a driver brakes as hard as possible rather than touch the lead; far outside of what following needs
EMERGENCY_HEADWAY, EMERGENCY_CONTACT = 0.35, 1.2
EMERGENCY = 50.0  # % of brake
# of the remnant that grows with the answer: what remains at rest, and the answer at which it is as large as others
STATE_REST, STATE_SIZE = 0.35, 6.0
HILL_LENGTHS_M = (300.0, 2500.0)  # m, lengths of the road's waves
# 1/s², 1/s, s, m: a cruise controller with a constant time gap (ISO 15622 asks for no more)
CRUISE_GAP, CRUISE_RATE, CRUISE_HEADWAY, CRUISE_REST = 0.06, 0.45, 1.6, 3.0


class Driven(NamedTuple):
    """One drive, and the driver once more along it."""

    columns: dict[str, Array]
    demand: Array  # (n,) %
    remnant: Array  # (n,) %
    emergency: float  # s of emergency braking
    again: Callable[[str], Array]  # effect -> (n,) % of demand along this very trajectory without it


class Drawn(NamedTuple):
    """All that the seed decides before the first step."""

    driver: Driver
    car: Car
    effects: dict[str, dict[str, float]]
    episodes: dict[str, Episodes]


def plant(
    effects: Mapping[str, Mapping[str, float]],
    *,
    seed: int,
    minutes: float,
    noise: str,
    profile: str,
    **changes: float,
) -> Planted:
    """Plant effects in a drive; see `tests.plants.planted_drive.Plant`.

    Args:
        effects: id -> {parameter: value}; what is left out is drawn by the seed.
        seed: the same seed gives the same drive; driver, car, road and lead do not change with the effects.
        minutes: at least 1.
        noise: of `NOISES`.
        profile: of `PROFILES`.
        changes: numbers of the driver or the car by their names (K1, dead_time2, grade_sd, ...).

    Raises:
        ValueError: a name that is not known.

    Example:
        >>> drive = plant({"asymmetric_gain": {"share": 0.3}}, seed=1, minutes=1, noise="ar1", profile="mixed")
        >>> drive.columns["pedal"].shape, drive.truth["effects"]
        ((3000,), {'asymmetric_gain': {'share': 0.3}})
    """
    strengths.check(effects)
    if noise not in NOISES:
        raise ValueError(f"noise {noise!r} is not one of {', '.join(NOISES)}")
    if profile not in PROFILES:
        raise ValueError(f"profile {profile!r} is not one of {', '.join(PROFILES)}")
    if not minutes >= MIN_MINUTES:
        raise ValueError(f"minutes must be at least {MIN_MINUTES:g}, not {minutes}")
    n = round(60.0 * minutes / DT)
    ahead = lead.speed(profile, n, DT, _rng(seed, "lead"))
    car = cars.draw(_rng(seed, "car"))
    driver = drivers.draw(_rng(seed, "driver"))
    unknown = sorted(set(changes) - set(Car._fields) - set(Driver._fields))
    if unknown:
        raise ValueError(f"changes {', '.join(unknown)} are not known")
    car = car._replace(**{k: float(v) for k, v in changes.items() if k in Car._fields})
    driver = driver._replace(offset=car.hold(float(ahead.mean())))
    driver = driver._replace(**{k: float(v) for k, v in changes.items() if k in Driver._fields})
    if "grade_sd" not in changes:
        car = car._replace(grade_sd=min(car.grade_sd, _steepest(driver, car, lead.ROADS[profile].low)))

    def pedal() -> Array:
        others = {name: given for name, given in effects.items() if name != "pedal_ceiling"}
        free = plant(others, seed=seed, minutes=minutes, noise=noise, profile=profile, **changes)
        return free.columns["pedal"]

    settled = {
        name: strengths.settle(
            name, given, strengths.Scene(_rng(seed, name), profile, 60.0 * minutes, car, pedal)
        )
        for name, given in effects.items()
    }
    if "road_grade" in settled:
        car = car._replace(grade_sd=settled["road_grade"]["sd"])
    happens = {
        name: _episodes(name, how, minutes, _rng(seed, name + " when")) for name, how in settled.items()
    }
    drawn = Drawn(driver, car, settled, {name: when for name, when in happens.items() if when})
    driven = _drive(drawn, ahead, seed, noise)
    truth: dict[str, Any] = {
        "simulator": NAME,
        "seed": seed,
        "profile": profile,
        "noise": noise,
        "minutes": minutes,
        "driver": driver._asdict(),
        "car": car._asdict(),
        "effects": settled,
        "episodes": drawn.episodes,
        "emergency": driven.emergency,
    }
    without = {name: driven.again(name) for name in settled if name in EFFECTS["driver"] + OUTSIDE}
    return Planted(DT, driven.columns, driven.demand, driven.remnant, truth, without)


def _rng(seed: int, purpose: str) -> np.random.Generator:
    """One stream of chance for each purpose: another effect does not change the road."""
    return np.random.default_rng([seed, *NAME.encode(), *purpose.encode()])


def _steepest(driver: Driver, car: Car, slowest: float) -> float:
    """Slope, sd in %, that leaves this driver 0.6 s of headway at the bottom of a hill at the slowest speed.

    The driver answers a slope through the headway alone: with low gains, on hills, the car would run into its lead.
    """
    room = driver.K1 * (driver.headway_desired - 0.6) - (driver.offset - car.hold(slowest))
    # waves of sd 1 reach 2.2 now and then
    return max(room * car.power / (2.2 * 0.01 * cars.GRAVITY), 0.0)


def _episodes(name: str, how: Mapping[str, float], minutes: float, rng: np.random.Generator) -> Episodes:
    """Draw when an effect happens; none for what is always there."""
    if name == "cruise_control":
        number = 1 if minutes < 5.0 else 2
        each = how["share"] * 60.0 * minutes / number
        return episodes.draw(minutes, number, (0.9 * each, 1.1 * each), DT, rng)
    if name == "attention_gap":
        length = (
            max(0.6 * how["duration"], ATTENTION_GAP_S[0]),
            min(1.4 * how["duration"], ATTENTION_GAP_S[1]),
        )
    elif name in EPISODE_LENGTHS_S:
        length = EPISODE_LENGTHS_S[name]
    else:
        return []
    return episodes.draw(minutes, how["per_minute"] * minutes, length, DT, rng)


def _road(n: int, sd: float, longest: float, rng: np.random.Generator) -> list[float]:
    """Draw the slope in % at every metre up to `longest` m: four waves."""
    x = np.arange(int(longest) + 2.0)
    waves = [
        np.sin(2.0 * math.pi * (x / length + phase))
        for length, phase in zip(rng.uniform(*HILL_LENGTHS_M, 4), rng.uniform(size=4), strict=True)
    ]
    slope: list[float] = (sd * math.sqrt(0.5) * np.sum(waves, axis=0)).tolist()
    return slope


def _cut_in(ahead: Array, when: Episodes, rng: np.random.Generator) -> Array:
    """Who cuts in is slower at first and then drives as the lead does."""
    t = np.arange(len(ahead)) * DT
    out = ahead.copy()
    for start, _ in when:
        after = t - start
        slower = rng.uniform(*CUTTER[:2])
        out -= np.where(after >= 0.0, slower * np.exp(-np.maximum(after, 0.0) / CUTTER[2]), 0.0)
    return np.maximum(out, lead.MIN_SPEED_M_S)


def _drive(drawn: Drawn, ahead: Array, seed: int, noise: str) -> Driven:
    """Close the loop. Plain floats: numpy's are ten times slower one by one."""
    driver, car, effects, happens = drawn
    n = len(ahead)
    still = [happens.get(name, []) for name in ("cruise_control", "gear_shift", "brake_overlap", "cut_in")]
    cruising, shifting, overlapping = (episodes.inside(when, n, DT).tolist() for when in still[:3])
    cuts = {round(start / DT) for start, _ in still[3]}
    foreign = _cut_in(ahead, still[3], _rng(seed, "cutter")) if cuts else ahead
    vl = foreign.tolist()
    # by the legs alone: a vehicle that appears has not braked to its speed
    lead_accel = np.gradient(foreign, DT)
    for k in cuts:
        lead_accel[k - 1 : k + 1] = lead_accel[k + 1]
    hidden = (
        drivers.curves(n, DT, _rng(seed, "curves")).tolist() if "speed_wander_bias" in effects else [0.0] * n
    )
    world = drivers.World([], [], [], [], lead_accel.tolist(), hidden)

    def person(has: Mapping[str, Mapping[str, float]]) -> tuple[Callable[[int], float], PedalDynamics]:
        """The driver with these effects, from the start: the answer in `world`, and the pedal dynamics."""
        wanted = np.full(n, driver.headway_desired)
        if "headway_drift" in has:
            wanted += drivers.random_walk(n, DT, has["headway_drift"]["sd"], _rng(seed, "wander"))
        held = episodes.inside(happens["attention_gap"] if "attention_gap" in has else [], n, DT)
        phase = float(_rng(seed, "phase").uniform())
        return drivers.answerer(driver, has, world, wanted.tolist(), DT, n), pedal_dynamics(
            has, held, DT, phase
        )

    def again(name: str) -> Array:
        answer, pedal_of = person({other: how for other, how in effects.items() if other != name})
        return np.array([pedal_of(k, answer(k), 0.0) for k in range(n)])

    answer, quiet = person(effects)
    _, noisy = person(effects)
    e = (driver.noise_sd * remnant.unit(noise, n, DT, _rng(seed, "remnant"))).tolist()
    uneven = {name: how for name, how in effects.items() if name in UNEVEN}
    stepping = stepwise(noise, n, DT, uneven, _rng(seed, "uneven")) if uneven else None
    grows = noise == "state"
    gust = (car.gust_sd * remnant.unit("ar1", n, DT, _rng(seed, "gust"))).tolist()
    slope = _road(n, car.grade_sd, 1.3 * float(ahead.sum()) * DT + 500.0, _rng(seed, "road"))
    steps = cars.mover(car, effects, DT)

    v, rest = vl[0], car.hold(vl[0])
    gap = v * max(driver.headway_desired + (rest - driver.offset) / driver.K1, 0.6)
    x, way, accel = cars.begin(v, rest), 0.0, 0.0
    out = {role: np.zeros(n) for role in ("pedal", "accel", "brake", "grade")}
    pedals, accels, brakes, grades = out.values()
    demand, remnants, panic = np.empty(n), np.empty(n), 0
    for k in range(n):
        v = x.v
        if k in cuts:
            gap = max(min(effects["cut_in"]["share"] * gap, gap - VEHICLE), 0.4 * gap)
        rate = vl[k] - v
        world.headway.append(gap / (v if v > drivers.MIN_SPEED_M_S else drivers.MIN_SPEED_M_S))
        world.range_rate.append(rate)
        world.gap.append(gap)
        world.speed.append(v)
        wanted_pedal = answer(k)
        own = e[k] if stepping is None else driver.noise_sd * stepping(accel, world.lead_accel[k])
        r = (
            own * (STATE_REST + (1.0 - STATE_REST) * abs(wanted_pedal - driver.offset) / STATE_SIZE)
            if grows
            else own
        )
        demand[k], remnants[k] = quiet(k, wanted_pedal, 0.0), r
        u = noisy(k, wanted_pedal, r)
        pedal = min(max(u, 0.0), 100.0)
        brake, engine, coupled = max(-u - car.slack, 0.0), pedal, 1.0
        pressed = brake > 0.0
        if gap < EMERGENCY_HEADWAY * v or gap < -EMERGENCY_CONTACT * rate:
            pedal, engine, brake, pressed = 0.0, 0.0, max(brake, EMERGENCY), True
            panic += 1
        elif cruising[k]:
            a = CRUISE_GAP * (gap - CRUISE_REST - CRUISE_HEADWAY * v) + CRUISE_RATE * rate
            asked = a / car.power + car.hold(v)
            pedal, engine, brake, pressed = 0.0, min(max(asked, 0.0), 60.0), max(-asked, 0.0) / 3.0, False
        elif shifting[k]:
            pedal, engine, coupled, brake, pressed = 0.0, 0.0, 0.0, 0.0, False
        elif overlapping[k]:
            brake, pressed = brake + TWO_FEET, True
        here = int(way)
        grade = slope[here] + (way - here) * (slope[here + 1] - slope[here])
        x, accel = steps(x, engine, brake, coupled, grade, gust[k])
        pedals[k], accels[k], brakes[k], grades[k] = pedal, accel, pressed, grade
        way += 0.5 * DT * (v + x.v)
        gap += 0.5 * DT * (rate + vl[k + 1 if k + 1 < n else k] - x.v)
    speed = np.array(world.speed)
    columns = {
        "t": np.arange(n) * DT,
        "speed": speed,
        "gap": np.array(world.gap),
        "range_rate": np.array(world.range_rate),
        **out,
        "lead_valid": np.ones(n),
        "cruise_active": np.array(cruising, dtype=float),
        "clutch": np.array(shifting, dtype=float),
        **_beside(speed, out["grade"], np.array(shifting), bool(still[1])),
    }
    return Driven(columns, demand, remnants, round(panic * DT, 3), again)


def _beside(speed: Array, grade: Array, shifting: Array, manual: bool) -> dict[str, Array]:
    """Compute what else the car measures; nothing of it feeds back."""
    gear = np.searchsorted(cars.SHIFT, speed, side="right")
    if manual:
        # a driver changes gear only with the clutch pressed: the gear in between is that of the last time
        last = np.maximum.accumulate(np.where(shifting, np.arange(len(speed)), 0))
        gear = gear[last]
    return {
        "altitude": 120.0 + np.cumsum(speed * 0.01 * grade) * DT,
        "gnss_speed": speed.copy(),
        "gear": gear + 1.0,
        "engine_speed": np.maximum(np.array(cars.RPM)[gear] * speed, cars.IDLE),
    }
