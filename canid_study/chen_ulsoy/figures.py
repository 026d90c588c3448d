"""Figures 4, 6-8 and 10-14 of Chen & Ulsoy 2001, made anew; 5 and 9 are block diagrams."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array
from canid_study.artifact import Curve, Figure, Panel
from canid_study.chen_ulsoy.bounds import EQ_5, OMEGA, Bound
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.poles import PolesAndGain, poles_and_gain
from canid_study.chen_ulsoy.robustness import OMEGA as LOOP_OMEGA
from canid_study.chen_ulsoy.robustness import Robustness
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.chen_ulsoy.unstructured import FREQUENCIES
from canid_study.printed_numbers import DC_GAIN_RANGE
from canid_study.systems.control_systems import frequency_response

_ERROR, _ANGLE, _HZ = "lateral error (m)", "steering angle (deg)", "frequency (Hz)"
# |Delta| of more segments would be a black area
_CURVES = 60


def figures(
    drivers: Sequence[Driver], bounds: Sequence[Bound], robust: dict[str, Robustness]
) -> tuple[Figure, ...]:
    """All figures. One driver's are those of the first."""
    driver = drivers[0]
    made = [
        _signals(driver),
        _spectra(driver),
        _coherence(driver),
        _residuals(driver),
        _bode(robust),
        _parameters(driver),
        _poles(driver),
    ]
    made += [_delta(driver), _bounds(bounds)]
    return tuple(figure for figure in made if figure is not None)


def _signals(d: Driver) -> Figure | None:
    if d.example is None:
        return None
    t: Array = d.dt * np.arange(len(d.example.error), dtype=np.float64)
    return Figure(
        "fig_04",
        f"Lateral error and steering angle, segment {d.example.number + 1} of {d.name}",
        (
            Panel("time (s)", _ERROR, (Curve(t, d.example.error, role="measured"),)),
            Panel("time (s)", _ANGLE, (Curve(t, d.example.angle, role="measured"),)),
        ),
    )


def _spectra(d: Driver) -> Figure | None:
    s = d.spectra
    if s is None:
        return None
    f = s.frequency[1:]
    return Figure(
        "fig_06",
        f"Spectra of {d.name}",
        (
            Panel(_HZ, "error (m²/Hz)", (Curve(f, s.error[1:], role="measured"),), log_x=True, log_y=True),
            Panel(_HZ, "angle (deg²/Hz)", (Curve(f, s.angle[1:], role="measured"),), log_x=True, log_y=True),
        ),
        f"From its largest value to the Nyquist frequency the error falls by {s.fall_error_db:.0f} dB and the angle by "
        f"{s.fall_angle_db:.0f} dB; the paper says nearly 200 dB.",
    )


def _coherence(d: Driver) -> Figure | None:
    s = d.spectra
    if s is None:
        return None
    f = s.frequency[1:]
    limit = Curve(f, np.full(len(f), s.threshold), "95 % of independent signals", role="limit", dashed=True)
    return Figure(
        "fig_07",
        f"Coherence of lateral error and steering angle, {d.name}",
        (
            Panel(
                _HZ,
                "coherence",
                (Curve(f, s.coherence[1:], "coherence", role="measured"), limit),
                y_range=(0.0, 1.0),
            ),
        ),
    )


def _residuals(d: Driver) -> Figure | None:
    if d.structures is None or not d.structures.plots:
        return None
    panels = []
    for name, plot in d.structures.plots.items():
        for what, y, bound in (
            ("autocorrelation", plot.auto, plot.auto_bound),
            ("correlation with the error", plot.cross, plot.cross_bound),
        ):
            ends = plot.lags[[0, -1]]
            limits = [Curve(ends, np.full(2, s * bound), role="limit", dashed=True) for s in (-1.0, 1.0)]
            panels.append(
                Panel("lag (samples)", what, (Curve(plot.lags, y, points=True), *limits), title=name)
            )
    return Figure(
        "fig_08",
        f"Residuals of ARX, ARMAX, OE and BJ with 99 % bounds, {d.name}",
        tuple(panels),
        "Correlation at negative lags is feedback.",
    )


