"""Settings of the study of Chen & Ulsoy 2001."""

from __future__ import annotations

from typing import NamedTuple


class ChenUlsoySettings(NamedTuple):
    """What may be chosen; the defaults are the paper's where it states them.

    Example:
        >>> ChenUlsoySettings(bootstraps=200).segment
        60.0
    """

    segment: float = 60.0  # s, sec. 2.1
    # segments left out at the beginning of each log: in a simulator a driver gets used to it (sec. 2.1). Of a recorded log
    # `canid study` leaves out none
    warm_up: int = 1
    # s; the grid's step of their models. A finer trace is resampled to it, with and without an anti-aliasing filter
    dt: float = 0.1
    # simulated repetitions of each driver, each minute at its own model, for the null band of |Delta|; 0: no band
    bootstraps: int = 0
    # simulated repetitions of each driver as one that never changes: bias and true scatter of minute fits, and the share of
    # segments that it passes. Ten times 119 fits know a standard deviation to 2 %
    constant_repetitions: int = 10
    speed: float = 25.0  # m/s, of the car in the robust stability analysis
    seed: int = 1
