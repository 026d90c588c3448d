"""Closed loop A, reference/identification.md section 3: Grover's first driver behind a lead on a motorway.

100 Hz, explicit Euler; each channel has a lag of its own and the remnant stands on the pedal itself.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.identification.bounds import Lag
from benchmarks.identification.loops import NORMAL, Drive, Gain, Lead, constant
from benchmarks.identification.noise_models import REMNANT, NoiseModel, draw, low_pass

DT = 0.01
# Grover 2021, case 1; the dead times are assumed, the paper gives none
K1, TAU1, THETA1 = 4.367, 0.685, 0.30
K2, TAU2, THETA2 = 5.630, 0.401, 0.20
GROVER = (Lag(K1, TAU1, THETA1), Lag(K2, TAU2, THETA2))
HEADWAY = 1.8  # s
CRUISE = 25.0  # m/s, about which everything moves
# grade of 0.1 m/s² (1 %) that lasts: at 25 m/s, hills of 1.5 km (reference/diagnosis.md 2.3) are waves of 60 s
HILLS = NoiseModel("hills", time_constant=10.0)
P0 = 40.0  # %; far from the floor, which this loop does not have


def drive(
    seed: int,
    seconds: float,
    remnant: float = 1.0,
    lead: Lead = NORMAL,
    noise_model: NoiseModel = REMNANT,
    channels: tuple[Lag, Lag] = GROVER,
    gain: Gain = constant,
) -> Drive:
    """Draw one drive.

    Args:
        seed: of the run.
        seconds: how long.
        remnant: sd of the pedal's own noise, %.
        lead: of the vehicle ahead.
        noise_model: of the remnant.
        channels: the driver.
        gain: factor on both gains over the drive.
    """
    rng = np.random.default_rng([seed, 3])
    settle = 60.0  # s; the loop starts at its balance, and is given out once it has forgotten that
    n, skip = round((seconds + settle) / DT), round(settle / DT)
    ahead = (CRUISE + lead.sd * low_pass(n, DT, lead.cut, rng)).tolist()
    noise = (remnant * draw(noise_model, n, DT, rng)).tolist()
    grade = (0.1 * draw(HILLS, n, DT, rng)).tolist()
    factor = gain(np.arange(n) * DT - settle).tolist()
    one, two = channels
    d1, d2 = round(one.dead_time / DT), round(two.dead_time / DT)
    a1, a2 = math.exp(-DT / one.tau), math.exp(-DT / two.tau)
    g1, g2 = 1.0 - one.tau / DT * (1.0 - a1), 1.0 - two.tau / DT * (1.0 - a2)
    v, gap, x1, x2 = CRUISE, HEADWAY * CRUISE, 0.0, 0.0
    error, rate = [0.0] * (d1 + 2), [0.0] * (d2 + 2)
    out = np.empty((n, 4))
    for k in range(n):
        error.append(gap / v - HEADWAY)
        rate.append(ahead[k] - v)
        # one exact step of each lag, its delayed input joined by a line
        u, w = error[-d1 - 2], error[-d1 - 1]
        x1 = a1 * x1 + (1.0 - a1) * u + g1 * (w - u)
        u, w = rate[-d2 - 2], rate[-d2 - 1]
        x2 = a2 * x2 + (1.0 - a2) * u + g2 * (w - u)
        pedal = P0 + factor[k] * (one.K * x1 + two.K * x2) + noise[k]
        out[k] = pedal, v, gap, ahead[k] - v
        v += DT * ((0.8 * (pedal - P0) - (v - CRUISE)) / 20.0 + grade[k])
        gap += DT * (ahead[k] - v)
    pedal, speed, gaps, rates = out[skip:].T
    free = np.full(n - skip, True)
    return Drive(DT, pedal, ~free, speed, gaps, rates, HEADWAY, channels, remnant, False, free)
