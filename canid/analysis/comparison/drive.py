"""Data types of a comparison: a drive as `identify` or `diagnose` describes it, and a side of several of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from canid.values.types import NAN, Array, Interval

# fields of a channel that are compared, in the order in which they are shown
FIELDS = ("K", "tau", "dead_time", "tau_plus_dead_time")


class Quantity(NamedTuple):
    """One parameter of one drive."""

    value: Interval
    unit: str  # "" of a number without one
    why: str = ""  # not empty: it may not be compared, and why


class Draws(NamedTuple):
    """Draws of the joint posterior of a driver with two inputs; columns in the order of `inputs`."""

    inputs: tuple[str, ...]
    K: Array  # (n, 2)
    tau: Array  # (n, 2) s
    dead_time: Array  # (n, 2) s


class Loop(NamedTuple):
    """Where and with which car the loop of driver and car was computed."""

    speed: float  # m/s
    headway: float  # s
    car: (
        tuple[float, float, float] | None
    )  # strength, lag, damping; None: the output is the acceleration itself
    covariance: Array  # (3, 3) of these


class Correlation(NamedTuple):
    """Of the errors of several parameters of one drive."""

    names: tuple[str, ...]
    matrix: Array  # (n, n)


class Level(NamedTuple):
    """A parameter over the drive."""

    name: str  # "range_rate K"
    t: Array  # (n,) s
    level: Array  # (n,)
    low: Array  # (n,) 95 % band
    high: Array  # (n,)
    p_value: float  # of a constant level
    variation: float  # sd of the level over the drive


class Effect(NamedTuple):
    """A cause that a diagnosis named."""

    name: str
    where: str
    rivals: tuple[str, ...]
    surrogate: bool
    parameters: Mapping[str, Quantity]


class Causes(NamedTuple):
    """What a diagnosis says of causes."""

    verdict: str
    effects: tuple[Effect, ...]
    shown: Mapping[
        str, tuple[str, float, str]
    ]  # effect -> parameter, strength that would be named 9 times of 10, unit
    not_testable: frozenset[str]


class DriveEstimates(NamedTuple):
    """One drive."""

    name: str
    method: str  # "identify" or "diagnose"
    vehicle: str
    output: str  # role; "": not stated
    used: float  # s of usable driving
    quantities: Mapping[str, Quantity]  # "range_rate K" -> ..., in the order in which they are shown
    driven: Mapping[str, Interval] = {}  # role -> median, and the 5 and 95 % points
    excitation: Mapping[str, float] = {}  # input -> standard deviation
    draws: Draws | None = None
    loop: Loop | None = None
    correlation: Correlation | None = None  # of a diagnosis; of `draws` it follows from them
    levels: tuple[Level, ...] = ()
    changes: tuple[float, ...] = ()  # s, steps of the gains
    duration: float = NAN  # s
    causes: Causes | None = None


class Side(NamedTuple):
    """One driver: one drive or several."""

    label: str
    drives: tuple[DriveEstimates, ...]


def finite(iv: Interval) -> bool:
    """Are value and both ends known?

    >>> finite(Interval(1.0, 0.5, 2.0)), finite(Interval(1.0))
    (True, False)
    """
    return all(map(math.isfinite, iv))
