"""Roles: the quantities that a vehicle file may map, with their units, and the roles that each task needs."""

from __future__ import annotations

from collections.abc import Container
from typing import Literal, NamedTuple

Kind = Literal["number", "bool", "state"]


# s; an older value counts as not measured. Control signals come at 10 Hz at least (five missed are no jitter),
# switches and gears at 5 Hz, satellite positions once a second
CONTROL_MAX_AGE_S, SWITCH_MAX_AGE_S, SATELLITE_MAX_AGE_S = 0.5, 1.0, 2.5


class Role(NamedTuple):
    """One role. A `number` has a unit; a `state` (gear) is a number whose value-table entries are values."""

    unit: str
    kind: Kind
    meaning: str
    stale: float = CONTROL_MAX_AGE_S


ROLES: dict[str, Role] = {
    "pedal": Role("%", "number", "accelerator pedal position"),
    "speed": Role("m/s", "number", "own speed"),
    "lead_speed": Role("m/s", "number", "speed of the vehicle ahead"),
    "gap": Role("m", "number", "distance to the vehicle ahead, bumper to bumper"),
    "range_rate": Role("m/s", "number", "lead speed minus own speed; positive = opening"),
    "lead_valid": Role("", "bool", "a vehicle ahead is measured", SWITCH_MAX_AGE_S),
    "brake": Role("", "bool", "brake pedal pressed", SWITCH_MAX_AGE_S),
    "cruise_active": Role("", "bool", "cruise control drives", SWITCH_MAX_AGE_S),
    "steering_assist": Role("", "bool", "an assistant steers", SWITCH_MAX_AGE_S),
    "clutch": Role("", "bool", "clutch pedal pressed", SWITCH_MAX_AGE_S),
    "accel": Role("m/s2", "number", "own longitudinal acceleration"),
    "accel_command": Role("m/s2", "number", "acceleration that a controller asks for"),
    "grade": Role("%", "number", "slope of the road; positive = uphill", SATELLITE_MAX_AGE_S),
    "altitude": Role("m", "number", "height", SATELLITE_MAX_AGE_S),
    "east": Role("m", "number", "position", SATELLITE_MAX_AGE_S),
    "north": Role("m", "number", "position", SATELLITE_MAX_AGE_S),
    "lat": Role("deg", "number", "latitude", SATELLITE_MAX_AGE_S),
    "lon": Role("deg", "number", "longitude", SATELLITE_MAX_AGE_S),
    "yaw_rate": Role("rad/s", "number", "positive = to the left"),
    "gnss_speed": Role("m/s", "number", "own speed by satellite", SATELLITE_MAX_AGE_S),
    "wheel_speed": Role("m/s", "number", "own speed by the wheels, apart from `speed`"),
    "gear": Role("", "state", "gear that is engaged; negative = reverse", SWITCH_MAX_AGE_S),
    "reverse": Role("", "bool", "reverse gear is engaged", SWITCH_MAX_AGE_S),
    "engine_speed": Role("rpm", "number", "engine speed"),
    "lateral_offset": Role("m", "number", "from the middle of the lane; positive = to the left"),
    "steering_angle": Role("deg", "number", "steering wheel; positive = to the left"),
    "curvature": Role("1/m", "number", "of the road at the car; positive = to the left"),
}

# roles that canid computes itself: mapping one is a mistake with its own sentence
DERIVED = {"headway": "is computed as gap / speed; map gap and speed"}

# roles that a task needs, besides the driver's output
NEEDS: dict[str, tuple[str, ...]] = {
    "car_following": ("speed", "gap", "range_rate"),
    "lane_keeping": ("lateral_offset",),
}

# roles that can be the output of a driver or a controller
OUTPUTS = ("pedal", "accel", "accel_command", "steering_angle")


def assistant_of(output: str, mapped: Container[str]) -> str:
    """The role that says that an assistant, not the person, moves an output: of the wheel its own, where it is mapped.

    Example:
        >>> assistant_of("steering_angle", {"steering_assist"}), assistant_of("pedal", {"steering_assist"})
        ('steering_assist', 'cruise_active')
    """
    separate = output == "steering_angle" and "steering_assist" in mapped
    return "steering_assist" if separate else "cruise_active"
