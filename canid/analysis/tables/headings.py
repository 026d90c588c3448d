"""Headings of a table: a column's name and unit, and the role that a name usually stands for."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import NamedTuple

from canid.analysis.tables.heading_words import closing_in_words, role_in_words
from canid.signals.vehicle.units import unit_of
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

# names of counters of time, as functions of microcontrollers are called, and their units
CLOCKS = {"millis": "ms", "milliseconds": "ms", "micros": "us", "microseconds": "us", "nanos": "ns",
          "nanoseconds": "ns"}  # fmt: skip
# usual names, apart from the role's own; compared as `Heading.name`. Left out are those that are used for several things
# (spacing, throttle, delta_v, acceleration of what, distance from where): `--columns` names them
ALIASES: dict[str, tuple[str, ...]] = {
    TIME: ("t", "timestamp", "time_stamp", "timestamps", "datetime", "date_time", "utc", "utc_time", "epoch",
           "x_value", "seconds", "elapsed_time", "time_since_start", "recording_time", "interval", "device_time", "gps_time",
           "local_time", "system_time", "time_of_day", "unix_time", "unix_timestamp", "rel_time", "abs_time",
           "simulation_time", "sim_time", "gps_tow", "tow", "time_of_week", "itow", "i_tow", "secs", "sec",
           "header_stamp_secs", "header_stamp_sec", "sensor_time", "host_time", "ts", "uptime", "elapsed", *CLOCKS),
    "pedal": ("accelerator", "accelerator_pedal", "accel_pedal", "gas_pedal", "gas", "pedal_position",
              "accelerator_pedal_position", "accelerator_position", "pedal_pos", "app", "gas_pedal_position",
              "throttle_pedal", "accelerator_pedal_position_d", "accelerator_pos", "accelerator_pos_d",
              "accelerator_position_d", "accel_pedal_pos", "app_pos", "acc_pedal", "acc_ped", "pps",
              "accelerator_pedal_pos"),
    "speed": ("v", "v_ego", "ego_speed", "own_speed", "vehicle_speed", "speed_ego", "vego", "velocity", "ego_velocity",
              "speed_own", "car_speed", "follower_speed", "speed_follower", "self_speed", "v_follower", "host_speed",
              "ground_speed", "corr_speed", "vss", "speed_obd", "obd_speed", "speed_canbus"),
    "lead_speed": ("v_lead", "speed_lead", "leader_speed", "speed_leader", "lead_velocity", "preceding_speed",
                   "lead_vehicle_speed", "target_speed", "v_leader", "vlead", "lv_speed"),
    "gap": ("lead_distance", "distance_to_lead", "distance_gap", "gap_distance", "lead_gap", "d_rel", "drel",
            "following_distance", "bumper_to_bumper", "distance_headway_net", "clearance", "range", "dist_to_lead",
            "inter_vehicle_distance", "target_distance"),
    "range_rate": ("rangerate", "v_rel", "vrel", "relative_speed", "rel_speed", "relative_velocity", "lead_rel_speed",
                   "gap_rate", "lead_relative_speed", "rel_velocity"),
    HEADWAY: ("thw", "time_headway", "time_gap", "headway_time", "tgap", "车头时距"),
    "lead_valid": ("has_lead", "lead_present", "lead_detected", "target_valid", "gap_valid", "range_valid"),
    "lead_id": ("leader_id", "preceding_id", "target_id"),
    "episode": ("drive", "drive_id", "trial", "trial_id", "session", "session_id", "scenario_id",
                "episode_id", "trajectory_id", "traj_id", "case_id", "event_id", "trip_id", "run_id", "segment_id"),
    "brake": ("brake_pressed", "brake_pedal", "brake_switch", "braking", "brake_active"),
    "steering_assist": ("lka_active", "lkas_active", "lane_assist", "lane_assist_active", "steer_assist"),
    "cruise_active": ("acc_active", "cruise", "cruise_control", "acc", "acc_on", "cruise_enabled", "cruise_on"),
    "clutch": ("clutch_pressed", "clutch_pedal"),
    "accel": ("a", "ax", "acceleration", "a_ego", "ego_accel", "ego_acceleration", "long_accel", "aego",
              "longitudinal_acceleration", "own_acceleration", "accel_x", "vehicle_acceleration", "longitudinal_acc",
              "long_acc", "inline_acc"),
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
DATED = (
    "utc", "utc_time", "epoch", "datetime", "date_time", "device_time", "gps_time", "local_time", "system_time",
    "time_of_day", "unix_time", "unix_timestamp", "abs_time", "host_time",
)  # fmt: skip
# positive = closing: the other sign
CLOSING = ("closing_speed", "closing_rate", "closing_velocity", "approach_speed", "approach_rate")

_NAMED = {name: role for role, names in ALIASES.items() for name in names}
_NAMED |= dict.fromkeys(CLOSING, "range_rate")
_NAMED |= {role: role for role in (*ROLES, *EXTRA)}
# units that a name may end with, such as speed_kmh; an underscore stands for what an identifier cannot hold
_ENDINGS = {
    "kmh": "km/h", "kph": "km/h", "kmph": "km/h", "km_hr": "km/h", "kmhr": "km/h", "km_h": "km/h", "mph": "mph",
    "mps": "m/s", "m_s": "m/s", "ms": "ms", "us": "us",
    "μs": "us", "ns": "ns", "s": "s", "sec": "s", "m": "m", "ft": "ft", "cm": "cm", "km": "km", "pct": "%",
    "percent": "%",
    "deg": "deg", "rad": "rad", "m_s2": "m/s2", "mps2": "m/s2", "ms2": "m/s2", "fps": "ft/s", "ft_s": "ft/s", "cmps": "cm/s",
    "cm_s": "cm/s", "mmps": "mm/s", "permille": "‰",
    "rad_s": "rad/s", "deg_s": "deg/s", "g": "g", "rpm": "rpm", "knots": "kn", "%": "%", "yd": "yd", "mi_h": "mph",
}  # fmt: skip
_BRACKETS = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*", re.DOTALL)
_STANDARD = re.compile(r"\s*\(SAE\)", re.IGNORECASE)  # whose definition a channel has, in HP Tuners' logs
_SOURCE = re.compile(r"(\s*[\[(][^\[\]()]*[\])])\s*\*(\w+)$")  # RaceChrono's "Speed (m/s) *obd"
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_ELISION = re.compile(r"\b[dl]['\u2019](?=\w)", re.IGNORECASE)  # "pédale d'accélérateur"
# the bus, or the control unit, that has sent a signal: "CAN 1::ABS::Speed", "ABS.Speed", "Speed@ABS"
_UNIT = (
    r"(?:(?:can|bus|ch|channel)[ _-]?\d{0,2}|abs|esp|esc|ebs|ecm|pcm|ecu|ems|dme|tcm|vdc|dsc|radar|chassis|powertrain"
    r"|platform\(\)|model root|ego|(?:xcp|ccp|etkc?)(?::\d+)?)"
)
_SENDER = re.compile(
    rf"^/?(?:{_UNIT}(?:::?//|::|[./\\:])\ *)+(?=\w)|(?<=\w)[@\\]{_UNIT}(?=\s*(?:[\[(]|$))", re.IGNORECASE
)
# characters; a heading that is longer names no role
MAX_HEADING = 200
# a signal's heading with the path of what has it
_PATH = re.compile(r"(?P<path>[^\[(]*(?:::|[./\\])(?=\S))(?P<name>[^\W\d][^./\\:\[(]*(?:[\[(].*)?)")
_MIN_SIGNALS = 3


def heading(text: str) -> Heading:
    """Read a heading.

    Example:
        >>> heading("gap [m]"), heading("speed_kmh").unit, heading("Vehicle Speed (km/h)").name
        (Heading(text='gap [m]', name='gap', unit='m'), 'km/h', 'vehicle_speed')
        >>> [heading(text)[1:] for text in ("pedal in %", "Gap / m", "車速（km/h）", "pedal [-]")]
        [('pedal', '%'), ('gap', 'm'), ('車速', 'km/h'), ('pedal', None)]
    """
    if len(text) > MAX_HEADING:
        return Heading(text, "-", None)
    plain = unicodedata.normalize("NFKC", text.strip().strip("\"'").strip())
    plain = _SOURCE.sub(r" \2\1", _STANDARD.sub("", plain))
    match = _BRACKETS.fullmatch(plain)
    unit: str | None = None
    if match is not None and match["name"]:
        unit = (match["square"] if match["square"] is not None else match["round"]).strip().strip("-") or None
        plain = match["name"]
    else:
        for mark in (",", " in "):
            if (parts := plain.rpartition(mark))[0] and unit_of(parts[2]) is not None:
                plain, unit = parts[0], parts[2].strip()
    name = _name(plain)
    if unit is not None and (longer := _name(f"{plain} {unit}")) != name and longer in _NAMED:
        return Heading(text, longer, None)  # "Speed (GPS)"
    if unit is None and name not in _NAMED:
        for ending in sorted(_ENDINGS, key=len, reverse=True):
            if name.endswith(f"_{ending}"):
                return Heading(text, name.removesuffix(f"_{ending}").removesuffix("_in"), _ENDINGS[ending])
    return Heading(text, name, CLOCKS.get(name) if unit is None else unit)


def parsed_without_path(headings: Sequence[str]) -> list[Heading]:
    """Read headings, without the path of a model or a message that all signals begin with: "Model Root/Speed [km/h]".

    Example:
        >>> [head.name for head in parsed_without_path(["time", *(f"Model Root/{x}" for x in ("Speed", "Gap", "Pedal"))])]
        ['time', 'speed', 'gap', 'pedal']
        >>> [head.name for head in parsed_without_path(["CAN 1::ABS::Speed [km/h]", "ECM.Gap", "gap"])]
        ['speed', 'ecm_gap', 'gap']
    """
    parsed = [heading(text) for text in headings]
    known = {*map(role_of, parsed)}
    # what no column without a sender is
    bare = [heading(_SENDER.sub("", head.text.strip()))._replace(text=head.text) for head in parsed]
    parsed = [
        head if role_of(head) or role_of(short) in known else short
        for head, short in zip(parsed, bare, strict=True)
    ]
    matches = [_PATH.fullmatch(text.strip()) for text in headings]
    paths = {match["path"] for match in matches if match is not None}
    signals = sum(match is not None for match in matches)
    # a path that says something, as that of the lead, or one of several, is no decoration
    if len(paths) != 1 or signals < _MIN_SIGNALS or not {*map(role_of, parsed)} <= {TIME, None}:
        return parsed
    return [
        head if match is None else heading(match["name"])._replace(text=head.text)
        for head, match in zip(parsed, matches, strict=True)
    ]


def _name(text: str) -> str:
    # without accents; the marks of kana are parts of letters
    parted = unicodedata.normalize("NFD", text)
    bare = "".join(x for x in parted if not unicodedata.combining(x) or x in "\u3099\u309a")
    bare = unicodedata.normalize("NFC", bare)  # Hangul
    return re.sub(r"[^\w%°]+|_+", "_", _CAMEL.sub("_", _ELISION.sub("", bare))).strip("_").lower()


def role_of(heading: Heading) -> str | None:
    """The role, or the other column of `EXTRA`, that a heading names; None: nothing that is known.

    Example:
        >>> role_of(heading("v_ego [m/s]")), role_of(heading("Geschwindigkeit [km/h]")), role_of(heading("gate"))
        ('speed', 'speed', None)
        >>> role_of(heading("FAV acc (m/s^2)")), role_of(heading("LV acc (m/s^2)")), role_of(heading("vehicle acc"))
        ('accel', None, None)
    """
    role = _NAMED.get(heading.name) or role_in_words(heading.name)
    if (
        role is None
        and (unit := unit_of(heading.unit or "")) is not None
        and unit.dimension == "acceleration"
    ):
        return role_in_words(re.sub(r"(?<![a-z])acc(?![a-z])", "accel", heading.name))
    return role


def in_words(heading: Heading) -> bool:
    """Whether a heading is none of the usual names, and its role is what its words say.

    Example:
        >>> in_words(heading("speed of the lead vehicle")), in_words(heading("lead_speed"))
        (True, False)
    """
    return heading.name not in _NAMED


def closing(heading: Heading) -> bool:
    """Whether a heading names the range rate with the other sign.

    Example:
        >>> closing(heading("closing_speed"))
        True
    """
    return heading.name in CLOSING or (in_words(heading) and closing_in_words(heading.name))
