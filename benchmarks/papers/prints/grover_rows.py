"""One row per equation, table, figure and claim of Grover 2021."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from benchmarks.papers.prints import reduction, reduction_bound
from benchmarks.papers.prints.grover_results import GROWTH_S, Results
from benchmarks.papers.prints.sentences import sentences
from benchmarks.papers.prints.single_input import LEAD_BANDS_HZ
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.printed_numbers import (
    EQ_2_4,
    EQ_2_5,
    EQ_2_8,
    EQ_2_9,
    GROVER_DRIVERS,
    MISO_FIT_PERCENT,
    REDUCED_FIT_PERCENT,
    THW_DESIRED_S,
)
from canid_study.systems.control_systems import Complex, Missing

HOLDS, FAILS, IMPOSSIBLE = ClaimVerdict.HOLDS, ClaimVerdict.FAILS, ClaimVerdict.IMPOSSIBLE
AMBIGUOUS, NOT_CHECKABLE, SHOWN = ClaimVerdict.AMBIGUOUS, ClaimVerdict.NOT_CHECKABLE, ClaimVerdict.SHOWN

_MEASURED_BY = "canid study grover LOG makes it anew from any log"
_DRAWING = "a drawing or a photograph without a number"
_NO_DATA = "his data are not public, and the text holds no curve"
# of the linear programmes
_BAND, _WIDE = (
    f"{omega[0] / (2.0 * math.pi):.1g} to {omega[-1] / (2.0 * math.pi):.2g}"
    for omega in (reduction_bound.OMEGA, reduction.OMEGA)
)
# of an input that reaches 1 Hz: pedal movements do
REACHES_HZ = 1.0


def rows(r: Results) -> tuple[Artifact, ...]:
    """All rows.

    Args:
        r: recomputed.
    """
    return (*_equations(r), *_tables(r), *_figures(r), *_claims(r))


def _equations(r: Results) -> tuple[Artifact, ...]:
    gain1 = f"DC gain {r.first.dc_gain:.3f}"
    return (
        Artifact(
            "eq. 2.1",
            "driver: K1 v (THW - THW_des) + K2 V_rel, delayed",
            f"THW_des {THW_DESIRED_S[0]:g} to {THW_DESIRED_S[1]:g} s",
            "",
            "",
            AMBIGUOUS,
            "K1 is multiplied by the speed here and not in eq. 2.2: its unit, % per s or % per m, is not stated, and "
            "at one speed the two differ by the factor v",
        ),
        Artifact(
            "eq. 2.2, 2.3",
            "the two channels as gain and dead time",
            "K e^(-tau s)",
            "",
            "",
            AMBIGUOUS,
            "the estimates are those of eq. 2.6 and 2.7, which have a lag instead of the dead time (claim G6)",
        ),
        Artifact(
            "eq. 2.4",
            "headway error to pedal, order 4",
            f"fits {EQ_2_4.fit_percent:g} %",
            f"{r.first.unstable} unstable poles; {gain1} % per s",
            "",
            HOLDS,
            "a stable model with lightly damped resonances (claim G1)",
            ("figures/grover_eq_2_4.svg", "tables/grover_poles.csv"),
        ),
        Artifact(
            "eq. 2.5",
            "relative speed to pedal, order 11",
            f"fits {EQ_2_5.fit_percent:g} %",
            f"{r.second.unstable} of {len(r.second.poles)} poles unstable; DC gain {r.second.dc_gain:.1f}",
            "",
            IMPOSSIBLE,
            "its response grows without bound: a short record may be fitted with initial states of its own, no driver "
            "answers so (claim G3)",
            ("figures/grover_eq_2_5_poles.svg", "tables/grover_poles.csv"),
        ),
        Artifact(
            "eq. 2.6, 2.7",
            "the two channels as gain and lag",
            "K / (1 + tau s)",
            "",
            "",
            AMBIGUOUS,
            "the lag is the first-order series of the dead time of eq. 2.2 (claim G6)",
        ),
        Artifact(
            "eq. 2.8",
            "reduction of eq. 2.4",
            f"K {EQ_2_8.K:g}, tau {EQ_2_8.tau:g} s",
            f"{gain1}; no usual input leads to it",
            "",
            FAILS,
            "claim G2",
            ("figures/grover_reduction.svg", "tables/grover_reductions.csv"),
        ),
        Artifact(
            "eq. 2.9",
            "reduction of eq. 2.5",
            f"K {EQ_2_9.K:g}, tau {EQ_2_9.tau:g} s",
            f"DC gain {r.second.dc_gain:.1f}; no usual input leads to it",
            "",
            FAILS,
            "claim G4",
            ("tables/grover_reductions.csv",),
        ),
    )


def _tables(r: Results) -> tuple[Artifact, ...]:
    one, *others = GROVER_DRIVERS
    same = (one.K1, one.tau1, one.K2, one.tau2) == (EQ_2_8.K, EQ_2_8.tau, EQ_2_9.K, EQ_2_9.tau)
    margins = ("figures/grover_string_stability.svg", "tables/grover_margins.csv")
    return (
        Artifact(
            "Table 1",
            "parameters of one driver",
            f"K1 {one.K1:g}, tau1 {one.tau1:g}, K2 {one.K2:g}, tau2 {one.tau2:g}",
            "those of eq. 2.8 and 2.9" if same else "not those of eq. 2.8 and 2.9",
            "",
            HOLDS if same else FAILS,
            "it repeats the equations, which do not follow from eq. 2.4 and 2.5; with a car the driver is stable "
            "(claim G16)",
            margins,
        ),
        Artifact(
            "Table 2",
            "parameters of one driver at three places",
            "; ".join(f"{d.K1:g}, {d.tau1:g}, {d.K2:g}, {d.tau2:g}" for d in others),
            "margins with an assumed car: " + _margins(r),
            "",
            SHOWN,
            "its readings are claims G8 to G10 and G14; no interval is printed",
            margins,
        ),
    )


def _figures(r: Results) -> tuple[Artifact, ...]:
    low, high = r.miso

    def drawing(number: int, what: str) -> Artifact:
        return Artifact(f"Fig. {number}", what, "", "", "", NOT_CHECKABLE, _DRAWING)

    def data(number: int, what: str, published: str = "", why: str = "") -> Artifact:
        return Artifact(
            f"Fig. {number}", what, published, "", "", NOT_CHECKABLE, f"{why or _NO_DATA}; {_MEASURED_BY}"
        )

    return (
        drawing(1, "levels of automation"),
        drawing(2, "car following"),
        drawing(3, "the project's steps"),
        drawing(4, "car-following model"),
        drawing(5, "driver model as a block diagram"),
        drawing(6, "vehicle and driver as a block diagram"),
        drawing(7, "test vehicle"),
        data(8, "test route"),
        drawing(9, "flow chart of the method"),
        data(10, "pedal against headway error", "described in words", "the description is claim G12"),
        data(11, "pedal against relative speed", "described in words", "the description is claim G11"),
        data(12, "record and eq. 2.4", f"fit {EQ_2_4.fit_percent:g} %"),
        Artifact(
            "Fig. 13",
            "record and eq. 2.5",
            f"fit {EQ_2_5.fit_percent:g} %",
            f"an error grows by {r.growth:.0e} in {GROWTH_S:.0f} s",
            "",
            IMPOSSIBLE,
            "the printed model is unstable (claim G3); what was plotted is another one",
            ("figures/grover_eq_2_5_poles.svg",),
        ),
        Artifact(
            "Fig. 14",
            "record and both models of high order together",
            f"fit {MISO_FIT_PERCENT:g} %",
            f"between {low:.2f} and {high:.2f} %",
            "",
            IMPOSSIBLE,
            "claim G5",
            ("figures/grover_miso_bound.svg",),
        ),
        data(15, "record and both reduced models together", f"fit {REDUCED_FIT_PERCENT:g} %"),
        data(16, "record, both models together, both reduced models together"),
        data(17, "places of the three data sets"),
        data(18, "Table 2, case 1: record and models"),
        data(19, "Table 2, case 2: record and models"),
        data(20, "Table 2, case 3: record and models"),
    )


def _claims(r: Results) -> tuple[Artifact, ...]:
    reductions = ("figures/grover_reduction.svg", "tables/grover_reductions.csv")
    reaching = [p.fit_percent for p in r.first_p1 if p.spectrum.band_hz >= REACHES_HZ]
    gains, lags = [p.K for p in r.first_p1], [p.tau for p in r.first_p1]
    hankel = ", ".join(f"{h:.2f}" for h in r.truncation.hankel)
    slycot = (
        f"; python-control's balanced truncation needs slycot here: {r.by_control.remedy}"
        if isinstance(r.by_control, Missing)
        else ""
    )
    repairs = [repair for scan in r.scans for repair in scan.repairs]
    tried = ", ".join(f"{s.tried} of {s.coefficients}" for s in r.scans)
    written = " or ".join(
        " and ".join(f"s^{k} times {10.0**d:g}" for k, d in zip(x.powers, x.decades, strict=True))
        for x in repairs
    )
    counts = Counter(int(n) for n in r.rounding)
    main = (
        Artifact(
            "claim G1",
            "eq. 2.4 is a model of a driver",
            f"fits {EQ_2_4.fit_percent:g} %",
            f"stable; poles {_complex(r.first.poles)} rad/s ({_resonances(r)}); zeros "
            + ", ".join(f"{z.real:.1f}" for z in r.first.zeros)
            + f" rad/s; DC gain {r.first.dc_gain:.4f} % per s",
            "",
            HOLDS,
            "usable in a simulation; resonances of that damping are not known of people, and the zero in the right "
            "half plane makes the first answer go the wrong way",
            ("figures/grover_eq_2_4.svg", "tables/grover_poles.csv"),
        ),
        Artifact(
            "claim G2",
            "eq. 2.8 is the reduction of eq. 2.4",
            f"K {EQ_2_8.K:g}, tau {EQ_2_8.tau:g} s",
            f"over {len(gains)} input spectra K {min(gains):.2f} to {max(gains):.2f}, tau {min(lags):.3f} to "
            f"{max(lags):.3f} s; eq. 2.8 fits eq. 2.4 by {min(r.printed_fits):.0f} to {max(r.printed_fits):.0f} %",
            f"DC gain {r.first.dc_gain:.3f}; balanced: K {r.truncation.K:.1f}, tau {r.truncation.tau:.2f} s",
            FAILS,
            f"the best first-order model fits {max(reaching):.1f} % at most where the input reaches {REACHES_HZ:g} "
            f"Hz. Over all input spectra from {_BAND} Hz eq. 2.8 is a least-squares point with a fit of "
            f"{r.first_bound.fit_percent:.1f} % at most ({r.wide_bounds[0]:.1f} % over {_WIDE} Hz), for an input of "
            f"lines at {_lines(r.first_bound.lines)} Hz alone. Hankel singular values {hankel}: no model of first "
            f"order is near (error bound {r.truncation.error_bound:.1f} % per s){slycot}",
            reductions,
        ),
        Artifact(
            "claim G3",
            "eq. 2.5 is a model that fits",
            f"fits {EQ_2_5.fit_percent:g} %",
            f"{r.second.unstable} of {len(r.second.poles)} poles unstable: "
            f"{_complex(r.second.poles[r.second.poles.real > 0])} rad/s",
            "",
            IMPOSSIBLE,
            f"an error of the initial state grows by {r.growth:.0e} in {GROWTH_S:.0f} s. Not the rounding: "
            + ", ".join(f"{n} unstable poles in {k} of {len(r.rounding)} draws" for n, k in counts.items())
            + f" within the last digit. Misprinted exponents (tried: {tried} at a time): "
            + (f"only {written} would be stable" if repairs else "none makes it stable"),
            ("figures/grover_eq_2_5_poles.svg", "tables/grover_poles.csv"),
        ),
        Artifact(
            "claim G4",
            "eq. 2.9 is the reduction of eq. 2.5",
            f"K {EQ_2_9.K:g}, tau {EQ_2_9.tau:g} s",
            f"DC gain {r.second.dc_gain:.1f}, {abs(r.second.dc_gain / EQ_2_9.K):.0f} times and of the opposite sign",
            "",
            FAILS,
            f"over all input spectra from {_BAND} Hz eq. 2.9 is a least-squares point with a fit of "
            f"{r.second_bound.fit_percent:.1f} % at most ({r.wide_bounds[1]:.1f} % over {_WIDE} Hz); with the "
            f"opposite sign {r.flipped_bound.fit_percent:.1f} %",
            ("tables/grover_reductions.csv",),
        ),
        Artifact(
            "claim G5",
            "both models together fit better than each (Fig. 14)",
            f"{MISO_FIT_PERCENT:g} %",
            f"between {r.miso[0]:.2f} and {r.miso[1]:.2f} %",
            "",
            IMPOSSIBLE,
            f"each alone answers with nearly the whole output ({EQ_2_4.fit_percent:g} and {EQ_2_5.fit_percent:g} %), "
            "so that their sum is nearly twice the output. The printed fit is that of a model estimated anew; the "
            "gains of one input at a time count the output twice. The bound is that of the two printed responses: with "
            "initial states fitted anew for the sum there is none",
            ("figures/grover_miso_bound.svg",),
        ),
        Artifact(
            "claim G6",
            "first order plus dead time (sec. VI)",
            "one number, called reaction time",
            "dead time in eq. 2.2 and 2.3, lag in eq. 2.6 to 2.9",
            "canid estimates both",
            AMBIGUOUS,
            "the printed tau is a lag by its equation and a dead time by its name; the margins hardly differ (claim "
            "G16)",
            ("tables/grover_margins.csv",),
        ),
    )
    read = tuple(
        Artifact(f"claim {s.claim}", s.what, s.published, s.tables_say, "", s.verdict, s.why)
        for s in sentences()
    )
    peaks = [x.string_peak for x in r.loops]
    off = [100.0 * x.K1_error for x in r.single]
    alone = [x.K1_fit_percent for x in r.single]
    last = (
        Artifact(
            "claim G16",
            "the printed drivers follow a vehicle stably",
            "not stated",
            _margins(r),
            "",
            HOLDS,
            "car assumed: 0.04 m/s² per %, lag 0.3 s, desired headway 2 s, at 8, 15 and 25 m/s. |v / v_lead| is at "
            f"most {min(peaks):.3f} to {max(peaks):.3f}, and 1 at 0 Hz: those above 1 "
            "amplify the slowest waves of a platoon",
            ("figures/grover_string_stability.svg", "tables/grover_margins.csv"),
        ),
        Artifact(
            "claim G17",
            "one fit per input determines K1",
            "his method",
            f"the printed drivers behind a lead, without any noise: K1 of the headway alone is off by {min(off):.0f} "
            f"to {max(off):+.0f} % and fits {min(alone):.0f} to {max(alone):.0f} %",
            "a joint fit has no such error; canid study grover --reproduce measures both on simulated logs",
            FAILS,
            f"both inputs answer to the lead; in {sum(x.lag_at_limit for x in r.single)} of {len(r.single)} loops the "
            f"headway alone has a negative gain with a lag at its limit of {reduction.LARGEST_S:g} s. Car and lead "
            f"are assumed (bands {', '.join(f'{f:g}' for f in LEAD_BANDS_HZ)} Hz, records of 1 and 10 min): the error "
            "has another sign and size in every loop",
            ("tables/grover_single_input.csv",),
        ),
        Artifact(
            "claim G18",
            "curves of Fig. 8 and 10 to 20, fits to his data",
            "",
            "",
            "",
            NOT_CHECKABLE,
            f"{_NO_DATA}; {_MEASURED_BY}",
        ),
    )
    return (*main, *read, *last)


def _margins(r: Results) -> str:
    phases = [x.margins.phase_margin_deg for x in r.loops]
    delays = [x.margins.delay_margin_s for x in r.loops]
    peaks = [x.string_peak for x in r.loops]
    disks = [x.disk.disk for x in r.loops]
    return (
        f"phase margin {min(phases):.0f} to {max(phases):.0f}°, delay margin {min(delays):.1f} to {max(delays):.1f} "
        f"s, disk margin {min(disks):.2f} to {max(disks):.2f}, |v / v_lead| {min(peaks):.3f} to {max(peaks):.3f}"
    )


def _complex(poles: Complex | Sequence[complex]) -> str:
    upper = [p for p in poles if p.imag >= 0.0]
    return ", ".join(f"{p.real:.3g} ± {p.imag:.4g}j" if p.imag else f"{p.real:.3g}" for p in upper)


def _resonances(r: Results) -> str:
    pairs = zip(r.first.frequency_hz, r.first.damping, r.first.poles, strict=True)
    return ", ".join(f"{f:.2f} Hz with damping {d:.3f}" for f, d, p in pairs if p.imag > 0.0)


def _lines(lines: tuple[tuple[float, float], ...]) -> str:
    return ", ".join(f"{f:.3g}" for f, _ in lines)
