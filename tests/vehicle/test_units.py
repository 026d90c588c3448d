import math

import pytest

from canid.signals.vehicle.units import factor_to
from canid.values.roles import ROLES


@pytest.mark.parametrize(
    ("source", "target", "factor"),
    [
        ("km/h", "m/s", 1 / 3.6),
        ("kph", "m/s", 1 / 3.6),
        ("KPH", "m/s", 1 / 3.6),
        ("mph", "m/s", 0.44704),
        ("knots", "m/s", 0.514444444),
        ("deg/s", "rad/s", math.pi / 180),
        ("°/s", "rad/s", math.pi / 180),
        ("rad", "deg", 180 / math.pi),
        ("0..1", "%", 100),
        ("%", "%", 1),
        ("g", "m/s2", 9.80665),
        ("m/s^2", "m/s2", 1),
        ("m/s²", "m/s2", 1),
        ("ft", "m", 0.3048),
        ("cm", "m", 0.01),
        ("ms", "s", 0.001),
        ("1/min", "rpm", 1),
        ("[ km/h ]", "m/s", 1 / 3.6),
    ],
)
def test_known_units_convert(source, target, factor):
    """A unit as DBC files write it becomes the role's unit, by its definition."""
    assert factor_to(source, target) == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize(
    ("source", "target"), [("km/h", "m"), ("", "m"), ("bananas", "m/s"), ("deg", "rad/s")]
)
def test_what_cannot_be_converted_is_not(source, target):
    """No factor is made up for units of another kind or unknown ones."""
    assert factor_to(source, target) is None


def test_every_role_has_a_unit_that_converts_to_itself():
    """The role table names only units that the unit table knows."""
    for name, role in ROLES.items():
        assert not role.unit or factor_to(role.unit, role.unit) == 1.0, name
