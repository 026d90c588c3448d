"""Margins and string stability of an identified driver with the car, with 95 % intervals by draws from the posterior.

Drivers are drawn from FOPDT's joint posterior of gains, lags and dead times over the whole drive, cars from the estimate of
the car on the same drive (`car_response.py`); of an output that is an acceleration no car is needed. Each pair's margins are
exact (`following_loop.py`), at the drive's median speed and headway.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.output_filter import is_unknown
from canid.mathematics.systems import following_loop
from canid.mathematics.systems.car_response import CarResponse, car_response
from canid.mathematics.systems.following_loop import FollowingLoop, LoopMargins
from canid.mathematics.systems.posterior_draws import car_draws, driver_draws
from canid.values.types import NAN, TASK_INPUTS, Array, Channel, Identifiable, Interval, Trace

# draws; the ends of an interval are then known to a tenth of its width
DRAWS = 200
# outputs that are the acceleration itself
ACCELERATIONS = ("accel", "accel_command")


class IdentifiedLoop(NamedTuple):
    """The car-following loop of one driver in one car."""

    says: str = "not computed"  # empty: it is given; else why not, and what to do
    speed: float = NAN  # m/s, about which it is linearised: the drive's median
    headway: float = NAN  # s
    phase_margin: Interval = Interval()  # degrees
    gain_margin: Interval = Interval()  # factor; inf: none; NaN: of a smoothed output
    delay_margin: Interval = Interval()  # s
    modulus_margin: Interval = Interval()
    crossover: Interval = Interval()  # rad/s
    string_peak: Interval = Interval()  # largest |v / v_lead|; 1: no motion of the lead is amplified
    string_peak_frequency: Interval = Interval()  # Hz; 0: nothing is amplified
    amplifying: float = NAN  # share of the draws with string_peak above 1
    unstable: float = NAN  # share of the draws that are unstable: without margin, peak infinite
    car: CarResponse | None = None  # None: the output is the acceleration itself


def identified_loop(
    fit: ProcessFit | None, channels: Mapping[str, Channel], trace: Trace, output: str = ""
) -> IdentifiedLoop:
    """Margins of the driver of a drive.

    Args:
        fit: FOPDT's of the whole drive; None: none.
        channels: its channels, as they may be quoted.
        trace: the drive.
        output: role of the driver's output; empty: that of which the trace has the same numbers.
    """
    if tuple(trace.input_names) != TASK_INPUTS["car_following"]:
        return IdentifiedLoop("they are computed for car following only, by headway and range rate")
    why = _not_known(fit, channels)
    if why or fit is None or fit.posterior is None:
        return IdentifiedLoop(why)
    role = output or _role(trace)
    if role not in (*ACCELERATIONS, "pedal"):
        return IdentifiedLoop("from this output to the acceleration nothing is known: use pedal or accel")
    if role in ACCELERATIONS and is_unknown(trace.output_filter):
        return IdentifiedLoop(
            "the output was smoothed in a way that is not known, which the delays hold: state [driver] output_filter"
        )
    speed, headway = (_median(trace, name) for name in ("speed", "headway"))
    if not (speed > 0.0 and headway > 0.0):
        return IdentifiedLoop("speed or headway is not measured: the loop depends on both")
    car = car_response(trace) if role == "pedal" else None
    if isinstance(car, str):
        return IdentifiedLoop(f"a pedal works through the car: {car}")
    gains = channels["headway_error"].K, channels["range_rate"].K
    drawn = driver_draws(fit.posterior, gains, DRAWS)
    point = FollowingLoop(
        np.array([[K.value for K in gains]]), fit.point.tau[None], fit.point.dead_time[None], speed, headway
    )
    many = FollowingLoop(drawn.K, drawn.tau, drawn.dead_time, speed, headway)
    if car is not None:
        strength, lag, damping = (np.array([x.value]) for x in (car.strength, car.lag, car.damping))
        point = point._replace(strength=strength, lag=lag, damping=damping)
        strength, lag, damping = car_draws(car, DRAWS)
        many = many._replace(strength=strength, lag=lag, damping=damping)
    identified = _intervals(following_loop.margins(point), following_loop.margins(many), speed, headway, car)
    # the gain margin lies at 2 rad/s and more, where lag and dead time differ: of accelerations behind a Savitzky-Golay
    # filter of 1.1 s its interval held the truth in half of the drives (table `margins` of docs/evidence/identification.md)
    smoothed = trace.output_filter is not None and trace.output_filter.kind != "none"
    return identified._replace(gain_margin=Interval()) if role in ACCELERATIONS and smoothed else identified


def _intervals(
    at: LoopMargins, drawn: LoopMargins, speed: float, headway: float, car: CarResponse | None
) -> IdentifiedLoop:
    bad = float(drawn.unstable.mean())
    if bool(at.unstable[0]) or bad > 0.5:
        return IdentifiedLoop(
            "the identified gains and delays give an unstable loop: a longer drive is needed",
            speed,
            headway,
            unstable=bad,
            car=car,
        )

    def interval(name: str) -> Interval:
        value = float(getattr(at, name)[0])
        draws: Array = getattr(drawn, name)
        low, high = np.quantile(draws, QUANTILES, method="nearest")
        # the estimate itself is in its interval
        return Interval(value, min(float(low), value), max(float(high), value))

    return IdentifiedLoop(
        "",
        speed,
        headway,
        phase_margin=interval("phase_margin_deg"),
        gain_margin=interval("gain_margin"),
        delay_margin=interval("delay_margin_s"),
        modulus_margin=interval("modulus_margin"),
        crossover=interval("crossover"),
        string_peak=interval("string_peak"),
        string_peak_frequency=interval("string_peak_hz"),
        amplifying=float(np.mean(drawn.string_peak > 1.0)),
        unstable=bad,
        car=car,
    )


def _not_known(fit: ProcessFit | None, channels: Mapping[str, Channel]) -> str:
    """Why the loop cannot be given; empty: it can."""
    if fit is None or fit.posterior is None or not set(TASK_INPUTS["car_following"]) <= channels.keys():
        return "no model of the whole drive"
    for name in TASK_INPUTS["car_following"]:
        channel = channels[name]
        if channel.status is Identifiable.NOT or not all(map(math.isfinite, channel.K)):
            return channel.withheld or (
                f"the gain of {name.replace('_', ' ')} is not known over the whole drive: drive longer behind a lead "
                "whose speed changes"
            )
    return ""


def _role(trace: Trace) -> str:
    """The role whose numbers the output has; empty: none."""
    return next(
        (
            role
            for role in ("pedal", *ACCELERATIONS)
            if role in trace.signals and np.array_equal(trace.signals[role], trace.output, equal_nan=True)
        ),
        "",
    )


def _median(trace: Trace, role: str) -> float:
    if role not in trace.signals:
        return NAN
    known = trace.signals[role][trace.learn]
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else NAN
