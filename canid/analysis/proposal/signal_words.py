"""Names and units of DBC files as plain words: compound names are split, units of all spellings become canid's."""

from __future__ import annotations

import re
from functools import cache

from canid.signals.vehicle.units import unit_of

# spellings of units that `signals.vehicle.units` does not know: arxml-like names, German words, typing mistakes
_UNIT_SPELLINGS: tuple[tuple[str, str], ...] = (
    (r"km/?h?(or|/|\^)mph|k(p|m)h/mph|mph(or|/)k(p|m/)h", "km/h or mph"),
    (r"(unit_?)?kilo?met(er|re)s?(per|/)h(our|r)?|km(\^|p|per)?h(r|our)?|km/hr|km/std|kms?/h", "km/h"),
    (r"(unit_?)?mi(le)?s?(per|/)h(our|r)?", "mph"),
    (
        r"(unit_?)?met(er|re)s?(per|/)sec(on)?d?(squared?|squar|\^?2|²)|m/s(ec)?(\^|\*\*)?(2|²)|mps\^?2|m/s/s",
        "m/s2",
    ),
    (r"(unit_?)?met(er|re)s?(per|/)s(ec)?(on)?d?s?|mtr/s(ec)?|m/sek", "m/s"),
    (r"(unit_?)?(per_?cent\w*|prozent|pct|pc)|%.*", "%"),
    (r"(unit_?)?(degr?e?e?s?|grad|°)(ofarc)?(per|/)(s|sek|sec)(on)?d?s?|deg/sek", "deg/s"),
    (r"(unit_?)?(degr?e?e?s?|grad)(ofarc)?", "deg"),
    (r"(unit_?)?rad(ian)?s?(per|/)s(ec)?(on)?d?s?", "rad/s"),
    (r"(unit_?)?met(er|re)s?|mtr", "m"),
    (r"(unit_?)?centimet(er|re)s?", "cm"),
    (r"(unit_?)?kilomet(er|re)s?", "km"),
    (r"(unit_?)?(rotations?|revolutions?|u|rev)?(per|/)min(ute?)?|upm|tr/min|tours/min", "rpm"),
    (r"(unit_?)?g(ravity)?('s)?", "g"),
)
_SPELLINGS = tuple((re.compile(pattern), unit) for pattern, unit in _UNIT_SPELLINGS)
# either of the two, as the instrument cluster is set
EITHER_SPEED = "km/h or mph"


@cache
def words(name: str) -> str:
    """Split the name of a signal into words.

    Example:
        >>> words("LeadRelSpeed"), words("GAS_PEDAL"), words("MO_Fahrpedalrohwert_01")
        ('lead rel speed', 'gas pedal', 'mo fahrpedalrohwert 01')
    """
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    split = re.sub(r"(?<=[A-Za-z]{3})(?=[0-9])", " ", split)
    return " ".join(re.sub(r"[^0-9A-Za-z\u00c0-\u024f]+", " ", split).split()).lower()


def dbc_unit(text: str) -> str:
    """The unit that a DBC names, as canid writes it; "" where it names none that is known.

    Example:
        >>> dbc_unit("Unit_KiloMeterPerHour"), dbc_unit("m/sec^2"), dbc_unit("SED"), dbc_unit("km/h or MPH")
        ('km/h', 'm/s2', '', 'km/h or mph')
    """
    plain = "".join(text[:80].split()).lower().strip("[]?() ")
    if not plain:
        return ""
    for pattern, unit in _SPELLINGS:
        if pattern.fullmatch(plain):
            return unit
    return text if unit_of(text) else ""
