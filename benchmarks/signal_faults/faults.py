"""The faults: what becomes of the sensors' messages, from when on, and which finding or gate names it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from tests.plants.planted_drive import Array
from tests.plants.sensors import Message

Messages = list[Message]
# what is planted: the messages, the onset in s, a source of random numbers
Plant = Callable[[Messages, float, np.random.Generator], Messages]


class Fault(NamedTuple):
    """One fault."""

    name: str
    names: tuple[str, ...]  # of findings or gates that name it rightly
    plant: Plant
    share: float = 0.0  # of the drive, before it begins
    withholds: bool = True  # a signal that the model needs is touched
    gate: bool = False  # a gate of the learning names it, not a finding
    wheel_speed: float = 0.0  # own speed over a wheel speed that is mapped as well; 0: none is
    declared: tuple[str, float] = (
        "",
        1.0,
    )  # a role whose unit the vehicle file states wrongly, and by which factor


def changed(
    role: str, what: Callable[[Array, Array, np.random.Generator], Array], *, without: tuple[str, ...] = ()
) -> Plant:
    """Change one role from the onset on; leave some roles out of the vehicle file."""

    def plant(messages: Messages, at: float, rng: np.random.Generator) -> Messages:
        out = []
        for message in messages:
            values = {name: x for name, x in message.values.items() if name not in without}
            if role in values:
                late = message.t >= at
                x = values[role].copy()
                x[late] = what(message.t[late], x[late], rng)
                values[role] = x
            out.append(message._replace(values=values))
        return out

    return plant


def without(*roles: str) -> Plant:
    """Leave roles out of the vehicle file; nothing else."""
    return changed("", lambda t, x, rng: x, without=roles)


def constant(role: str, value: float | None = None) -> Plant:
    """A value that stands still: a given one, or the last."""
    return changed(role, lambda t, x, rng: np.full_like(x, x[0] if value is None else value))


def both(*plants: Plant) -> Plant:
    """Several at once."""

    def plant(messages: Messages, at: float, rng: np.random.Generator) -> Messages:
        for one in plants:
            messages = one(messages, at, rng)
        return messages

    return plant


def departing(t: Array, x: Array, rng: np.random.Generator) -> Array:
    """A camera's gap: it departs by about 1 m/s, for some ten seconds to either side."""
    steps = np.diff(t, prepend=t[:1])
    rate, rates = 0.0, []
    for dt in steps.tolist():
        rate += -rate * dt / 10.0 + 1.5 * float(np.sqrt(2 * max(dt, 0.0) / 10.0)) * rng.standard_normal()
        rates.append(rate)
    moved: Array = 3.0 + np.abs(x + np.cumsum(np.array(rates) * steps) - 3.0)
    return moved


def of_another(t: Array, x: Array, rng: np.random.Generator) -> Array:
    """The range rate of something else: the same drive backwards."""
    return x[::-1]


def held(role: str, seconds: float) -> Plant:
    """A source that is slower than its message."""

    def repeat(t: Array, x: Array, rng: np.random.Generator) -> Array:
        first = np.searchsorted(t, np.floor(t / seconds) * seconds)
        return x[first]

    return changed(role, repeat)


def bursts(messages: Messages, at: float, rng: np.random.Generator) -> Messages:
    """Frames that wait for 0.3 s in an adapter and are stamped when they are fetched, 1 ms apart."""
    out = []
    for message in messages:
        wait = np.where(message.t >= at, 0.3, 1e-9)
        fetched = (np.floor(message.t / wait) + 1) * wait
        place = np.arange(len(message.t)) - np.searchsorted(fetched, fetched)
        t = np.where(message.t >= at, fetched + 0.001 * place, message.t)
        out.append(message._replace(t=np.maximum.accumulate(t)))
    return out


def late(messages: Messages, at: float, rng: np.random.Generator, *, delay: float) -> Messages:
    """A radar whose reports are stamped late."""
    return [m._replace(t=m.t + delay) if "gap" in m.values else m for m in messages]


