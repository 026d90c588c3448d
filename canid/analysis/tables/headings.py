"""Headings of a table: a column's name and unit, and the role that a name usually stands for."""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.values.roles import ROLES


class Heading(NamedTuple):
    """One column's heading."""

    text: str  # as the file has it
    name: str  # in lower case, words joined by "_", without the unit
    unit: str | None  # None: the heading states none


# columns that are no roles, and what they are
TIME = "time"
HEADWAY = "headway"
EXTRA = {
    TIME: "s",
    HEADWAY: "s",  # gap / speed, where no gap was recorded
    "spacing": "m",  # front to front; the length of the vehicle ahead is taken off
    "lead_length": "m",
    "length": "m",  # own
    "position": "m",  # of the front, along the road
    "lead_position": "m",
    "lane": "",
    "vehicle_id": "",
    "lead_id": "",
    "own_id": "",  # in a table that has the rows of both vehicles of a pair
    "episode": "",
}
# columns that name something: numbers or texts, not measured
IDS = ("vehicle_id", "lead_id", "own_id", "lane", "episode")

# usual names, apart from the role's own; compared as `Heading.name`. Left out are those that are used for several things
# (spacing, throttle, delta_v, acceleration of what, distance from where): `--columns` names them
ALIASES: dict[str, tuple[str, ...]] = {
    TIME: ("t", "timestamp", "time_stamp", "timestamps", "datetime", "date_time", "utc", "utc_time", "epoch",
           "seconds", "elapsed_time", "time_since_start", "recording_time", "interval", "device_time", "gps_time",
           "zeit", "uhrzeit", "zeitstempel"),
    "pedal": ("accelerator", "accelerator_pedal", "accel_pedal", "gas_pedal", "gas", "pedal_position",
              "accelerator_pedal_position", "accelerator_position", "pedal_pos", "app", "gas_pedal_position",
              "throttle_pedal", "accelerator_pedal_position_d", "accelerator_pos", "accelerator_pos_d",
              "fahrpedal", "gaspedal"),
    "speed": ("v", "v_ego", "ego_speed", "own_speed", "vehicle_speed", "speed_ego", "vego", "velocity", "ego_velocity",
              "speed_own", "car_speed", "follower_speed", "speed_follower", "self_speed", "v_follower", "host_speed",
              "ground_speed", "speed_obd", "obd_speed", "speed_canbus", "geschwindigkeit"),
    "lead_speed": ("v_lead", "speed_lead", "leader_speed", "speed_leader", "lead_velocity", "preceding_speed",
                   "lead_vehicle_speed", "target_speed", "v_leader", "vlead", "lv_speed"),
    "gap": ("lead_distance", "distance_to_lead", "distance_gap", "gap_distance", "lead_gap", "d_rel", "drel",
            "following_distance", "bumper_to_bumper", "distance_headway_net", "clearance", "range", "dist_to_lead",
            "inter_vehicle_distance", "target_distance", "abstand"),
    "range_rate": ("rangerate", "v_rel", "vrel", "relative_speed", "rel_speed", "relative_velocity", "lead_rel_speed",
                   "gap_rate", "lead_relative_speed", "rel_velocity", "relativgeschwindigkeit"),
    HEADWAY: ("thw", "time_headway", "time_gap", "headway_time", "tgap"),
    "lead_valid": ("has_lead", "lead_present", "lead_detected", "target_valid"),
    "lead_id": ("leader_id", "preceding_id", "target_id"),
    "episode": ("episode_id", "trajectory_id", "traj_id", "case_id", "event_id", "trip_id", "run_id", "segment_id"),
    "brake": ("brake_pressed", "brake_pedal", "brake_switch", "braking", "brake_active", "bremse"),
    "steering_assist": ("lka_active", "lkas_active", "lane_assist", "lane_assist_active", "steer_assist"),
    "cruise_active": ("acc_active", "cruise", "cruise_control", "acc", "acc_on", "cruise_enabled", "cruise_on"),
    "clutch": ("clutch_pressed", "clutch_pedal"),
    "accel": ("a", "ax", "acceleration", "a_ego", "ego_accel", "ego_acceleration", "long_accel", "aego",
              "longitudinal_acceleration", "own_acceleration", "accel_x", "vehicle_acceleration", "longitudinal_acc",
              "long_acc", "inline_acc", "beschleunigung"),
    "accel_command": ("accel_cmd", "commanded_acceleration", "acceleration_command", "target_acceleration"),
    "grade": ("slope", "road_grade"),
    "altitude": ("alt", "elevation", "height", "gps_altitude"),
    "east": ("e", "easting", "east_m"),
    "north": ("n", "northing"),
    "lat": ("latitude", "gps_latitude"),
    "lon": ("longitude", "lng", "long", "gps_longitude"),
    "yaw_rate": ("yawrate", "yaw_velocity"),
    "gnss_speed": ("gps_speed", "speed_gps", "speed_gnss"),
    "wheel_speed": ("wheelspeed",),
    "gear": ("gear_position", "current_gear"),
    "engine_speed": ("rpm", "engine_rpm"),
    "lateral_offset": ("lane_offset", "lateral_position", "lane_position", "offset_from_center", "lateral_deviation",
                       "distance_to_center", "lane_center_offset"),
    "steering_angle": ("steering_wheel_angle", "steer_angle", "steering", "steering_angle_deg", "swa"),
    "curvature": ("road_curvature",),
}  # fmt: skip
# times since a fixed date; where a table has times of another name as well (`canid export --time utc`), those are taken
DATED = ("utc", "utc_time", "epoch", "datetime", "date_time", "device_time", "gps_time")
# positive = closing: the other sign
CLOSING = ("closing_speed", "closing_rate", "closing_velocity", "approach_speed", "approach_rate")

