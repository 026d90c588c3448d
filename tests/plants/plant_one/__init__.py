"""Planting simulator one: 50 Hz, Heun; separate lags and dead times of both answers; hard nonlinearities.

Nothing of it comes from canid, nor from the other planting simulator.
"""

from tests.plants.plant_one.loop import plant

__all__ = ["plant"]
