"""Tables of what is recomputed from Grover 2021."""

from __future__ import annotations

from benchmarks.papers.prints.grover_results import Results
from canid_study.artifact import Table


def tables(r: Results) -> tuple[Table, ...]:
    """Poles and zeros, reductions over the input spectra, margins.

    Args:
        r: recomputed.
    """
    points = [
        (equation, kind, float(z.real), float(z.imag), f, d)
        for equation, p in (("2.4", r.first), ("2.5", r.second))
        for kind, at in (("pole", p.poles), ("zero", p.zeros))
        for z, f, d in zip(
            at,
            p.frequency_hz.tolist() if kind == "pole" else [None] * len(at),
            p.damping.tolist() if kind == "pole" else [None] * len(at),
            strict=True,
        )
    ]
    reductions = [
        (
            one.spectrum.name,
            one.spectrum.band_hz,
            one.K,
            one.tau,
            one.fit_percent,
            delayed.K,
            delayed.tau,
            delayed.dead_time,
            delayed.fit_percent,
            other.K,
            other.tau,
            other.fit_percent,
            other_delayed.K,
            other_delayed.tau,
            other_delayed.dead_time,
            other_delayed.fit_percent,
            printed,
        )
        for one, delayed, other, other_delayed, printed in zip(
            r.first_p1, r.first_p1d, r.second_p1, r.second_p1d, r.printed_fits, strict=True
        )
    ]
    margins = [
        (
            x.driver.name,
            x.reading,
            x.speed,
            x.margins.phase_margin_deg,
            x.margins.gain_margin,
            x.margins.delay_margin_s,
            x.margins.crossover,
            x.margins.modulus_margin,
            x.disk.disk,
            x.disk.gain_margin,
            x.disk.phase_margin_deg,
            x.string_peak,
            x.string_peak_hz,
        )
        for x in r.loops
    ]
    return (
        Table(
            "grover_poles",
            "Poles and zeros of eq. 2.4 and 2.5",
            ("equation", "kind", "real (1/s)", "imaginary (1/s)", "frequency (Hz)", "damping"),
            points,
            "A real part above 0, and a damping below 0, grows.",
        ),
        Table(
            "grover_reductions",
            "Nearest first-order models of eq. 2.4 and 2.5 for 22 input spectra",
            (
                "input",
                "band (Hz)",
                "2.4 P1 K",
                "2.4 P1 tau (s)",
                "2.4 P1 fit (%)",
                "2.4 P1D K",
                "2.4 P1D tau (s)",
                "2.4 P1D dead time (s)",
                "2.4 P1D fit (%)",
                "2.5 P1 K",
                "2.5 P1 tau (s)",
                "2.5 P1 fit (%)",
                "2.5 P1D K",
                "2.5 P1D tau (s)",
                "2.5 P1D dead time (s)",
                "2.5 P1D fit (%)",
                "fit of eq. 2.8 (%)",
            ),
            reductions,
            "Least squares of the output, weighted by the input's spectrum; P1D has a dead time. Of eq. 2.5, which "
            "is unstable, the frequency response is reduced.",
        ),
        Table(
            "grover_margins",
            "Drivers of Tables 1 and 2 with an assumed car",
            (
                "driver",
                "tau is a",
                "speed (m/s)",
                "phase margin (°)",
                "gain margin",
                "delay margin (s)",
                "crossover (rad/s)",
                "modulus margin",
                "disk margin",
                "disk gain margin",
                "disk phase margin (°)",
                "max |v/v_lead|",
                "at (Hz)",
            ),
            margins,
            "Car: 0.04 m/s² per % of pedal, lag 0.3 s, drag 0.05 1/s; desired headway 2 s. Disk margins are balanced "
            "(Seiler, Packard & Gahinet 2020).",
        ),
        Table(
            "grover_single_input",
            "One input at a time: what it finds of the printed drivers without noise",
            (
                "driver",
                "speed (m/s)",
                "band of the lead (Hz)",
                "record (s)",
                "error of K1",
                "fit of headway alone (%)",
                "lag at its limit",
                "error of K2",
                "fit of relative speed alone (%)",
                "corr(headway error, relative speed)",
            ),
            [
                (
                    x.driver.name,
                    x.speed,
                    x.lead_band_hz,
                    x.record_s,
                    x.K1_error,
                    x.K1_fit_percent,
                    "yes" if x.lag_at_limit else "no",
                    x.K2_error,
                    x.K2_fit_percent,
                    x.correlation,
                )
                for x in r.single
            ],
            "Least squares over the lead's motion in closed loop, tau as a lag; errors are relative, -1 is a gain of "
            "0.",
        ),
    )
