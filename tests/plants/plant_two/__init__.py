"""Planting simulator two: 100 Hz, one common lag after the sum, smooth forms of every nonlinearity.

Written apart from canid and from simulator one: of the three only the physics and the names are common.
"""

from tests.plants.plant_two.planting import plant

__all__ = ["plant"]
