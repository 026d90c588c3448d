"""Names of inputs, roles, effects, states and parameters as people read them."""

from __future__ import annotations

from canid.values.text.numbers import UNITS, gain_unit

# symbols of the driver's parameters (docs/glossary.md)
SYMBOLS = {"K": "K", "tau": "τ", "dead_time": "θ", "tau_plus_dead_time": "τ+θ"}
# the mark of the headline estimate: of all estimators the one to quote
HEADLINE_MARK = "▶"


def readable(name: str) -> str:
    """An identifier of an input, a role, an effect or a state in words.

    Example:
        >>> readable("lateral_offset"), readable("not_enough_data")
        ('lateral offset', 'not enough data')
    """
    return name.replace("_", " ")


def capitalised(text: str) -> str:
    """A sentence with a capital; a Greek letter is a symbol and stays as it is.

    Example:
        >>> capitalised("speed is frozen"), capitalised("τ and θ may not be quoted")
        ('Speed is frozen', 'τ and θ may not be quoted')
    """
    return text[:1].upper() + text[1:] if text[:1].isascii() else text


def either(names: tuple[str, ...]) -> str:
    """Effects of which the data cannot say which one it is.

    Example:
        >>> either(("lateral_offset", "yaw_rate"))
        'lateral offset or yaw rate'
    """
    return " or ".join(map(readable, names))


def method(estimator: str) -> str:
    """What an estimator is called; FOPDT and ARMAX are abbreviations.

    Example:
        >>> method("fopdt"), method("diagnose")
        ('FOPDT', 'diagnose')
    """
    return estimator.upper() if estimator in ("fopdt", "armax") else estimator


def parameter(key: str, output: str) -> tuple[str, str]:
    """Name and unit of a parameter in `Report.shifts`.

    Example:
        >>> parameter("range_rate K", "pedal"), parameter("range_rate tau", "pedal"), parameter("p0", "pedal")
        (('range rate K', '% per m/s'), ('range rate τ', 's'), ('p0', '%'))
    """
    channel, _, what = key.rpartition(" ")
    if not channel:
        return label(key), UNITS.get(output, "")
    if what == "K" and channel in UNITS:
        return label(key), gain_unit(output, channel)
    return label(key), "s" if what in ("tau", "dead_time", "tau_plus_dead_time") else ""


def label(key: str) -> str:
    """A parameter of a channel, an effect or a drive in words.

    Example:
        >>> label("range_rate tau_plus_dead_time"), label("noise_sd"), label("some_effect: ratio")
        ('range rate τ+θ', 'noise sd', 'some effect: ratio')
    """
    channel, _, what = key.rpartition(" ")
    return f"{readable(channel)} {SYMBOLS.get(what, readable(what))}".strip()
