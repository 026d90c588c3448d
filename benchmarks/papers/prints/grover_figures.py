"""Figures of what is recomputed from Grover 2021."""

from __future__ import annotations

import numpy as np

from benchmarks.papers.prints import loop_margins, reduction
from benchmarks.papers.prints.grover_results import Results
from benchmarks.papers.prints.transfer_functions import system
from canid.values.types import Array
from canid_study.artifact import Curve, Figure, Panel
from canid_study.grover import miso_bound
from canid_study.printed_numbers import (
    EQ_2_4,
    EQ_2_5,
    EQ_2_8,
    MISO_FIT_PERCENT,
)
from canid_study.systems import control_systems

# s: until the resonances of eq. 2.4 have decayed to a fifth
STEP_S = 5.0
# Hz: from a slow following to five times the upper resonance
BAND_HZ = (0.02, 16.0)


def figures(r: Results) -> tuple[Figure, ...]:
    """Step, Bode and Nyquist plots, poles, reductions, the bound of the sum, string stability.

    Args:
        r: recomputed.
    """
    return (_responses(r), _poles(r), _reduction(r), _miso(), _string_stability(r))


def _responses(r: Results) -> Figure:
    printed = control_systems.first_order(EQ_2_8.K, EQ_2_8.tau)
    t = np.linspace(0.0, STEP_S, 1001)
    w = 2.0 * np.pi * np.geomspace(*BAND_HZ, 600)
    g, g1 = (control_systems.frequency_response(s, w) for s in (system(EQ_2_4), printed))
    f = w / (2.0 * np.pi)

    def pair(x: Array, of_whole: Array, of_reduced: Array) -> tuple[Curve, Curve]:
        return Curve(x, of_whole, "eq. 2.4"), Curve(x, of_reduced, "eq. 2.8", role="published", dashed=True)

    steps = (control_systems.step_response(system(EQ_2_4), t), control_systems.step_response(printed, t))
    phases = (np.degrees(np.unwrap(np.angle(x))) for x in (g, g1))
    return Figure(
        "grover_eq_2_4",
        "Eq. 2.4 and its printed reduction, eq. 2.8",
        (
            Panel("time (s)", "pedal (%) for 1 s", pair(t, *steps), "Step response"),
            Panel("frequency (Hz)", "gain (% per s)", pair(f, np.abs(g), np.abs(g1)), "Bode", True, True),
            Panel("frequency (Hz)", "phase (°)", pair(f, *phases), "", True),
            Panel(
                "real",
                "imaginary",
                (
                    Curve(g.real, g.imag, "eq. 2.4"),
                    Curve(g1.real, g1.imag, "eq. 2.8", role="published", dashed=True),
                ),
                "Nyquist",
                equal=True,
            ),
        ),
        "The reduction has 3.4 times the gain of a constant input and none of the resonances.",
    )


def _poles(r: Results) -> Figure:
    poles, zeros = r.second.poles, r.second.zeros
    grows = poles.real > 0.0
    tall = 60.0  # 1/s, above the largest imaginary part
    return Figure(
        "grover_eq_2_5_poles",
        "Poles of eq. 2.5",
        (
            Panel(
                "real (1/s)",
                "imaginary (1/s)",
                (
                    Curve(poles.real[~grows], poles.imag[~grows], "stable poles", points=True),
                    Curve(poles.real[grows], poles.imag[grows], "unstable poles", points=True, role="limit"),
                    Curve(zeros.real, zeros.imag, "zeros", points=True, role="other"),
                    Curve(np.zeros(2), np.array([-tall, tall]), role="limit", dashed=True),
                ),
            ),
        ),
        "What lies right of the dashed line grows.",
    )


def _reduction(r: Results) -> Figure:
    def over(shape: str, what: str) -> tuple[Array, Array]:
        chosen = [p for p in r.first_p1 if p.spectrum.shape == shape]
        return np.array([p.spectrum.band_hz for p in chosen]), np.array([getattr(p, what) for p in chosen])

    ends = np.array([reduction.BANDS_HZ[0], reduction.BANDS_HZ[-1]])

    def panel(what: str, label: str, printed: float | None) -> Panel:
        curves = [
            Curve(*over("flat", what), "input flat to that band"),
            Curve(*over("low-pass", what), "low-pass input of that corner", role="corrected"),
        ]
        if printed is not None:
            curves.append(Curve(ends, np.full(2, printed), "printed: eq. 2.8", role="published", dashed=True))
        return Panel("band of the input (Hz)", label, tuple(curves), log_x=True)

    return Figure(
        "grover_reduction",
        "First-order model nearest to eq. 2.4, over the band of its input",
        (
            panel("K", "K (% per s)", EQ_2_8.K),
            panel("tau", "tau (s)", EQ_2_8.tau),
            panel("fit_percent", "fit (%)", None),
        ),
        "No band gives the printed gain; the lag is near the printed one only where the fit is below 20 %.",
    )


def _miso() -> Figure:
    each = np.linspace(50.0, 100.0, 101)
    low, high = np.array([miso_bound.bound(float(x), float(x)) for x in each]).T
    mean = 0.5 * (EQ_2_4.fit_percent + EQ_2_5.fit_percent)
    return Figure(
        "grover_miso_bound",
        "Fit of the sum of two models that each fit the output alone",
        (
            Panel(
                "fit of each alone (%)",
                "fit of the sum (%)",
                (
                    Curve(each, 0.5 * (low + high), "possible", low=low, high=high),
                    Curve(
                        np.array([mean]),
                        np.array([MISO_FIT_PERCENT]),
                        "printed",
                        points=True,
                        role="published",
                    ),
                ),
            ),
        ),
        "The better each fits alone, the nearer is the sum to twice the output, a fit of 0.",
    )


def _string_stability(r: Results) -> Figure:
    f = loop_margins.OMEGA / (2.0 * np.pi)
    # above 0.5 Hz nothing is left
    low = f < 0.5
    names = {d.driver.name: role for d, role in zip(r.loops[:8:2], _ROLES, strict=True)}
    panels = tuple(
        Panel(
            "frequency (Hz)",
            "|v / v_lead|",
            (
                *(
                    Curve(f[low], x.string[low], x.driver.name, role=names[x.driver.name])
                    for x in r.loops
                    if x.speed == speed and x.reading == loop_margins.LAG
                ),
                Curve(np.array([f[0], 0.5]), np.ones(2), role="limit", dashed=True),
            ),
            f"{speed:g} m/s",
            True,
        )
        for speed in loop_margins.SPEEDS
    )
    return Figure(
        "grover_string_stability",
        "String stability of the printed drivers with an assumed car",
        panels,
        "Above 1 a wave of the lead's speed grows from car to car. tau as a lag; as a dead time the curves are the "
        "same within 0.0001 at the peak.",
    )


# four drivers, four colors
_ROLES = ("published", "reproduced", "corrected", "measured")
