"""Closed-loop simulation of a car-following model behind the recorded lead, many stretches and parameters at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.driver.closed_loop import MIN_GAP_M, Stretch
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.values.findings import Flags
from canid.values.types import Array

# s; traffic simulators step by 0.1 to 0.5 s, and a smaller step changes nothing here
STEP_S = 0.2
# m/s²; what tyres can do: models of the safe gap ask for more where it is all but gone
MIN_ACCEL, MAX_ACCEL = -9.0, 5.0


class Leads(NamedTuple):
    """Stretches of a drive side by side, (steps, m) each; beyond a stretch's end the last row is repeated."""

    gap: Array  # m, measured
    speed: Array  # m/s, measured
    lead: Array  # m/s
    inside: Flags  # is it in the stretch? False in the first row, which is given
    dt: float  # s

    def take(self, columns: Flags) -> Leads:
        """Only some stretches, (m,)."""
        gap, speed, lead = (x[:, columns] for x in (self.gap, self.speed, self.lead))
        return Leads(gap, speed, lead, self.inside[:, columns], self.dt)


def leads(
    gap: Array, speed: Array, lead: Array, where: Sequence[Stretch], dt: float, step: float = STEP_S
) -> Leads:
    """Lay stretches side by side.

    Args:
        gap: (n,) m.
        speed: (n,) m/s.
        lead: (n,) m/s.
        where: the stretches.
        dt: s.
        step: s, about the one of the simulation.
    """
    every = max(int(step / dt + 1e-6), 1)
    length = max((stretch.stop - stretch.start - 1) // every + 1 for stretch in where)
    rows = every * np.arange(length)[:, None] + np.array([stretch.start for stretch in where])
    inside = rows < np.array([stretch.stop for stretch in where])
    inside[0] = False
    rows = np.minimum(rows, gap.size - 1)
    return Leads(gap[rows], speed[rows], lead[rows], inside, every * dt)


def simulate(
    model: RivalModel, q: Array, stretches: Leads, noise: Array | None = None
) -> tuple[Array, Array]:
    """Simulate from the measured first state of each stretch (ballistic steps, Treiber & Kanagaraj 2015).

    Args:
        model: which one.
        q: (k, p) parameters: p vectors, or (k, p, m): one for each stretch.
        stretches: the stretches.
        noise: (steps - 1, p, m) m/s² that the driver adds; None: none.

    Returns:
        gap (steps, p, m) m and speed (steps, p, m) m/s.
    """
    q = q[..., None] if q.ndim == 2 else q
    steps, m = stretches.lead.shape
    gap, speed = np.empty((2, steps, q.shape[1], m))
    gap[0], speed[0] = stretches.gap[0], stretches.speed[0]
    middle = 0.5 * (stretches.lead[1:] + stretches.lead[:-1])
    for k in range(steps - 1):
        v = speed[k]
        accel = model.acceleration(q, gap[k], v, stretches.lead[k])
        accel = np.clip(accel if noise is None else accel + noise[k], MIN_ACCEL, MAX_ACCEL)
        np.maximum(v + stretches.dt * accel, 0.0, out=speed[k + 1])
        opening = middle[k] - 0.5 * (v + speed[k + 1])
        np.maximum(gap[k] + stretches.dt * opening, MIN_GAP_M, out=gap[k + 1])
    return gap, speed
