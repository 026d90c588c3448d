"""Margins and string stability of driver and car as rows of a table."""

from __future__ import annotations

from canid.systems.identified_loop import IdentifiedLoop
from canid.types import Interval
from canid.views.identification_summary import string_sentence
from canid.views.numbers import interval


def rows(loop: IdentifiedLoop) -> list[tuple[str, str]]:
    """Name and value; empty where they are not given.

    Example:
        >>> rows(IdentifiedLoop("too short"))
        []
    """
    if loop.says:
        return []
    known: list[tuple[str, Interval, str]] = [
        ("phase margin", loop.phase_margin, "°"),
        ("gain margin (factor)", loop.gain_margin, ""),
        ("delay margin", loop.delay_margin, "s"),
        ("modulus margin, least |1 + L|", loop.modulus_margin, ""),
        ("crossover frequency", loop.crossover, "rad/s"),
        ("largest |v/v_lead| (string stability)", loop.string_peak, ""),
        ("at frequency", loop.string_peak_frequency, "Hz"),
    ]
    out = [(name, interval(value, unit)) for name, value, unit in known]
    if loop.car is not None:
        out += [
            ("car: acceleration per pedal", interval(loop.car.strength, "m/s² per %")),
            ("car: lag", interval(loop.car.lag, "s")),
        ]
    return out


def about(loop: IdentifiedLoop) -> str:
    """Where the loop is linearised."""
    return (
        f"The loop of driver and car at the drive's medians, {loop.speed:.1f} m/s and {loop.headway:.1f} s of headway; "
        "95 % intervals from draws of the joint posterior"
    )


def says(loop: IdentifiedLoop) -> str:
    """String stability in a sentence, or why there are no margins."""
    if loop.says:
        return loop.says
    unstable = f" {loop.unstable:.1%} of the draws are unstable." if loop.unstable > 0.0 else ""
    return f"String stability: {string_sentence(loop)}.{unstable}"
