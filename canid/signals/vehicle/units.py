"""Units as written in DBC files, and their conversion to the unit of a role."""

from __future__ import annotations

import math
import re
import unicodedata
from typing import NamedTuple


class Unit(NamedTuple):
    """`value_in_base = value * factor`; units of one dimension convert into each other."""

    dimension: str
    factor: float


# Exact by definition (international mile 1609.344 m, foot 0.3048 m, standard gravity 9.80665 m/s², knot
# 1852 m/h).
_KMH, _MPH, _KNOT = 1 / 3.6, 0.44704, 1852 / 3600
_TABLE: tuple[tuple[str, float, tuple[str, ...]], ...] = (
    ("speed", 1.0, ("m/s", "mps", "ms-1", "meter/sec", "m/sec", "meters/second", "metres/second", "м/с")),
    (
        "speed",
        _KMH,
        ("km/h", "kph", "kmh", "kmph", "km/hr", "kmh-1", "kilometers/hour", "kilometres/hour", "км/ч"),
    ),
    ("speed", _MPH, ("mph", "mi/h", "mile/h", "miles/h", "mile/hour", "miles/hour")),
    ("speed", _KNOT, ("kn", "knot", "knots", "kt", "kts")),
    ("speed", 0.3048, ("ft/s", "fps", "feet/second")),
    ("speed", _KMH, ("km/t", "km/u", "km/std", "km/sa", "km/godz", "km/hod")),
    ("speed", _KMH, ("км/год", "公里/小时", "公里/小時")),
    ("speed", 1.0, ("米/秒", "公尺/秒")),
    ("speed", 1 / 60, ("m/min",)),
    ("speed", 0.3048 / 60, ("ft/min", "fpm")),
    ("speed", 0.01, ("cm/s",)),
    ("speed", 0.001, ("mm/s",)),
    ("length", 1.0, ("m", "meter", "meters", "metre", "metres", "м")),
    ("length", 1.0, ("米", "公尺")),
    ("length", 1000.0, ("km",)),
    ("length", 0.01, ("cm",)),
    ("length", 0.1, ("dm",)),
    ("length", 0.001, ("mm",)),
    ("length", 0.3048, ("ft", "feet", "foot")),
    ("length", 0.9144, ("yd", "yard", "yards")),
    ("length", 1609.344, ("mi", "mile", "miles")),
    (
        "acceleration",
        1.0,
        ("m/s2", "m/s/s", "mps2", "ms-2", "m/sec2"),
    ),
    ("curvature", 1.0, ("1/m", "m-1", "rad/m")),
    ("curvature", 0.001, ("1/km", "km-1")),
    ("acceleration", 9.80665, ("g", "g's")),
    ("acceleration", 0.00980665, ("mg",)),
    ("acceleration", 0.3048, ("ft/s2", "fps2")),
    ("acceleration", _KMH, ("km/h/s", "kph/s")),
    ("angle", 1.0, ("rad", "radian", "radians")),
    ("angle", 0.001, ("mrad",)),
    ("angle", math.pi / 180, ("deg", "°", "degree", "degrees", "degr")),
    ("angular rate", 1.0, ("rad/s", "rad/sec")),
    ("angular rate", 0.001, ("mrad/s",)),
    ("angular rate", math.pi / 180, ("deg/s", "°/s", "deg/sec", "dps", "degree/s", "degrees/s", "degs-1")),
    ("ratio", 1.0, ("%", "percent", "pct", "prozent")),
    ("ratio", 100.0, ("0..1", "0-1", "1", "fraction", "ratio", "pu")),
    ("ratio", 0.1, ("‰", "permille", "promille")),
    ("rotation", 1.0, ("rpm", "1/min", "u/min", "r/min", "min-1", "rev/min", "/min")),
    ("rotation", 60.0, ("rps", "1/s", "rev/s")),
    ("time", 1.0, ("s", "sec", "second", "seconds", "с", "сек")),
    ("time", 0.001, ("ms", "msec")),
)
# signs of powers and products: m·s⁻¹, m/s**2, p.u.
_TYPOGRAPHY = re.compile(r"\s|\^|\*|·|(?<=[a-z])\.(?=[a-z])")
_UNITS = {name: Unit(dimension, factor) for dimension, factor, names in _TABLE for name in names}


def unit_of(text: str) -> Unit | None:
    """Find the unit that a text names, or None. Case, inner blanks and how a power is written do not matter.

    Example:
        >>> unit_of("KPH")
        Unit(dimension='speed', factor=0.2777777777777778)
        >>> unit_of("m·s⁻¹") == unit_of("m s^-1") == unit_of("m/s"), unit_of("m/s²") == unit_of("m/s**2")
        (True, True)
        >>> unit_of("bananas") is None, unit_of("meters per second") == unit_of("м/с") == unit_of("m/s")
        (True, True)
    """
    text = text.replace(" per ", "/")
    plain = _TYPOGRAPHY.sub("", unicodedata.normalize("NFKC", text).lower().replace("\u2212", "-"))
    return _UNITS.get(plain.strip("[]."))


def factor_to(source: str, target: str) -> float | None:
    """Return the factor from `source` to `target`; None if their dimensions differ or one is unknown.

    Example:
        >>> factor_to("mph", "m/s"), factor_to("0..1", "%"), factor_to("deg", "m")
        (0.44704, 100.0, None)
    """
    a, b = unit_of(source), unit_of(target)
    if a is None or b is None or a.dimension != b.dimension:
        return None
    return a.factor / b.factor


def examples(target: str) -> str:
    """List a few names of units that convert to `target`, for a message.

    Example:
        >>> examples("rad/s")
        'rad/s, mrad/s, deg/s'
    """
    wanted = unit_of(target)
    firsts = [names[0] for dimension, _, names in _TABLE if wanted and dimension == wanted.dimension]
    return ", ".join(firsts)
