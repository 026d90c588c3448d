"""One row per equation, table, figure and claim of Chen & Ulsoy 2001."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.papers.prints.chen_ulsoy_results import DRAWS, Results
from benchmarks.papers.prints.constant_driver import C1_VALUES, NULL_HZ, ConstantDriver
from benchmarks.papers.prints.uncertainty_bound import FREQUENCIES_HZ
from canid.values.types import Array
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.printed_numbers import (
    DC_GAIN_RANGE,
    EXCITATION_ORDER,
    FALL_AT_NYQUIST_DB,
    FPE_INCREASE,
    FPE_PARAMETERS,
    RELIABLE_HZ,
    SEGMENT_SAMPLES,
    SEGMENTS,
    STATIONARY_SHARE,
    STEERING_TABLES,
    SUBJECTS,
    ZERO_RANGE,
    SteeringTable,
)

HOLDS, FAILS, IMPOSSIBLE = ClaimVerdict.HOLDS, ClaimVerdict.FAILS, ClaimVerdict.IMPOSSIBLE
AMBIGUOUS, NOT_CHECKABLE, SHOWN = ClaimVerdict.AMBIGUOUS, ClaimVerdict.NOT_CHECKABLE, ClaimVerdict.SHOWN

_MEASURED_BY = "canid study chen-ulsoy LOG makes it anew from any log"
_REPRODUCE = "canid study chen-ulsoy --reproduce"
_DRAWING = "a drawing or a photograph without a number"
_NO_DATA = "the data are not public, and the text holds no curve"
# Table 1's and Table 2's estimation
_ESTIMATION = (0, 2)


def rows(r: Results) -> tuple[Artifact, ...]:
    """All rows.

    Args:
        r: recomputed.
    """
    return (*_equations(r), *_tables(r), *_figures(r), *_claims(r))


def _equations(r: Results) -> tuple[Artifact, ...]:
    return (
        Artifact(
            "eq. 1",
            "ARMAX: A delta = B y + C e",
            "A, B, C of the time shift",
            "",
            "",
            AMBIGUOUS,
            "c1, the standard deviation of e and the units of delta and y are not printed: a simulation has to "
            "assume them (b in degrees per meter, claim C7)",
        ),
        Artifact(
            "eq. 2",
            "final prediction error",
            f"{100 * FPE_INCREASE:.0f} % more at {FPE_PARAMETERS} parameters and {SEGMENT_SAMPLES} samples",
            f"factor {r.fpe:.4f}",
            "",
            HOLDS,
            "the M of its numerator must be N (claim C6)",
        ),
        Artifact(
            "eq. 3",
            "orders 2, 2, 1 and a delay of one sample",
            "a phase lead with a delay",
            f"zero {_zeros(r)}, poles {_poles(r)} 1/s",
            "",
            HOLDS,
            "the zero is slower than both poles, which is a phase lead",
            ("tables/chen_ulsoy_means.csv",),
        ),
        Artifact(
            "eq. 4",
            "|Delta| as the ratio of two Fourier transforms",
            "",
            "",
            "",
            NOT_CHECKABLE,
            f"the paper itself replaces it by an ARX model of order 2; {_MEASURED_BY}",
        ),
        Artifact(
            "eq. 5",
            "bound of |Delta|",
            "(5 s + 0.5) / (s + 2.5)",
            _ratios(r),
            "",
            AMBIGUOUS,
            "claim C8",
            ("figures/chen_ulsoy_fig_14.svg", "tables/chen_ulsoy_bound.csv"),
        ),
    )


def _tables(r: Results) -> tuple[Artifact, ...]:
    out = []
    for k, i in enumerate(_ESTIMATION):
        t, m = STEERING_TABLES[i], r.means[i]
        fitted = r.fitted[k]
        miss = float(np.max(np.abs(fitted.sd / np.array(t.sd) - 1.0)))
        out.append(
            Artifact(
                f"Table {t.table}",
                "mean and standard deviation of a1, a2, b1, b2, "
                f"{'one driver' if t.drivers == 1 else 'twelve drivers'}",
                f"b1 {t.mean[2]:g} ± {t.sd[2]:g}",
                f"of the means: poles {m.poles_s[0]:.3f}, {m.poles_s[1]:.3f}, zero {m.zero_s:.4f} 1/s, DC gain "
                f"{m.dc_gain:.3f}",
                f"a distribution with these standard deviations (within {100 * miss:.1f} %) and stable drivers has "
                f"corr(a1, a2) {fitted.corr[0, 1]:.3f}, corr(b1, b2) {fitted.corr[2, 3]:.4f}",
                AMBIGUOUS,
                "means and standard deviations without correlations, minima, maxima and numbers of segments do not "
                "describe the drivers (claim C2)",
                ("tables/chen_ulsoy_means.csv", "tables/chen_ulsoy_correlations.csv"),
            )
        )
    return tuple(out)


def _figures(r: Results) -> tuple[Artifact, ...]:
    def drawing(number: int, what: str) -> Artifact:
        return Artifact(f"Fig. {number}", what, "", "", "", NOT_CHECKABLE, _DRAWING)

    def data(number: int, what: str) -> Artifact:
        return Artifact(f"Fig. {number}", what, "", "", "", NOT_CHECKABLE, f"{_NO_DATA}; {_MEASURED_BY}")

    low, _, high = r.fitted[0].dc_5_50_95
    return (
        drawing(1, "black-box model"),
        drawing(2, "driver with additive uncertainty"),
        drawing(3, "scene of the simulator"),
        data(4, "steering and lateral error over time"),
        drawing(5, "experiment as a block diagram"),
        data(6, "spectra"),
        data(7, "coherence"),
        data(8, "residuals of ARX, ARMAX, OE and Box–Jenkins models"),
        drawing(9, "ARMAX as a block diagram"),
        Artifact(
            "Fig. 10",
            "driver with vehicle: crossover",
            "-20 dB per decade about the crossover",
            _crossover(r, "deg"),
            "",
            HOLDS,
            "claim C7",
            ("figures/chen_ulsoy_fig_10.svg", "tables/chen_ulsoy_crossover.csv"),
        ),
        data(11, "parameters over the segments"),
        Artifact(
            "Fig. 12",
            "poles, zero and DC gain of the segments",
            f"DC gain {DC_GAIN_RANGE[0]:g} to {DC_GAIN_RANGE[1]:g}, zero {ZERO_RANGE[0]:g} to {ZERO_RANGE[1]:g} 1/s",
            f"with independent standard deviations the DC gain is {r.draws[0].kept_dc_percentiles[0]:.0f} to "
            f"{r.draws[0].kept_dc_percentiles[2]:.0f} (5 to 95 %)",
            f"with the correlations fitted: {low:.2f} to {high:.2f}",
            HOLDS,
            "the means agree with it, the printed standard deviations alone do not (claims C1, C2)",
            ("figures/chen_ulsoy_fig_12.svg",),
        ),
        data(13, "|Delta| of one driver"),
        Artifact(
            "Fig. 14",
            "bounds of |Delta|, of order 2, order 4 and several drivers",
            "eq. 5; the others are curves only",
            _ratios(r),
            "",
            NOT_CHECKABLE,
            f"eq. 5 is drawn against |G_d|; the other bounds are not printed. {_MEASURED_BY}",
            ("figures/chen_ulsoy_fig_14.svg",),
        ),
    )


def _claims(r: Results) -> tuple[Artifact, ...]:
    first, second = (r.means[i] for i in _ESTIMATION)
    draws = r.draws[0]
    needed = [c.corr_needed for c in r.needed]
    low, _, high = draws.kept_dc_percentiles
    shares = [_by_c1(r, lambda c, k=k: c.sd[k] / c.table.sd[k]) for k in (0, 2)]
    bias = _by_c1(r, lambda c: c.mean[2] / c.table.mean[2] - 1.0)
    passing = _by_c1(r, lambda c: c.passing_steering)
    offsets = _by_c1(r, lambda c: c.passing_offset)
    smallest = min(min(t.p_mean, t.p_sd) for t in r.odd_even)
    small_gain = [c.small_gain for c in r.crossovers if c.unit == "deg"]
    typical = [float(np.median(c.null[:, 0])) for c in r.constant]
    largest = [float(np.max(c.null[:, 0])) for c in r.constant]
    c1s = ", ".join(f"{c:g}" for c in C1_VALUES) + f"; {DRAWS} drives each, ± standard error"
    return (
        Artifact(
            "claim C1",
            "poles, zero and DC gain of Fig. 12",
            f"zero between {ZERO_RANGE[0]:g} and {ZERO_RANGE[1]:g} 1/s, DC gain {DC_GAIN_RANGE[0]:g} to "
            f"{DC_GAIN_RANGE[1]:g}, one pole close to the origin",
            f"means of Table 1: poles {first.poles_s[0]:.3f}, {first.poles_s[1]:.3f}, zero {first.zero_s:.4f} 1/s, DC "
            f"gain {first.dc_gain:.3f} ({_half_range(first.dc_gain_rounding)} by rounding). Table 2: "
            f"{second.poles_s[0]:.3f}, {second.poles_s[1]:.3f}, {second.zero_s:.4f}, {second.dc_gain:.3f}",
            "",
            HOLDS,
            "zero and DC gain lie in the stated ranges; a pole at -1.7 to -2.2 1/s is close to the origin only next "
            "to the other one",
            ("tables/chen_ulsoy_means.csv", "figures/chen_ulsoy_fig_12.svg"),
        ),
        Artifact(
            "claim C2",
            "mean and standard deviation describe the structured uncertainty",
            "Tables 1 and 2",
            f"drawn independently from Table 1: {100 * draws.complex_poles:.0f} % complex poles, "
            f"{100 * draws.unstable:.0f} % unstable, DC gain {low:.0f} to {high:.0f} (5 to 95 %), "
            f"{100 * draws.kept_dc_share:.0f} % of the stable within Fig. 12",
            f"corr(b1, b2) {max(needed):.5f} or nearer to -1 where A is at its mean and Fig. 12's "
            f"DC gains are ±1.96 std ({max(map(_hard_correlation, STEERING_TABLES)):.4f} where they are its limits); a "
            f"joint distribution that agrees "
            f"with all prints has {r.fitted[0].corr[2, 3]:.4f} and corr(a1, a2) {r.fitted[0].corr[0, 1]:.3f}",
            FAILS,
            "the correlations carry the information, and none is printed; those of a with b are not fixed by the "
            "prints",
            ("figures/chen_ulsoy_fig_12.svg", "tables/chen_ulsoy_correlations.csv"),
        ),
        Artifact(
            "claim C3",
            "the scatter is the driver changing with time (sec. 4.1)",
            "std of Table 1",
            f"a constant driver at the means, {SEGMENTS} minutes simulated and fitted, has "
            f"{shares[0]} % of the printed std of a1 and {shares[1]} % of that of "
            f"b1 (c1 {c1s})",
            "",
            FAILS,
            f"sampling alone makes a large part of it, and how much depends on c1, which is not printed; {_REPRODUCE} "
            "splits it for all drivers",
            ("tables/chen_ulsoy_constant_driver.csv",),
        ),
        Artifact(
            "claim C4",
            "so many segments are stationary, and the 2 h are not (sec. 2.1)",
            f"about {100 * STATIONARY_SHARE:.0f} %",
            f"the constant driver passes in {passing} % of the segments (steering), "
            f"{offsets} % (offset; c1 {c1s}); a driver who is another one each minute has |z| "
            f"{abs(r.changing_z):.2f} over 2 h",
            "",
            FAILS,
            "95 % is what a test of that level passes where nothing changes, and the test finds trends, not changes: "
            f"it supports neither reading. {_REPRODUCE} repeats it",
            ("tables/chen_ulsoy_constant_driver.csv",),
        ),
        Artifact(
            "claim C5",
            "odd and even segments agree (sec. 4.3)",
            "means and standard deviations of Tables 1 and 2",
            f"t and F tests: smallest p {smallest:.2f} of {2 * len(r.odd_even)}",
            "",
            HOLDS,
            "alternate minutes of the same drives cannot disagree much; a validation on other drivers is not printed",
            ("tables/chen_ulsoy_odd_even.csv",),
        ),
        Artifact(
            "claim C6",
            "the final prediction error hardly penalises (eq. 2)",
            f"{100 * FPE_INCREASE:.0f} %",
            f"{100 * (r.fpe - 1):.1f} %",
            "",
            HOLDS,
            "M in the numerator must be N",
        ),
        Artifact(
            "claim C7",
            "crossover principle (Fig. 10)",
            "L like omega_c / s about the crossover",
            _crossover(r, "deg"),
            "",
            HOLDS,
            "with b in degrees per meter; with b in rad per meter "
            f"{sum(not c.stable for c in r.crossovers if c.unit == 'rad')} of "
            f"{sum(c.unit == 'rad' for c in r.crossovers)} loops are unstable, so that the unit, which is not "
            "printed, is degrees",
            ("figures/chen_ulsoy_fig_10.svg", "tables/chen_ulsoy_crossover.csv"),
        ),
        Artifact(
            "claim C8",
            "eq. 5 bounds the model error",
            f"reliable to {RELIABLE_HZ:g} Hz",
            _ratios(r),
            f"small gain max |Delta P / (1 + L)| {min(small_gain):.2f} to {max(small_gain):.2f}; simulated, a driver "
            f"without any unmodelled dynamics shows {100 * min(typical):.0f} to {100 * max(typical):.0f} % of eq. 5 "
            f"at {NULL_HZ[0]:g} Hz (median of the segments), {100 * max(largest):.0f} % at most",
            AMBIGUOUS,
            "below 1: the printed driver with the printed uncertainty is robustly stable with the assumed car, just "
            f"so at {max(c.speed for c in r.crossovers):g} m/s. Part of the bound is sampling: {_REPRODUCE} measures "
            "how much",
            ("figures/chen_ulsoy_fig_14.svg", "tables/chen_ulsoy_bound.csv"),
        ),
        Artifact(
            "claim C9",
            "no anti-aliasing filter is needed (sec. 2.1)",
            f"almost {FALL_AT_NYQUIST_DB:.0f} dB down near the Nyquist frequency",
            f"the paper's own C/A falls {r.falls_db[0]:.0f} to {r.falls_db[1]:.0f} dB",
            "",
            FAILS,
            "of the printed means, c1 from -0.5 to 0.3; a signal 200 dB down is below the resolution of any recording",
        ),
        Artifact(
            "claim C10",
            "twelve drivers scatter less than one (sec. 4.2)",
            f"std of b1 {STEERING_TABLES[2].sd[2]:g} against {STEERING_TABLES[0].sd[2]:g}",
            f"the other eleven: mean b1 {r.eleven[2][0]:.3f}, std {r.eleven[2][1]:.3f}",
            "",
            HOLDS,
            "possible by arithmetic, for all four parameters",
        ),
        Artifact(
            "claim C11",
            "odd segments estimate, even segments validate",
            f"of 120; {SEGMENTS} in sec. 3",
            f"{SEGMENTS // 2} and {SEGMENTS - SEGMENTS // 2}",
            "",
            AMBIGUOUS,
            "which ones depends on whether they are numbered before the first one is left out; rejected segments are "
            "not counted",
        ),
        Artifact(
            "claim C12",
            f"statistics of {SUBJECTS} drivers",
            "six drivers estimate |Delta|, six validate (sec. 4.2)",
            f"Table 2: estimation and validation of {SUBJECTS}",
            "",
            AMBIGUOUS,
            "parameters and |Delta| are validated differently, or six drivers are twelve in the table's title",
        ),
        Artifact(
            "claim C13",
            "the mean over the segments is the driver",
            "Tables 1 and 2",
            f"a constant driver's mean b1 is found {bias} % too large (c1 {c1s})",
            "",
            FAILS,
            f"fits of one minute are biased in a closed loop, and the mean of many is as biased; {_REPRODUCE} "
            "measures it over more settings",
            ("tables/chen_ulsoy_constant_driver.csv",),
        ),
        Artifact(
            "claim C14",
            "curves of Fig. 3 to 8 and 11 to 14, |Delta|, the bound of order 4",
            "",
            "",
            "",
            NOT_CHECKABLE,
            f"{_NO_DATA}; {_MEASURED_BY}",
        ),
        Artifact(
            "sec. 2.3, excitation",
            f"y excites persistently of order {EXCITATION_ORDER}",
            f"order {EXCITATION_ORDER} tested",
            "",
            "",
            NOT_CHECKABLE,
            f"the covariance of y is not printed; {_MEASURED_BY}",
        ),
        Artifact(
            "sec. 3, coherence of y and n",
            "close to unity up to 1 Hz, which justifies the linear form of |Delta|",
            "close to unity",
            "",
            "",
            NOT_CHECKABLE,
            f"n is made of y by the model, and its spectrum is not printed; {_MEASURED_BY}",
        ),
        Artifact(
            "sec. 2.3, vehicle",
            "lateral modes of the one-track model",
            "about 1 Hz",
            f"{r.car_modes_hz[0]:.2f} to {r.car_modes_hz[1]:.2f} Hz at 20 to 30 m/s",
            "",
            HOLDS,
            "natural frequency of lateral velocity and yaw rate of the assumed car",
        ),
    )


def _crossover(r: Results, unit: str) -> str:
    chosen = [c for c in r.crossovers if c.unit == unit]
    wc = np.array([c.margins.crossover for c in chosen])
    pm = np.array([c.margins.phase_margin_deg for c in chosen])
    gm = np.array([c.margins.gain_margin for c in chosen])
    slope = float(np.mean([c.slope_db for c in chosen]))
    return (
        f"crossover {wc.min():.2f} to {wc.max():.2f} rad/s, {slope:.0f} dB per decade, phase margin {pm.min():.0f} to "
        f"{pm.max():.0f}°, gain margin {gm.min():.1f} to {gm.max():.1f}"
    )


def _ratios(r: Results) -> str:
    at = {float(f): [float(x.ratio[i]) for x in r.ratios] for i, f in enumerate(FREQUENCIES_HZ)}
    dc = [x.dc_ratio for x in r.ratios]
    return (
        f"|Delta| / |G_d| {min(dc):.2f} at 0 Hz, "
        + ", ".join(f"{min(at[f]):.2f} to {max(at[f]):.2f} at {f:g} Hz" for f in (0.05, 0.5, 1.0))
        + f", above 1 from {min(x.below_driver_hz for x in r.ratios):.1f} Hz"
    )


def _range(x: Array) -> str:
    low, high = (f"{float(v):.0f}" for v in (np.min(x), np.max(x)))
    return low if low == high else f"{low} to {high}"


def _half_range(ends: tuple[float, float]) -> str:
    return f"± {0.5 * (ends[1] - ends[0]):.3f}"


def _zeros(r: Results) -> str:
    return ", ".join(f"{r.means[i].zero_s:.2f}" for i in _ESTIMATION)


def _poles(r: Results) -> str:
    return ", ".join(f"{p:.2f}" for i in _ESTIMATION for p in r.means[i].poles_s)


def _by_c1(r: Results, value: Callable[[ConstantDriver], float]) -> str:
    """Mean and standard error over the draws of each c1, in percent."""
    said = []
    for c1 in C1_VALUES:
        x = 100.0 * np.array([value(c) for c in r.constant if c.c1 == c1])
        said.append(f"{x.mean():.1f} ± {x.std(ddof=1) / len(x) ** 0.5:.1f}")
    return ", ".join(said)


def _hard_correlation(table: SteeringTable) -> float:
    """Correlation of b1 and b2 that keeps the DC gain between Fig. 12's limits, A at its mean.

    No distribution between two limits has a standard deviation above half their distance (Popoviciu 1935).
    """
    largest = 0.5 * (DC_GAIN_RANGE[1] - DC_GAIN_RANGE[0]) * abs(1.0 + table.mean[0] + table.mean[1])
    s1, s2 = table.sd[2:]
    return (largest**2 - s1**2 - s2**2) / (2.0 * s1 * s2)
