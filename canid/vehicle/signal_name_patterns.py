"""Name patterns of the signals of each role, from public DBC files, for `propose`."""

from __future__ import annotations

_OTHER_SPEED_NAMES = (
    r"lead|target|obj|track|rel|engine|eng\b|wheel|whl|\bset\b|limit|fan|yaw|cruise|gps|gnss|motor|turbine"
    r"|wiper|max|min|count|checksum"
)
# matches no name at all
NO_NAME = r"$^"
# role -> (pattern of its name, pattern that excludes a name). Names are compared in lower case with words
# separated by blanks: "LeadRelSpeed" is "lead rel speed".
NAME_PATTERNS: dict[str, tuple[str, str]] = {
    "pedal": (
        r"(gas|accel\w*|acc) ?ped|pedal pos|^pedal$|throttle (pedal|pos)|\bapp\b",
        r"brake|clutch|press|released",
    ),
    "speed": (r"(veh\w*|car|ego|own) ?(spd|speed|vel)|^speed$|forward speed", _OTHER_SPEED_NAMES),
    "lead_speed": (r"(lead|target|obj)\w* (abs )?(spd|speed|vel)", r"rel"),
    "gap": (
        r"(lead|target|obj)\w* ?(long )?(dist|range|gap)|^(gap|headway dist\w*)$|distance to (lead|object)",
        r"rate|rel|set|lat",
    ),
    "range_rate": (r"rel\w* ?(spd|speed|vel)|range ?rate|closing", r"lat"),
    "lead_valid": (r"(lead|target|obj)\w* ?(valid|detected|present)", NO_NAME),
    "brake": (r"brake ?(pedal )?(pressed|switch|active|light|on)\b", r"park|hold|acc|cruise"),
    "cruise_active": (r"(cruise|acc) ?(control )?(active|engaged|enabled|on)\b", r"accel"),
    "clutch": (r"clutch ?(pedal )?(pressed|switch)", NO_NAME),
    "accel": (r"(long\w*|lgt) ?acc|acc\w* ?(x|long\w*)\b", r"cmd|command|req|lat|pedal|setting"),
    "accel_command": (r"accel\w* (cmd|command|req\w*)\b|(acc|cruise)\w* acc\w* req", r"alt$"),
    "grade": (r"grade|slope|incline|inclination", r"lat"),
    "altitude": (r"altitude|elevation", NO_NAME),
    "east": (r"^east\w*$", NO_NAME),
    "north": (r"^north\w*$", NO_NAME),
    "lat": (r"^(gps |gnss )?lat\w*tude$|^lat$", NO_NAME),
    "lon": (r"^(gps |gnss )?long?\w*tude$|^lon$", NO_NAME),
    "yaw_rate": (r"yaw ?rate", r"offset|bias|valid|stat"),
    "gnss_speed": (r"(gps|gnss) ?(spd|speed|vel)", NO_NAME),
    "wheel_speed": (r"wheel ?(spd|speed)( avg| average| mean)?$", r"fl|fr|rl|rr|front|rear|left|right|yaw"),
    "reverse": (r"^reverse$|reverse (gear|light|engaged|active)", r"lever|req|lock|possible"),
    "gear": (r"^(current |actual )?gear$|gear (pos|act|engaged)", r"lever|shift|req"),
    "engine_speed": (r"(engine|eng|motor) ?(spd|speed|rpm)|^rpm$", r"fan|target|idle"),
    "lateral_offset": (r"(lateral|lane|lat) ?(offset|pos\w*|dev\w*)", r"left|right"),
    "curvature": (r"(road|lane) ?curv\w*", r"rate|deriv\w*|left|right"),
    "steering_angle": (r"steer\w*( wheel)? ?(angle|ang)\b", r"rate|speed|offset|torque|cmd|req|frac"),
}
