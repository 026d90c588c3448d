"""Seven driver models of SUMO that follow a lead, with settings drawn by seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

# name of the model -> ranges of its own settings (SUMO's documentation, "Definition of Vehicles, Vehicle Types")
MODELS: dict[str, dict[str, tuple[float, float]]] = {
    "IDM": {"tau": (0.9, 1.8)},
    "EIDM": {"tau": (0.9, 1.8), "sigmaerror": (0.0, 0.08)},
    "Krauss": {"tau": (0.9, 1.8), "sigma": (0.0, 0.4)},
    "ACC": {"tau": (1.0, 1.8)},
    "CACC": {"tau": (0.8, 1.4)},
    "Wiedemann": {"security": (0.2, 0.8), "estimation": (0.3, 0.9)},
    "W99": {"cc1": (0.9, 1.8), "cc2": (2.0, 6.0)},
}
# the others are controllers, and Wiedemann's 99 brakes as in an emergency where it acts rarely
PEOPLE = ("IDM", "EIDM", "Krauss", "Wiedemann")
# one smooth formula: its derivatives are the driver's gains. Others switch between modes or jump to a safe speed
SMOOTH = ("IDM", "EIDM")
# of all models: m/s², m/s², m
COMMON = {"accel": (1.2, 2.5), "decel": (2.0, 4.0), "minGap": (1.5, 4.0)}
# s; SUMO's step, at most 0.1, and the share of people that act less often than every step
STEP_S, RARE_SHARE, ACTION_S = 0.05, 0.4, (0.3, 1.0)
# m/s; above every lead, so that all follow
WANTED_SPEED = (36.0, 45.0)


class SumoDriver(NamedTuple):
    """One driver: a model with its settings."""

    model: str
    settings: Mapping[str, float]
    action_step: float  # s
    seed: int

    @property
    def acts_rarely(self) -> bool:
        """Does the driver act less often than every step?"""
        return self.action_step > STEP_S


def driver(seed: int) -> SumoDriver:
    """Draw the driver of a seed; models take turns.

    Example:
        >>> [driver(seed).model for seed in (0, 1, 7)]
        ['IDM', 'EIDM', 'IDM']
    """
    rng = np.random.default_rng([seed, 1])
    model = tuple(MODELS)[seed % len(MODELS)]
    ranges = COMMON | MODELS[model] | {"maxSpeed": WANTED_SPEED}
    settings = {name: round(float(rng.uniform(*of)), 3) for name, of in ranges.items()}
    rarely = model in PEOPLE and rng.random() < RARE_SHARE
    steps = round(float(rng.uniform(*ACTION_S)) / STEP_S) if rarely else 1
    return SumoDriver(model, settings, steps * STEP_S, seed)
