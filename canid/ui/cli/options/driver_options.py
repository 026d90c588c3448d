"""`--driver K1=..,tau1=..` and `--steering a1=..,b1=..` of `canid simulate`: the driver's parameters, as far as given."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from canid.values.errors import ConfigError

if TYPE_CHECKING:
    from canid.models.simulation import DriverTruth, Simulation, Steering


# m from the middle: two lanes away
MAX_OFFSET_M = 7.0


class Key(NamedTuple):
    """What a key may be."""

    field: str  # of the driver
    low: float
    high: float
    unit: str


# a gain beyond a thousand moves a pedal, or a wheel, through its whole range within its resolution
_GAIN = 1000.0
# s; an answer later than a minute is none
_DELAY = 60.0
DRIVER_KEYS = {
    "K1": Key("K1", -_GAIN, _GAIN, "% per s"),
    "tau1": Key("tau1", 0.0, _DELAY, "s"),
    "theta1": Key("dead_time1", 0.0, _DELAY, "s"),
    "K2": Key("K2", -_GAIN, _GAIN, "% per m/s"),
    "tau2": Key("tau2", 0.0, _DELAY, "s"),
    "theta2": Key("dead_time2", 0.0, _DELAY, "s"),
    # a tenth of a second is a gap of 3 m at 30 m/s
    "headway": Key("headway_desired", 0.1, _DELAY, "s"),
    "noise": Key("noise_sd", 0.0, 100.0, "%"),
}
STEERING_KEYS = {
    # a second-order polynomial with poles inside the unit circle has |a1| < 2 and |a2| < 1
    "a1": Key("a1", -2.0, 2.0, ""),
    "a2": Key("a2", -1.0, 1.0, ""),
    "b1": Key("b1", -_GAIN, _GAIN, "° per m"),
    "b2": Key("b2", -_GAIN, _GAIN, "° per m"),
    "c1": Key("c1", -1.0, 1.0, ""),
    "sd": Key("sd", 0.0, 100.0, "°"),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--driver",
        type=_parser("--driver", DRIVER_KEYS),
        metavar="KEY=VALUE,...",
        help="the driver: K1 (%% per s of headway error), tau1, theta1 (dead time), K2 (%% per m/s of range rate), tau2, "
        "theta2, headway, in s, and noise (%% of the pedal); default of each: drawn by the seed",
    )
    parser.add_argument(
        "--steering",
        type=_parser("--steering", STEERING_KEYS),
        metavar="KEY=VALUE,...",
        help="with --profile lane, the driver A angle = B offset + C e at 10 Hz: a1, a2, b1, b2 (° per m; the offset is "
        "positive to the left, so that b1 has the other sign than Chen & Ulsoy's), c1, and sd of e (°); default: their "
        "Table 1",
    )


def _parser(option: str, keys: dict[str, Key]) -> Callable[[str], dict[str, float]]:
    def parse(text: str) -> dict[str, float]:
        return parameters(text, keys)

    return parse


def parameters(text: str, keys: dict[str, Key]) -> dict[str, float]:
    """Parse KEY=VALUE,...

    Args:
        text: of the option.
        keys: that there are.

    Returns:
        Values by key.

    Raises:
        ArgumentTypeError: an unknown key, one twice, no number, or one out of its range.

    Example:
        >>> parameters("K1=7.8,tau1=0.141", DRIVER_KEYS)
        {'K1': 7.8, 'tau1': 0.141}
    """
    out: dict[str, float] = {}
    for part in text.split(","):
        key, equals, number = (piece.strip() for piece in part.partition("="))
        if key not in keys:
            raise argparse.ArgumentTypeError(f"{key!r} is not one of {', '.join(keys)}")
        if key in out:
            raise argparse.ArgumentTypeError(f"{key} is given twice")
        try:
            value = float(number) if equals else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise argparse.ArgumentTypeError(f"{part.strip()!r}: write {key}=NUMBER")
        low, high, unit = keys[key][1:]
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(
                f"{key} {value:g} is outside of {low:g} to {high:g} {unit}".rstrip()
            )
        out[key] = value
    return out


def chosen(args: argparse.Namespace) -> DriverTruth | Steering | None:
    """The driver of the options; None: nothing is given.

    Args:
        args: with driver, steering, model, profile and seed.

    Raises:
        ConfigError: options that do not go together.
    """
    from canid.models.simulation import Steering
    from canid.models.simulation.driver import driver_of_seed

    if args.driver is None and args.steering is None:
        return None
    option = "--driver" if args.driver is not None else "--steering"
    if args.driver is not None and args.steering is not None:
        raise ConfigError("simulate: --driver follows a lead and --steering keeps the lane: give one of them")
    if args.model is not None:
        raise ConfigError(f"simulate: --model brings its own driver: leave out {option}")
    if args.driver is not None:
        if args.profile == "lane":
            raise ConfigError("simulate: --driver follows a lead: with --profile lane use --steering")
        values = {DRIVER_KEYS[key].field: value for key, value in args.driver.items()}
        return driver_of_seed(args.seed)._replace(**values)
    if args.profile != "lane":
        raise ConfigError("simulate: --steering keeps the lane: add --profile lane, or use --driver")
    given, usual = args.steering, Steering()
    return Steering(
        a=(given.get("a1", usual.a[0]), given.get("a2", usual.a[1])),
        b=(given.get("b1", usual.b[0]), given.get("b2", usual.b[1])),
        c=given.get("c1", usual.c),
        noise_sd=given.get("sd", usual.noise_sd),
    )


def loses_it(driver: DriverTruth | Steering, simulation: Simulation) -> str:
    """Say that a driver holds no gap, or leaves the lane; empty: not so.

    Args:
        driver: as chosen.
        simulation: the drive.
    """
    import numpy as np

    from canid.mathematics.systems.following_loop import FollowingLoop, unstable
    from canid.models.simulation import Car, Steering

    if isinstance(driver, Steering):
        largest = float(np.max(np.abs(simulation.columns["lateral_offset"])))
        by = f"by {largest:.3g} m" if math.isfinite(largest) else "without end"
        return (
            f"this driver leaves the lane, {by}: the gains b1 and b2 answer an offset to the left, against "
            "which a driver steers (b1 of Chen & Ulsoy has the other sign)"
            if not largest <= MAX_OFFSET_M
            else ""
        )
    speed, car = float(np.mean(simulation.columns["speed"])), Car()
    loop = FollowingLoop(
        np.array([[driver.K1, driver.K2]]),
        np.array([[driver.tau1, driver.tau2]]),
        np.array([[driver.dead_time1, driver.dead_time2]]),
        max(speed, 1.0),
        driver.headway_desired,
        *(np.array([x]) for x in (car.power, car.lag, 2.0 * car.drag * speed)),
    )
    return (
        f"this driver does not hold a gap at {speed:.0f} m/s: gap and speed run away"
        if unstable(loop)[0]
        else ""
    )