def _bode(robust: dict[str, Robustness]) -> Figure | None:
    if not robust:
        return None
    gains, phases = [], []
    for name, r in robust.items():
        gains.append(Curve(LOOP_OMEGA, np.abs(r.loop), name))
        phases.append(Curve(LOOP_OMEGA, np.rad2deg(np.unwrap(np.angle(r.loop))), name))
    slope = Curve(LOOP_OMEGA, 0.5 / LOOP_OMEGA, "wc/s", role="published", dashed=True)
    return Figure(
        "fig_10",
        "Bode plot of driver and one-track car",
        (
            Panel("frequency (rad/s)", "|G_d P|", (*gains, slope), log_x=True, log_y=True),
            Panel("frequency (rad/s)", "phase (deg)", tuple(phases), log_x=True),
        ),
        "Near the crossover the loop falls as wc/s (the crossover model of Weir & McRuer).",
    )


def _parameters(d: Driver) -> Figure:
    t = d.number.astype(float) + 1.0
    panels = []
    for j, name in enumerate(NAMES):
        half = NORMAL_QUANTILE * np.sqrt(d.covariance[:, j, j])
        value = d.model[:, j]
        curves = [Curve(t, value, "one segment, 95 %", value - half, value + half, points=True)]
        if d.drift is not None:
            k = d.drift.number.astype(float) + 1.0
            curves.append(
                Curve(
                    k,
                    d.drift.level[:, j],
                    "smoothed, 95 %",
                    d.drift.low[:, j],
                    d.drift.high[:, j],
                    role="corrected",
                )
            )
        panels.append(Panel("segment", name, tuple(curves)))
    caption = ""
    if d.drift is not None:
        caption = (
            f"Likelihood ratio against a constant driver {d.drift.statistic:.1f}, p = {d.drift.p_value:.2g}."
        )
    return Figure("fig_11", f"Parameters of {d.name} over the drive", tuple(panels), caption)


def _poles(d: Driver) -> Figure:
    derived: PolesAndGain = poles_and_gain(d.model, d.covariance, d.dt)
    t = d.number.astype(float) + 1.0
    return Figure(
        "fig_12",
        f"Poles, zero and DC gain of {d.name}",
        (
            Panel(
                "real part (1/s)",
                "imaginary part (1/s)",
                (
                    Curve(derived.poles.real.ravel(), derived.poles.imag.ravel(), "poles", points=True),
                    Curve(derived.zero, np.zeros(len(derived.zero)), "zero", points=True, role="measured"),
                ),
            ),
            Panel(
                "segment",
                "DC gain (deg/m)",
                (
                    Curve(
                        t,
                        derived.gain,
                        "95 %",
                        derived.gain - derived.gain_half,
                        derived.gain + derived.gain_half,
                        points=True,
                    ),
                    *(Curve(t[[0, -1]], np.full(2, g), role="published", dashed=True) for g in DC_GAIN_RANGE),
                ),
            ),
        ),
        "Dashed: the range that the paper states.",
    )


def _delta(d: Driver) -> Figure:
    magnitude: Array = np.asarray(np.abs(d.delta), np.float64)
    step = max(len(magnitude) // _CURVES, 1)
    curves = [Curve(FREQUENCIES, row, role="other") for row in magnitude[::step]]
    curves.append(Curve(FREQUENCIES, np.median(magnitude, axis=0), "median"))
    caption = "With --bootstraps the null band is shown."
    if d.band is not None:
        top = _of_segments(d.band.segment)
        curves.append(
            Curve(FREQUENCIES, np.abs(d.band.mean), "no unmodeled dynamics: mean", role="corrected")
        )
        curves.append(
            Curve(FREQUENCIES, top, "no unmodeled dynamics: 95 % of a segment", role="limit", dashed=True)
        )
        caption = "A driver who is the model shows as much |Delta| as the lower of the two null curves: it is feedback."
    return Figure(
        "fig_13",
        f"Unstructured uncertainty of {d.name}",
        (Panel(_HZ, "|Delta| (deg/m)", tuple(curves), log_x=True, log_y=True),),
        caption,
    )


def _of_segments(x: Array) -> Array:
    known = x[np.isfinite(x).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(x.shape[1], np.nan)


def _bounds(limits: Sequence[Bound]) -> Figure | None:
    if not limits:
        return None
    # one driver, its fourth order model, and several drivers
    shown = [*limits[:2], *(limits[-1:] if len(limits) > 2 else [])]
    curves = [Curve(FREQUENCIES, b.magnitude, b.name) for b in shown]
    eq_5 = np.abs(frequency_response(EQ_5, OMEGA))
    curves.append(Curve(FREQUENCIES, eq_5, "eq. 5", role="published", dashed=True))
    return Figure(
        "fig_14",
        "Least first-order bounds of |Delta|",
        (Panel(_HZ, "|Delta| (deg/m)", tuple(curves), log_x=True, log_y=True),),
    )