_NAMED = {name: role for role, names in ALIASES.items() for name in names}
_NAMED |= dict.fromkeys(CLOSING, "range_rate")
_NAMED |= {role: role for role in (*ROLES, *EXTRA)}
# units that a name may end with, such as speed_kmh; an underscore stands for what an identifier cannot hold
_ENDINGS = {
    "kmh": "km/h", "kph": "km/h", "km_h": "km/h", "mph": "mph", "mps": "m/s", "m_s": "m/s", "ms": "ms", "us": "us",
    "ns": "ns", "s": "s", "sec": "s", "m": "m", "ft": "ft", "cm": "cm", "km": "km", "pct": "%", "percent": "%",
    "deg": "deg", "rad": "rad", "m_s2": "m/s2", "mps2": "m/s2", "ms2": "m/s2", "fps": "ft/s", "ft_s": "ft/s",
    "rad_s": "rad/s", "deg_s": "deg/s", "g": "g", "rpm": "rpm", "knots": "kn",
}  # fmt: skip
_BRACKETS = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*", re.DOTALL)
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
# characters; a heading that is longer names no role
MAX_HEADING = 200


def heading(text: str) -> Heading:
    """Read a heading.

    Example:
        >>> heading("gap [m]"), heading("speed_kmh").unit, heading("Vehicle Speed (km/h)").name
        (Heading(text='gap [m]', name='gap', unit='m'), 'km/h', 'vehicle_speed')
    """
    plain = text.strip().strip("\"'").strip()[:MAX_HEADING]
    match = _BRACKETS.fullmatch(plain)
    unit: str | None = None
    if match is not None and match["name"]:
        unit = (match["square"] if match["square"] is not None else match["round"]).strip()
        plain = match["name"]
    name = _name(plain)
    if unit is not None and (longer := _name(f"{plain} {unit}")) != name and longer in _NAMED:
        return Heading(text, longer, None)  # "Speed (GPS)"
    if unit is None and name not in _NAMED:
        for ending in sorted(_ENDINGS, key=len, reverse=True):
            if name.endswith(f"_{ending}"):
                return Heading(text, name.removesuffix(f"_{ending}"), _ENDINGS[ending])
    return Heading(text, name, unit)


def _name(text: str) -> str:
    return re.sub(r"[^0-9a-zA-Z%²°]+", "_", _CAMEL.sub("_", text)).strip("_").lower()


def role_of(heading: Heading) -> str | None:
    """The role, or the other column of `EXTRA`, that a heading names; None: nothing that is known.

    Example:
        >>> role_of(heading("v_ego [m/s]")), role_of(heading("gate"))
        ('speed', None)
    """
    return _NAMED.get(heading.name)


def closing(heading: Heading) -> bool:
    """Whether a heading names the range rate with the other sign.

    Example:
        >>> closing(heading("closing_speed"))
        True
    """
    return heading.name in CLOSING
