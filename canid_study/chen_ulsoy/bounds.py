"""Least first-order bounds above |Delta| as eq. 5 (Fig. 14), their validation, and robust stability with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import NAN, Array
from canid_study.artifact import Cell, Table
from canid_study.chen_ulsoy import robustness
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.robustness import Robustness
from canid_study.chen_ulsoy.unstructured import FREQUENCIES
from canid_study.printed_numbers import EQ_5_DEN, EQ_5_NUM
from canid_study.systems.control_systems import System, frequency_response
from canid_study.systems.first_order_envelope import first_order_envelope

OMEGA = 2.0 * np.pi * FREQUENCIES
# eq. 5 is that of the paper's driver S3
EQ_5 = System(EQ_5_NUM, EQ_5_DEN)


class Bound(NamedTuple):
    """A bound of |Delta| from one set of segments, and how another set keeps it."""

    name: str
    system: System  # (num1 s + num0) / (s + den0)
    magnitude: Array  # (F,) of the bound
    largest: Array  # (F,) |Delta| that it is above
    above: float  # share of the validation's segments and frequencies above it; NaN: none to validate
    segments: int


def bound(name: str, estimation: Array, validation: Array | None) -> Bound | None:
    """Least first-order bound of |Delta|.

    Args:
        name: whose.
        estimation: (S, F) magnitudes; rows with NaN are left out.
        validation: (V, F) or None.

    >>> limit = bound("one", np.abs(frequency_response(EQ_5, OMEGA))[None], None)
    >>> [round(x, 1) for x in limit.system.num], [round(x, 1) for x in limit.system.den]
    ([5.0, 0.5], [1.0, 2.5])
    """
    x = estimation[np.isfinite(estimation).all(axis=1)]
    if not len(x):
        return None
    largest = x.max(axis=0)
    if not (largest > 0.0).all():
        return None
    system = first_order_envelope(OMEGA, largest).system
    magnitude = np.abs(frequency_response(system, OMEGA))
    above = NAN
    if validation is not None:
        y = validation[np.isfinite(validation).all(axis=1)]
        above = float((y > magnitude * (1.0 + 1e-9)).mean()) if len(y) else NAN
    return Bound(name, system, magnitude, largest, above, len(x))


def bounds(drivers: Sequence[Driver]) -> list[Bound]:
    """Bounds of each driver (odd segments; even ones validate), of its fourth order model, and of half of the drivers."""
    limits = []
    for d in drivers:
        odd = d.number % 2 == 0
        limits.append(bound(d.name, np.abs(d.delta[odd]), np.abs(d.delta[~odd])))
        limits.append(
            bound(f"{d.name}, fourth order", np.abs(d.delta_fourth[odd]), np.abs(d.delta_fourth[~odd]))
        )
    if len(drivers) > 1:
        half = (len(drivers) + 1) // 2
        estimation, validation = (
            np.abs(np.concatenate([d.delta for d in part])) for part in (drivers[:half], drivers[half:])
        )
        limits.append(bound(f"{half} drivers", estimation, validation))
    return [b for b in limits if b is not None]


def table(limits: Sequence[Bound]) -> Table:
    """Eq. 5 refitted."""
    rows: list[list[Cell]] = [
        [b.name, b.system.num[0], b.system.num[1], b.system.den[1], b.segments, b.above] for b in limits
    ]
    rows.append(["eq. 5 (S3)", EQ_5_NUM[0], EQ_5_NUM[1], EQ_5_DEN[1], None, None])
    return Table(
        "bounds",
        "Least bound |(n1 jw + n0) / (jw + d0)| of |Delta| up to 1 Hz",
        ("of", "n1 (deg/m)", "n0 (deg/m s)", "d0 (1/s)", "segments", "validation above it"),
        rows,
        "Odd segments estimate and even ones validate; across drivers the first half and the second.",
    )


def robust(drivers: Sequence[Driver], limits: Sequence[Bound], speed: float) -> dict[str, Robustness]:
    """Loop of each driver's joint model with the assumed car, within the driver's own bound."""
    by_name = {b.name: b for b in limits}
    return {
        d.name: robustness.of_model(d.joint.model, by_name[d.name].magnitude, speed)
        for d in drivers
        if d.joint is not None and d.name in by_name
    }


def robust_table(made: dict[str, Robustness], speed: float) -> Table:
    """Margins of each driver."""
    rows: list[list[Cell]] = []
    for name, r in made.items():
        rows.append(
            [
                name,
                "yes" if r.stable else "no",
                r.margins.crossover,
                r.margins.phase_margin_deg,
                r.margins.gain_margin,
                r.margins.delay_margin_s,
                r.margins.modulus_margin,
                None if r.disk is None else r.disk.disk,
                None if r.disk is None else r.disk.gain_margin,
                None if r.disk is None else r.disk.phase_margin_deg,
                r.small_gain,
                r.small_gain_hz,
            ]
        )
    return Table(
        "robustness",
        f"Robust stability with a one-track car at {speed:g} m/s",
        (
            "driver",
            "stable",
            "crossover (rad/s)",
            "phase margin (deg)",
            "gain margin",
            "delay margin (s)",
            "modulus margin",
            "disk margin",
            "disk gain margin",
            "disk phase margin (deg)",
            "max |Delta P / (1 + L)|",
            "at (Hz)",
        ),
        rows,
        "The car is an assumption: 1,500 kg, 2,500 kg m², axles at 1.2 and 1.5 m, cornering stiffness 80 and 90 kN/rad, "
        "steering ratio 15. Below 1 in the column before the last: stable for every Delta within the driver's bound.",
    )


def delta_table(drivers: Sequence[Driver]) -> Table:
    """Delta against its null band."""
    rows: list[list[Cell]] = []
    for d in drivers:
        e, z = d.excess, d.dead_zone
        rows.append(
            [
                d.name,
                float(np.median(np.abs(d.delta))),
                float(np.abs(d.delta).max()),
                *(
                    (None, None, None, None)
                    if e is None or d.band is None
                    else (e.share, e.frequencies, float(np.max(e.distance)), d.band.limit)
                ),
                *((None, None, None) if z is None else (z.statistic, z.p_value, z.half_width)),
            ]
        )
    return Table(
        "unmodeled",
        "Unmodeled dynamics: |Delta| against its null band, and a dead zone",
        (
            "driver",
            "median |Delta| (deg/m)",
            "largest |Delta| (deg/m)",
            "share above the band of its segment",
            "share of frequencies above the simultaneous band",
            "largest squared distance",
            "simultaneous limit",
            "dead zone: z",
            "dead zone: p",
            "dead zone: half width (m)",
        ),
        rows,
        "Null: repetitions of the same loop without unmodeled dynamics, where about 0.05 of |Delta| lies above the band of "
        "its segment. The mean of Delta over the segments is compared with a simultaneous band. Without --bootstraps the "
        "band is not made.",
    )
