"""Drives of the lane keeper that is not canid's, as tables, and what sensors do to them."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from tests.plants import lane_two
from tests.plants.outside_drives import Drive
from tests.plants.sensor_effects import (
    COARSE,
    DELAYS,
    EMPTY,
    LATE,
    LIMITED,
    OUTPUT,
    PERIODS,
    SHARES,
    SLOW,
    Effect,
    clock,
    drop,
    hold,
    lag,
    late,
    limit,
    line,
    step,
    wrap,
    zero,
)

OFFSET = "lateral_offset"
# ° and m, of the sensors
STEPS = {"steering_angle": 0.1, OFFSET: 0.005}
CLOCK = "clock of the output"
# 1/m, standard deviation of the curvature of every other four roads; the others are straight
CURVES = 3e-4

EFFECTS: tuple[Effect, ...] = (
    Effect("output limited", SHARES, "of the time", partial(limit, role=OUTPUT, sides=(True, True)), LIMITED),
    Effect("offset limited", SHARES, "of the time", partial(limit, role=OFFSET, sides=(True, True)), LIMITED),
    Effect("all held", PERIODS, "s", partial(hold, roles=(OUTPUT, OFFSET, "speed")), SLOW),
    Effect("output held", PERIODS, "s", partial(hold, roles=(OUTPUT,)), SLOW),
    Effect("offset held", PERIODS, "s", partial(hold, roles=(OFFSET,)), SLOW),
    Effect("output joined by lines", PERIODS, "s", partial(line, roles=(OUTPUT,)), SLOW),
    Effect("offset joined by lines", PERIODS, "s", partial(line, roles=(OFFSET,)), SLOW),
    Effect("steps of the output", (0.2, 0.5, 1.0, 2.5), "sd", partial(step, role=OUTPUT), COARSE),
    Effect("steps of the offset", (0.02, 0.05, 0.1, 0.2), "m", partial(step, role=OFFSET), COARSE),
    Effect("offset lags", DELAYS, "s", partial(lag, role=OFFSET), LATE),
    Effect("offset late", DELAYS, "s", partial(late, role=OFFSET), LATE),
    Effect(CLOCK, (50.0, 100.0, 300.0, 1000.0), "ppm", partial(clock, role=OUTPUT)),
    Effect("0 without a lane", (0.01, 0.05, 0.2, 0.5), "of the time", partial(zero, roles=(OFFSET,)), EMPTY),
    Effect("time wraps", (60.0, 65.536, 3600.0, 4294.967296), "s", wrap),
    Effect("rows lost", (0.05, 0.2, 0.5, 0.8), "of them", drop),
)


class Truth(NamedTuple):
    """The driver of a lane drive."""

    gain: float  # ° per m, negative
    tau: float  # s, sum of the lags
    theta: float  # s
    output: str = "steering_angle"

    def of(self, channel: str, parameter: str) -> float:
        """The true value of what canid calls `parameter`; `channel` is always the offset."""
        del channel
        values = {
            "K": self.gain,
            "tau": self.tau,
            "dead_time": self.theta,
            "tau_plus_dead_time": self.tau + self.theta,
        }
        return values[parameter]


def lane_drive(seed: int, seconds: float = 600.0, rate: float = 20.0) -> Drive:
    """A drive of a drawn driver; noises take turns, and so do straight roads and curves.

    Example:
        >>> drive = lane_drive(1, 10.0)
        >>> len(drive.t), sorted(drive.columns)
        (200, ['lateral_offset', 'speed', 'steering_angle'])
    """
    lane = lane_two.plant(
        {},
        seed=seed,
        minutes=seconds / 60.0,
        noise=lane_two.NOISES[seed % 4],
        curves=CURVES * (seed // 4 % 2),
    )
    every = round(1.0 / (rate * lane.dt))
    columns = {role: lane.columns[role][::every] for role in ("steering_angle", OFFSET, "speed")}
    columns |= {role: np.rint(columns[role] / width) * width for role, width in STEPS.items()}
    who = lane.truth["driver"]
    # the arm: 1.6 / ω of its damping 0.8 (lane_two.py)
    truth = Truth(-who["K"], who["lag"] + 1.6 / who["arm"], who["dead_time"])
    return Drive(lane.columns["t"][::every], columns, truth)