def throttle(t: Array, x: Array, rng: np.random.Generator) -> Array:
    """A throttle plate: an idle opening that a controller moves, and the pedal through a lag of 0.2 s."""
    idle = 4.0 + np.convolve(rng.standard_normal(len(t)), np.ones(50) / 10.0, "same")
    lagged = np.empty(len(x))
    y = x[0]
    for k, (dt, value) in enumerate(zip(np.diff(t, prepend=t[0] - 0.02).tolist(), x.tolist(), strict=True)):
        y += min(dt / 0.2, 1.0) * (value - y)
        lagged[k] = y
    opening: Array = np.clip(np.maximum(idle, 0.5) + 0.8 * lagged, 0.0, 100.0)
    return opening


def pulls_away(messages: Messages, at: float, rng: np.random.Generator) -> Messages:
    """The lead drives off at up to 6 m/s more, and nobody follows."""

    def rate(t: Array) -> Array:
        grown: Array = np.clip(0.5 * (t - at), 0.0, 6.0)
        return grown

    def gap(t: Array) -> Array:
        within = np.clip(t - at, 0.0, 12.0)
        return 0.25 * within**2 + 6.0 * np.maximum(t - at - 12.0, 0.0)

    moved = changed("range_rate", lambda t, x, rng: x + rate(t))
    return changed("gap", lambda t, x, rng: np.minimum(x + gap(t), 250.0))(moved(messages, at, rng), at, rng)


FAULTS: tuple[Fault, ...] = (
    Fault("range rate is 0", ("range_rate_dead", "range_rate_frozen"), constant("range_rate", 0.0)),
    Fault(
        "range rate stops at its last value",
        ("range_rate_frozen", "range_rate_dead"),
        constant("range_rate"),
        0.5,
    ),
    Fault("range rate of the wrong sign", ("range_rate_sign",), without(), declared=("range_rate", -1.0)),
    Fault(
        "range rate in km/h declared as m/s", ("range_rate_scale",), without(), declared=("range_rate", 3.6)
    ),
    Fault("gap in feet declared as m", ("range_rate_scale",), without(), declared=("gap", 3.28084)),
    Fault("range rate of another object", ("gap_contradicts_range_rate",), changed("range_rate", of_another)),
    Fault("gap departs, as a camera's", ("gap_contradicts_range_rate",), changed("gap", departing), 0.3),
    Fault("speed in km/h declared as m/s; satellites", ("speed_unit",), without(), declared=("speed", 3.6)),
    Fault(
        "speed in km/h declared as m/s; acceleration",
        ("speed_unit",),
        without("gnss_speed"),
        declared=("speed", 3.6),
    ),
    Fault(
        "speed in km/h declared as m/s; nothing else",
        ("speed_unit",),
        without("gnss_speed", "accel"),
        declared=("speed", 3.6),
    ),
    Fault(
        "speed in mph declared as m/s; satellites", ("speed_unit",), without(), declared=("speed", 2.23694)
    ),
    Fault(
        "speed in mph declared as m/s; acceleration",
        ("speed_unit",),
        without("gnss_speed"),
        declared=("speed", 2.23694),
    ),
    Fault(
        "speed in m/s declared as km/h; acceleration",
        ("speed_unit",),
        without("gnss_speed"),
        declared=("speed", 1 / 3.6),
    ),
    Fault(
        "speed reads 12 % too much; wheel speed",
        ("speed_scale",),
        changed("speed", lambda t, x, rng: x, without=("gnss_speed",)),
        wheel_speed=1.12,
    ),
    Fault("speed stops at its last value", ("speed_frozen", "speed_dead"), constant("speed"), 0.5),
    Fault("gap stops at its last value", ("gap_frozen", "gap_dead"), constant("gap"), 0.5),
    Fault(
        "radar stops at its last report",
        ("gap_frozen", "gap_dead", "range_rate_frozen", "range_rate_dead"),
        both(constant("gap"), constant("range_rate")),
        0.5,
    ),
    Fault(
        "radar's values held for 0.6 s",
        ("gap_repeated", "range_rate_repeated"),
        both(held("gap", 0.6), held("range_rate", 0.6)),
        0.3,
    ),
    Fault("stamps in bursts of 0.3 s", ("stamps_jitter",), bursts, 0.3),
    Fault("radar stamped 0.5 s late", ("radar_latency",), partial(late, delay=0.5)),
    Fault("pedal is a throttle", ("pedal_is_throttle",), changed("pedal", throttle)),
    Fault("lead pulls away", ("FREE_DRIVING",), pulls_away, 0.5, gate=True),
    Fault("reverse gear", ("REVERSE",), changed("gear", lambda t, x, rng: x), 0.5, gate=True),
)
