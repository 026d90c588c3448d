"""Dead time when every signal has a clock of its own and the radar or camera reports at 20 Hz."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bus, canid_side, open_loop
from benchmarks.identification.bus import Seen, Stream
from benchmarks.identification.noise_models import NoiseModel
from benchmarks.identification.open_loop import Case
from benchmarks.identification.peers import process
from benchmarks.identification.table import Settings, Table, each, text
from canid.values.types import Driver

# little noise, so that 200 runs resolve a bias of a millisecond
CASE = Case(NoiseModel("OU 0.5 s", time_constant=0.5), cut=0.3, dead_time=0.237, decibel=30.0, seconds=60.0)
LANE = Driver(task="lane_keeping", output="steering_angle")
FOLLOWING = Driver(task="car_following", output="pedal")
SPEED = 25.0  # m/s


def table(settings: Settings) -> list[Table]:
    """Print the bias of dead time and of tau + dead time, with its Monte Carlo error."""
    rows: list[tuple[object, ...]] = []
    ways = {
        "canid": (bus.through_canid, _canid),
        "joined by lines, then canid's fit": (bus.by_lines, _canid),
        "last value held, then canid's fit": (_held, _canid),
    }
    if settings.peers:
        ways["joined by lines, scipy curve_fit recipe"] = (bus.by_lines, _recipe)
    worlds = {
        "camera 20 Hz, no noise": (_camera, False),
        "radar 20 Hz, no noise": (_radar, False),
        "radar 20 Hz, with noise": (_radar, True),
    }
    for world, (make, noisy) in worlds.items():
        # joined or held, the readings of a radar without noise are those of the camera
        for way, (take, fit) in ways.items() if noisy or make is _camera else [("canid", ways["canid"])]:
            errors = 1e3 * np.array(each(settings, _run, make, noisy, take, fit))
            error = np.sqrt(errors.var(axis=0, ddof=1) / len(errors))
            mean = errors.mean(axis=0)
            rows.append(
                (
                    world,
                    way,
                    *(f"{text(float(m))} ± {e:.1f}" for m, e in zip(mean[:2], error[:2], strict=True)),
                )
            )
    return [
        Table(
            "Bias in ms: sensor at 20 Hz and the driver's output at 50 Hz, clocks offset at random, 60 s",
            (
                "world",
                "way to 10 Hz",
                "dead time",
                "tau + dead time",
            ),
            rows,
            (f"± one standard deviation of the mean. Noise: {bus.GAP_SD} m and {bus.RATE_SD} m/s.",),
        )
    ]


def _held(streams: list[Stream], driver: Driver) -> Seen:
    return bus.by_lines(streams, driver, held=True)


def _run(seed: int, make, noisy: bool, take, fit) -> tuple[float, float, float]:  # type: ignore[no-untyped-def]
    run = open_loop.process(seed, CASE)
    streams, driver, column = make(run, seed, noisy)
    tau, dead_time = fit(take(streams, driver), column)
    return dead_time - run.dead_time, tau + dead_time - run.tau - run.dead_time, tau - run.tau


def _canid(seen: Seen, column: int) -> tuple[float, float]:
    at = canid_side.process(seen.output, seen.inputs[:, [column]], bus.GRID, seen.usable, seen.segment).point
    return float(at.tau[0]), float(at.dead_time[0])


def _recipe(seen: Seen, column: int) -> tuple[float, float]:
    settle = round(open_loop.HISTORY / bus.GRID)
    _, tau, dead_time = process.recipe(seen.output, seen.inputs[:, column], bus.GRID, settle)
    return float(tau), float(dead_time)


def _camera(run: open_loop.Process, seed: int, noisy: bool) -> tuple[list[Stream], Driver, int]:
    rng = np.random.default_rng([seed, 6])
    t = np.arange(len(run.y)) * run.dt
    camera, wheel, speed = (bus.clock(rng, period, t[-1]) for period in (bus.RADAR, bus.CONTROL, bus.CONTROL))
    streams = [
        Stream(camera, ("lateral_offset",), np.interp(camera, t, run.u)[:, None]),
        Stream(wheel, ("steering_angle",), np.interp(wheel, t, run.y)[:, None]),
        Stream(speed, ("speed",), np.full((len(speed), 1), SPEED)),
    ]
    return streams, LANE, 0


def _radar(run: open_loop.Process, seed: int, noisy: bool) -> tuple[list[Stream], Driver, int]:
    """Let the input be a range rate of 1 m/s rms; the pedal answers to nothing else."""
    rng = np.random.default_rng([seed, 6])
    t = np.arange(len(run.y)) * run.dt
    # less its mean, which only moves the pedal's offset, the gap neither closes nor runs away
    rate = (run.u - run.u.mean()) / 0.3
    gap = 45.0 + np.cumsum(rate) * run.dt
    radar, pedal, speed = (bus.clock(rng, period, t[-1]) for period in (bus.RADAR, bus.CONTROL, bus.CONTROL))
    ahead = np.column_stack([np.interp(radar, t, gap), np.interp(radar, t, rate)])
    if noisy:
        ahead += rng.standard_normal(ahead.shape) * (bus.GAP_SD, bus.RATE_SD)
    streams = [
        Stream(radar, ("gap", "range_rate"), ahead),
        # 50 %: far from the floor
        Stream(pedal, ("pedal",), 50.0 + np.interp(pedal, t, run.y / 0.3)[:, None]),
        Stream(speed, ("speed",), np.full((len(speed), 1), SPEED)),
    ]
    return streams, FOLLOWING, 1
