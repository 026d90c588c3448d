"""Unit of the driver's output in a finding: effects state their strengths for a pedal."""

from __future__ import annotations

PEDAL_UNIT, ACCELERATION_UNIT = "%", "m/s²"


def in_output_unit(text: str, *, pedal: bool) -> str:
    """An effect's sentence or unit in the unit of the output.

    Args:
        text: with "%" or "output units" (in a unit: "output") where the output's unit belongs.
        pedal: is the output a pedal? Else it is an acceleration.

    Example:
        >>> in_output_unit("by {gain} % per m/s", pedal=False), in_output_unit("output/(m/s²)", pedal=True)
        ('by {gain} m/s² per m/s', '% per m/s²')
    """
    unit = PEDAL_UNIT if pedal else ACCELERATION_UNIT
    for word in ("output units", "output/", PEDAL_UNIT):
        text = text.replace(word, unit + "/" * word.endswith("/"))
    return text.replace("/(", " per ").removesuffix(")") if "/(" in text and "{" not in text else text
