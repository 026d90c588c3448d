"""Tables of what is recomputed from Chen & Ulsoy 2001."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.papers.prints.chen_ulsoy_results import Results
from benchmarks.papers.prints.odd_even import PARAMETERS
from benchmarks.papers.prints.uncertainty_bound import FREQUENCIES_HZ
from canid_study.artifact import Cell, Table
from canid_study.printed_numbers import STEERING_TABLES


def tables(r: Results) -> tuple[Table, ...]:
    """Models of the means, correlations, crossover, the bound, odd and even segments, the constant driver.

    Args:
        r: recomputed.
    """
    means: list[Sequence[Cell]] = [
        (
            t.name,
            *t.mean,
            *t.sd,
            *m.poles_s,
            m.zero_s,
            m.dc_gain,
            *m.dc_gain_rounding,
            d.unstable,
            d.complex_poles,
            *d.kept_dc_percentiles,
            d.kept_dc_share,
            c.corr_needed,
        )
        for t, m, d, c in zip(STEERING_TABLES, r.means, r.draws, r.needed, strict=True)
    ]
    correlations: list[Sequence[Cell]] = [
        (t.name, name, *(float(x) for x in f.corr[k]), t.mean[k], float(f.mean[k]), t.sd[k], float(f.sd[k]))
        for t, f in zip(r.estimation, r.fitted, strict=True)
        for k, name in enumerate(PARAMETERS)
    ]
    crossovers = [
        (
            c.table.name,
            c.unit,
            c.speed,
            "yes" if c.stable else "no",
            c.margins.crossover,
            c.margins.phase_margin_deg,
            c.margins.gain_margin,
            c.margins.delay_margin_s if c.stable else None,
            c.slope_db,
            c.small_gain,
        )
        for c in r.crossovers
    ]
    bounds = [
        (x.table.name, float(f), float(x.bound[i]), float(x.driver[i]), float(x.ratio[i]))
        for x in r.ratios
        for i, f in enumerate(FREQUENCIES_HZ)
    ]
    constant = [
        (
            c.table.name,
            c.c1,
            c.seed,
            name,
            c.table.mean[k],
            float(c.mean[k]),
            c.table.sd[k],
            float(c.sd[k]),
            float(c.sd[k] / c.table.sd[k]),
            c.corr_b,
            c.passing_steering,
            c.passing_offset,
            c.rejected,
        )
        for c in r.constant
        for k, name in enumerate(PARAMETERS)
    ]
    return (
        Table(
            "chen_ulsoy_means",
            "Tables 1 and 2: models of the means, and independent draws",
            (
                "table",
                *PARAMETERS,
                *(f"sd of {p}" for p in PARAMETERS),
                "slow pole (1/s)",
                "fast pole (1/s)",
                "zero (1/s)",
                "DC gain",
                "DC gain, rounding low",
                "DC gain, rounding high",
                "drawn: unstable share",
                "drawn: complex share",
                "drawn: DC gain 5 %",
                "drawn: DC gain 50 %",
                "drawn: DC gain 95 %",
                "drawn: share within Fig. 12",
                "corr(b1, b2) needed",
            ),
            means,
            "Drawn: 200,000 models with the printed standard deviations, normal and independent; the DC gain of "
            "those that are stable.",
        ),
        Table(
            "chen_ulsoy_correlations",
            "Correlations of a distribution that agrees with all prints",
            (
                "table",
                "parameter",
                *(f"corr with {p}" for p in PARAMETERS),
                "mean, printed",
                "mean, fitted",
                "sd, printed",
                "sd, fitted",
            ),
            correlations,
            "Fitted to means, standard deviations and the range of the DC gain. corr(a1, a2) and corr(b1, b2) are "
            "fixed by the prints; those of a with b are not: other values agree as well.",
        ),
        Table(
            "chen_ulsoy_crossover",
            "The mean drivers with a one-track car",
            (
                "table",
                "b in",
                "speed (m/s)",
                "stable",
                "crossover (rad/s)",
                "phase margin (°)",
                "gain margin",
                "delay margin (s)",
                "slope (dB/decade)",
                "max |Delta P/(1+L)|",
            ),
            crossovers,
            "Car assumed: 1500 kg, 2500 kg m², axles 1.2 and 1.5 m from the center of gravity, 80 and 90 kN/rad, "
            "steering ratio 15. Small gain: below 1 the uncertainty of eq. 5 cannot destabilise the loop.",
        ),
        Table(
            "chen_ulsoy_bound",
            "Eq. 5 against the mean driver",
            ("table", "frequency (Hz)", "|Delta|", "|G_d|", "ratio"),
            bounds,
        ),
        Table(
            "chen_ulsoy_odd_even",
            "Odd against even segments",
            ("table", "parameter", "p of equal means", "p of equal standard deviations"),
            [(f"Table {t.table}", t.parameter, t.p_mean, t.p_sd) for t in r.odd_even],
            "Welch's t and the F test, as if no segment had been rejected.",
        ),
        Table(
            "chen_ulsoy_constant_driver",
            "One-minute fits of a simulated driver who never changes",
            (
                "table",
                "c1",
                "seed",
                "parameter",
                "true",
                "mean of the fits",
                "sd, printed",
                "sd of the fits",
                "share of the printed sd",
                "corr(b1, b2)",
                "stationary share, steering",
                "stationary share, offset",
                "rejected segments",
            ),
            constant,
            "119 minutes at 25 m/s, noise 0.25°, a road that moves the car by 0.1 m/s; ARMAX(2, 2, 1) with one "
            "sample of delay.",
        ),
    )
