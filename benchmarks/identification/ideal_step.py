"""How often an ideal detector, to which all but the instant is known, could report a step of the gains in time.

It knows inputs, gains before and after, lags, dead times and the noise model. Its log likelihood ratio is Gaussian with a
mean of D and a variance of 2 D, half the squared length of what the step changes in the whitened output.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy.stats import norm

from benchmarks.identification import acceleration, loop_a, loop_b
from benchmarks.identification.gain_drives import World, stepped
from benchmarks.identification.noise_models import REMNANT, whiten
from canid.mathematics.estimators.step_watch import ALARM
from tests.plants.first_order_lag import answer

GRID = 0.1  # s


def chance(seed: int, world: World, factor: float, at: float, within: float) -> float:
    """Probability that the log likelihood ratio has reached canid's threshold.

    Args:
        seed: of the drive.
        world: of the drive.
        factor: on the gains.
        at: s, of the step.
        within: s after it.
    """
    gain = partial(stepped, at=at, factor=factor)
    noise = world.noise
    if world.plant == "acceleration":
        made = acceleration.drive(seed, (at + within) / 60.0, noise, gain=gain)
        inputs, dt, sigma, channels = made.inputs.T, acceleration.DT, acceleration.REMNANT, made.channels
        seen = np.full(len(made.inputs), True)
    else:
        if world.plant == "A":
            drive = loop_a.drive(seed, at + within, lead=world.lead, noise_model=noise, gain=gain)
        else:
            drive, noise = loop_b.drive(seed, at + within, lead=world.lead, gain=gain), REMNANT
        inputs, dt, sigma, channels = np.array(drive.inputs), drive.dt, drive.sigma, drive.channels
        seen = drive.exact
    answers = sum(c.K * answer(u, dt, c.tau, c.dead_time) for c, u in zip(channels, inputs, strict=True))
    changed = (factor - 1.0) * answers * (np.arange(len(answers)) * dt >= at)
    rows = slice(None, None, round(GRID / dt))
    columns = np.column_stack([changed, np.ones(len(changed))])[rows]
    step, level = (whiten(columns, noise, GRID, seen[rows]) / sigma).T
    step = step - level * float(level @ step) / float(level @ level)
    D = 0.5 * float(step @ step)
    return float(norm.sf(ALARM, D, math.sqrt(2.0 * D)))
