"""The words that a vehicle file may use: every role with its unit, and what each task needs."""

from __future__ import annotations

from typing import Literal, NamedTuple

Kind = Literal["number", "bool", "state"]


# s; older than this is not measured any more. Control signals come at 10 Hz at least (five missed are no
# jitter), switches and gears at 5 Hz, satellite positions once a second.
QUICK, SLOW, SATELLITE = 0.5, 1.0, 2.5


class Role(NamedTuple):
    """One role. A `number` has a unit; a `state` (gear) is a number whose value-table entries are values."""

    unit: str
    kind: Kind
    says: str
    stale: float = QUICK


ROLES: dict[str, Role] = {
    "pedal": Role("%", "number", "accelerator pedal position"),
    "speed": Role("m/s", "number", "own speed"),
    "lead_speed": Role("m/s", "number", "speed of the vehicle ahead"),
    "gap": Role("m", "number", "distance to the vehicle ahead, bumper to bumper"),
    "range_rate": Role("m/s", "number", "lead speed minus own speed; positive = opening"),
    "lead_valid": Role("", "bool", "a vehicle ahead is measured", SLOW),
    "brake": Role("", "bool", "brake pedal pressed", SLOW),
    "cruise_active": Role("", "bool", "cruise control drives", SLOW),
    "clutch": Role("", "bool", "clutch pedal pressed", SLOW),
    "accel": Role("m/s2", "number", "own longitudinal acceleration"),
    "accel_command": Role("m/s2", "number", "acceleration that a controller asks for"),
    "grade": Role("%", "number", "slope of the road; positive = uphill", SATELLITE),
    "altitude": Role("m", "number", "height", SATELLITE),
    "east": Role("m", "number", "position", SATELLITE),
    "north": Role("m", "number", "position", SATELLITE),
    "lat": Role("deg", "number", "latitude", SATELLITE),
    "lon": Role("deg", "number", "longitude", SATELLITE),
    "yaw_rate": Role("rad/s", "number", "positive = to the left"),
    "gnss_speed": Role("m/s", "number", "own speed by satellite", SATELLITE),
    "gear": Role("", "state", "gear that is engaged", SLOW),
    "engine_speed": Role("rpm", "number", "engine speed"),
    "lateral_offset": Role("m", "number", "from the lane's middle; positive = to the left"),
    "steering_angle": Role("deg", "number", "steering wheel; positive = to the left"),
}

# Roles that canid computes itself: mapping them is a mistake that deserves its own sentence.
DERIVED = {"headway": "is computed as gap / speed; map gap and speed"}

# What a task cannot do without, beside the driver's output.
NEEDS: dict[str, tuple[str, ...]] = {
    "car_following": ("speed", "gap", "range_rate"),
    "lane_keeping": ("lateral_offset",),
}

# What can be a driver's (or a controller's) answer.
OUTPUTS = ("pedal", "accel", "accel_command", "steering_angle")
