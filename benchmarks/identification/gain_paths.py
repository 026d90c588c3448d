"""Drives whose driver's gains change slowly, and what a whole drive says of them."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.identification import bus
from benchmarks.identification.gain_drives import NAMES, Seen, World, drive
from canid.mathematics.estimators import fopdt
from canid.values.types import LearnGate, Trace

# s; of the random walk's increments
PATH_STEP_S = 1.0


def random_walk(t: np.ndarray, seed: int, seconds: float, share: float) -> np.ndarray:
    """Return a factor on the gains: a random walk with mean 1 and this sd over the drive."""
    n = round(seconds / PATH_STEP_S) + 2
    walk = np.cumsum(np.random.default_rng([seed, 8]).standard_normal(n))
    walk = 1.0 + share * (walk - walk.mean()) / walk.std()
    # no gain turns its sign
    return np.interp(t, np.arange(n) * PATH_STEP_S, np.maximum(walk, 0.1))


class Found(NamedTuple):
    """What a whole drive says of the gain of range rate."""

    p_value: float  # NaN: too few windows
    inside: float  # share of the windows in which the band holds the gain
    bias: float  # mean of the windows over the truth, less one
    sd: float  # of the gain over the drive, over its mean
    held: bool  # the interval of that sd holds the truth
    changes: int


def of_drive(seed: int, world: World, seconds: float, share: float) -> Found:
    """Identify one drive."""
    gain = partial(random_walk, seed=seed, seconds=seconds, share=share)
    seen = drive(world, seed, seconds, gain)
    found = fopdt.identify(trace(seen), fopdt.FopdtSettings(output_filter=seen.output_filter))
    level = next(
        (c for c in found.details["constancy"] if c["input"] == "range_rate" and c["parameter"] == "K"),
        None,
    )
    if level is None:
        return Found(np.nan, np.nan, np.nan, np.nan, False, len(found.details["changes"]))
    # a window's estimate is of the mean over it
    width = level["window"]
    t = level["t"][:, None] + np.linspace(-0.5, 0.5, 21) * width
    truth = seen.K2 * gain(t.ravel()).reshape(t.shape).mean(axis=1)
    inside = float(np.mean((level["low"] <= truth) & (truth <= level["high"])))
    weight = level["sd"] ** -2
    bias = float(np.sum(weight * (level["value"] / truth - 1.0)) / np.sum(weight))
    v = level["variation"]
    return Found(
        level["p_value"],
        inside,
        bias,
        v.value / seen.K2,
        bool(v.low <= share * seen.K2 <= v.high),
        len(found.details["changes"]),
    )


def trace(seen: Seen) -> Trace:
    """Return the drive as `canid.identify` takes it."""
    y, u, learn, segment, bound = seen.samples
    n = len(y)
    t = np.arange(n) * bus.GRID
    return Trace(
        bus.GRID, t, y, u, NAMES, (LearnGate.OPEN,) * n, learn, segment, {}, seen.output_filter, bound
    )
