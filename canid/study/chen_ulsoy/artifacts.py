"""One row per equation, table, figure and claim of Chen & Ulsoy 2001: published, reproduced, corrected, verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.identification.confidence import NORMAL_QUANTILE
from canid.study.artifact import Artifact, ClaimVerdict
from canid.study.chen_ulsoy import between, tables
from canid.study.chen_ulsoy.bounds import Bound
from canid.study.chen_ulsoy.driver_analysis import Driver
from canid.study.chen_ulsoy.poles import poles_and_gain
from canid.study.chen_ulsoy.robustness import Robustness
from canid.study.chen_ulsoy.segment_fits import NAMES
from canid.study.prints.printed_numbers import (
    DC_GAIN_RANGE,
    FALL_AT_NYQUIST_DB,
    FPE_INCREASE,
    FPE_PARAMETERS,
    SEGMENT_SAMPLES,
    STATIONARY_SHARE,
    STEERING_TABLES,
)
from canid.types import Array, Interval

_HOLDS, _FAILS, _SHOWN = ClaimVerdict.HOLDS, ClaimVerdict.FAILS, ClaimVerdict.SHOWN
_OPEN = ClaimVerdict.NOT_CHECKABLE
# p value below which a driver is said to change, or a dead zone to be there
_LEVEL = 0.01
# share of segments by which the published 95 % may differ from a constant driver's before it says something: two standard
# errors of 119 segments
_SHARE = 0.05


def artifacts(
    drivers: Sequence[Driver],
    pooled: Sequence[between.Split],
    bounds: Sequence[Bound],
    robust: dict[str, Robustness],
) -> tuple[Artifact, ...]:
    """All rows."""
    one = drivers[0]
    return (
        *_equations(one, drivers, bounds),
        *_tables(drivers, pooled),
        *_figures(one, drivers, bounds, robust),
        *_claims(drivers, pooled, robust),
    )


def _mean_sd(x: Array) -> str:
    return f"{x.mean():.3f} ± {x.std(ddof=1):.3f}" if len(x) > 1 else "–"


def _interval(x: Interval) -> str:
    return f"{x.value:.2f} [{x.low:.2f}, {x.high:.2f}]" if np.isfinite(x.value) else "not identifiable"


def _equations(one: Driver, drivers: Sequence[Driver], bounds: Sequence[Bound]) -> list[Artifact]:
    joint = one.joint
    corrected = ""
    if joint is not None:
        sd = np.sqrt(np.diag(joint.covariance))
        corrected = ", ".join(
            f"{n} {v:.3f} ± {NORMAL_QUANTILE * s:.3f}"
            for n, v, s in zip((*NAMES, "c1"), joint.theta, sd, strict=True)
        )
    d, N = FPE_PARAMETERS, SEGMENT_SAMPLES
    fpe = (1.0 + d / N) / (1.0 - d / N) - 1.0
    first = bounds[0] if bounds else None
    refit = "" if first is None else _formula(first)
    theta = one.theta.mean(axis=0)
    fitted = ", ".join(f"{n} {theta[k]:.3f}" for n, k in zip((*NAMES, "c1"), (0, 1, 2, 3, 5), strict=True))
    return [
        Artifact(
            "eq. 1",
            "ARMAX of steering",
            "A angle = B error + C e",
            "fitted to each segment",
            "",
            _SHOWN,
            f"{len(one.number)} segments of {one.name}",
            ("tables/segments.csv",),
        ),
        Artifact(
            "eq. 2",
            "FPE",
            f"d = {d}, N = {N}: about {100 * FPE_INCREASE:.0f} %",
            f"{100 * fpe:.1f} %",
            "",
            _HOLDS,
            "with N in the numerator too",
            ("tables/orders.csv",),
        ),
        Artifact(
            "eq. 3",
            "orders (2, 2, 1), one delay",
            "c1 not printed",
            f"{one.name}, mean of the minutes: {fitted}",
            f"one fit over all minutes: {corrected}" if corrected else "",
            _SHOWN,
            "averages of minute fits are biased",
            ("tables/bias.csv",),
        ),
        Artifact(
            "eq. 4",
            "|Delta| from n and error",
            "ARX(2) instead of the ratio of spectra",
            "ARX(2) of every segment",
            _null_words(drivers),
            _SHOWN,
            "in a loop the error holds the driver's own noise, and n answers to it",
            ("tables/unmodeled.csv", "figures/fig_13.svg"),
        ),
        Artifact(
            "eq. 5",
            "first-order bound of |Delta|",
            "(5 s + 0.5) / (s + 2.5)",
            refit,
            "",
            _SHOWN,
            "least bound above all odd segments up to 1 Hz",
            ("tables/bounds.csv", "figures/fig_14.svg"),
        ),
    ]


def _formula(b: Bound) -> str:
    return f"({b.system.num[0]:.2f} s + {b.system.num[1]:.2f}) / (s + {b.system.den[1]:.2f})"


def _null_words(drivers: Sequence[Driver]) -> str:
    shares = [d.excess.share for d in drivers if d.excess is not None]
    if not shares:
        return "null band: use --bootstraps 200"
    return f"{100 * np.mean(shares):.0f} % of |Delta| above its null band (5 % where nothing is left)"


def _tables(drivers: Sequence[Driver], pooled: Sequence[between.Split]) -> list[Artifact]:
    out = []
    one = tables.halves(drivers[0])
    every = {
        part: np.concatenate([tables.halves(d)[part] for d in drivers])
        for part in ("estimation", "validation")
    }
    for number, made, files in ((1, one, "tables/table_1.csv"), (2, every, "tables/table_2.csv")):
        for part in ("estimation", "validation"):
            printed = next(t for t in STEERING_TABLES if t.table == number and t.part == part)
            x = made[part]
            words = ", ".join(f"{n} {_mean_sd(x[:, j])}" for j, n in enumerate(NAMES)) if len(x) > 1 else ""
            published = ", ".join(
                f"{n} {m} ± {s}" for n, m, s in zip(NAMES, printed.mean, printed.sd, strict=True)
            )
            split = pooled[2]
            corrected = (
                f"std of b1 {split.naive:.2f}: sampling {split.sampling:.2f}, between minutes {_interval(split.minutes)}, "
                f"between drivers {_interval(split.drivers)}"
            )
            who = (
                drivers[0].name if number == 1 else f"{len(drivers)} driver{'s' if len(drivers) > 1 else ''}"
            )
            out.append(
                Artifact(
                    f"Table {number}, {part}",
                    f"mean ± std of {who}",
                    published,
                    words,
                    corrected,
                    _SHOWN,
                    "other drivers than the paper's: its data are not public",
                    (files, "tables/structured.csv"),
                )
            )
    return out


def _figures(
    one: Driver, drivers: Sequence[Driver], bounds: Sequence[Bound], robust: dict[str, Robustness]
) -> list[Artifact]:
    found = poles_and_gain(one.model, one.covariance, one.dt)
    gains = f"DC gain {np.quantile(found.gain, 0.05):.2f} to {np.quantile(found.gain, 0.95):.2f} (5 to 95 %)"
    margins = "; ".join(
        f"{name}: wc {r.margins.crossover:.2f} rad/s, phase margin {r.margins.phase_margin_deg:.0f}°"
        for name, r in list(robust.items())[:3]
    )
    drift = (
        "" if one.drift is None else f"likelihood ratio {one.drift.statistic:.1f}, p {one.drift.p_value:.2g}"
    )
    coherent = ""
    if one.spectra is not None:
        above = one.spectra.coherence > one.spectra.threshold
        last = one.spectra.frequency[above].max() if above.any() else 0.0
        coherent = f"above the 95 % threshold {one.spectra.threshold:.3f} up to {last:.2f} Hz"
    inside = ""
    if one.structures is not None:
        inside = ", ".join(f"{s} {100 * x:.0f} %" for s, x in one.structures.inside.items())
    fourth = [b for b in bounds if b.name.endswith("fourth order")]
    several = [b for b in bounds[2:] if len(drivers) > 1][-1:]
    return [
        Artifact(
            "Fig. 4",
            "a segment",
            "curves are not in the stored text",
            one.name,
            "",
            _SHOWN,
            "",
            ("figures/fig_04.svg",),
        ),
        Artifact(
            "Fig. 5",
            "block diagram of the experiment",
            "driver and simulator in a loop",
            "",
            "",
            _SHOWN,
            "canid simulates the same loop: canid simulate --profile lane",
        ),
        Artifact("Fig. 6", "spectra", "mostly under 1 Hz", "", "", _SHOWN, "", ("figures/fig_06.svg",)),
        Artifact(
            "Fig. 7",
            "coherence",
            "good up to 1 Hz",
            coherent,
            "",
            _SHOWN,
            "in a loop coherence is no measure of the model: noise of the driver comes back as error",
            ("figures/fig_07.svg",),
        ),
        Artifact(
            "Fig. 8",
            "residuals of four structures",
            "ARMAX and BJ are whitest",
            f"lags inside 99 %: {inside}",
            "",
            _SHOWN,
            f"means over {0 if one.structures is None else one.structures.segments} segments",
            ("figures/fig_08.svg", "tables/structures.csv"),
        ),
        Artifact("Fig. 9", "block diagram of ARMAX", "eq. 1", "", "", _SHOWN, ""),
        Artifact(
            "Fig. 10",
            "driver and car",
            "crossover principle",
            margins,
            "",
            _SHOWN,
            "with an assumed one-track car",
            ("figures/fig_10.svg", "tables/robustness.csv"),
        ),
        Artifact(
            "Fig. 11",
            "parameters over the drive",
            "they change",
            f"{len(one.number)} minutes of {one.name}",
            drift,
            _SHOWN,
            "smoothed by a local level with 95 % band",
            ("figures/fig_11.svg",),
        ),
        Artifact(
            "Fig. 12",
            "poles, zero, DC gain",
            f"DC gain {DC_GAIN_RANGE[0]} to {DC_GAIN_RANGE[1]:g}, zero -1 to 0",
            gains,
            "",
            _SHOWN,
            "part of the range is sampling: each minute has its interval",
            ("figures/fig_12.svg",),
        ),
        Artifact(
            "Fig. 13",
            "|Delta| of one driver",
            "curves are not in the stored text",
            _null_words([one]),
            "",
            _SHOWN,
            "",
            ("figures/fig_13.svg", "tables/unmodeled.csv"),
        ),
        Artifact(
            "Fig. 14",
            "bounds of |Delta|",
            "fourth order is little smaller, several drivers larger",
            "; ".join(f"{b.name}: {_formula(b)}" for b in [*bounds[:1], *fourth[:1], *several]),
            "",
            _SHOWN,
            "",
            ("figures/fig_14.svg", "tables/bounds.csv"),
        ),
    ]


def _claims(
    drivers: Sequence[Driver], pooled: Sequence[between.Split], robust: dict[str, Robustness]
) -> list[Artifact]:
    return [
        row
        for row in (
            _stationarity(drivers),
            _change(drivers),
            _aliasing(drivers),
            _coherence(drivers),
            _orders(drivers),
            _structured(pooled),
            _bias(drivers),
            _delta(drivers),
            _dead_zone(drivers),
            _robust(robust),
        )
        if row is not None
    ]


def _stationarity(drivers: Sequence[Driver]) -> Artifact | None:
    both = [
        (d.stationary, d.constant) for d in drivers if d.stationary is not None and d.constant is not None
    ]
    if not both:
        return None
    measured = float(np.mean([s.angle for s, _ in both]))
    constant = float(np.mean([c.stationary_angle for _, c in both]))
    return Artifact(
        "claim: stationary segments",
        "reverse arrangements",
        f"about {100 * STATIONARY_SHARE:.0f} % pass, so each is stationary",
        f"steering angle {100 * measured:.0f} %, error {100 * float(np.mean([s.error for s, _ in both])):.0f} %",
        f"a driver who never changes passes {100 * constant:.0f} % (angle), "
        f"{100 * float(np.mean([c.stationary_error for _, c in both])):.0f} % (error)",
        _FAILS if abs(STATIONARY_SHARE - constant) <= 2 * _SHARE else _SHOWN,
        "the test passes nearly as many whatever the driver does: it counts trends within a minute only",
        ("tables/stationarity.csv",),
    )


def _change(drivers: Sequence[Driver]) -> Artifact | None:
    found = [d.drift for d in drivers if d.drift is not None]
    if not found:
        return None
    changed = sum(x.p_value < _LEVEL for x in found)
    largest = max(x.statistic for x in found)
    whole = np.mean([abs(d.stationary.whole_error) for d in drivers if d.stationary is not None])
    return Artifact(
        "claim: the driver changes with time",
        "local level over the segments",
        "std of the minute fits shows it",
        f"whole drive: |z| of the error {whole:.1f}",
        f"{changed} of {len(found)} drivers change (p < {_LEVEL:g}); largest likelihood ratio {largest:.1f}",
        _HOLDS if changed > len(found) / 2 else _FAILS,
        "a standard deviation does not know the order of the minutes; the likelihood ratio does",
        ("tables/stationarity.csv", "figures/fig_11.svg"),
    )


def _aliasing(drivers: Sequence[Driver]) -> Artifact:
    falls = [d.spectra.fall_angle_db for d in drivers if d.spectra is not None]
    found = [d.aliasing for d in drivers if d.aliasing is not None]
    reproduced = f"angle falls by {np.mean(falls):.0f} dB to the Nyquist frequency" if falls else ""
    if found:
        away = np.mean([x.difference for x in found], axis=0)
        se = np.sqrt(np.sum([x.standard_error**2 for x in found], axis=0)) / len(found)
        corrected = "with - without filter: " + ", ".join(
            f"{n} {a:+.3f} ± {s:.3f}" for n, a, s in zip(NAMES, away, se, strict=True)
        )
    else:
        corrected = "not comparable: the trace has no finer grid than the model's"
    fails = bool(falls) and float(np.mean(falls)) < 0.5 * FALL_AT_NYQUIST_DB
    return Artifact(
        "claim: no anti-aliasing needed",
        "fall of the spectra",
        f"almost {FALL_AT_NYQUIST_DB:.0f} dB",
        reproduced,
        corrected,
        _FAILS if fails else _HOLDS,
        "driver noise through C/A does not fall by more than 18 to 36 dB",
        ("figures/fig_06.svg",),
    )


def _coherence(drivers: Sequence[Driver]) -> Artifact | None:
    one = drivers[0].spectra
    if one is None:
        return None
    band = (one.frequency > 0.0) & (one.frequency <= 1.0)
    share = float((one.coherence[band] > one.threshold).mean())
    return Artifact(
        "claim: coherence up to 1 Hz",
        "coherence of error and angle",
        "reasonably good up to 1 Hz",
        f"above the threshold at {100 * share:.0f} % of frequencies to 1 Hz, mean {one.coherence[band].mean():.2f}",
        "",
        _HOLDS if share > 0.9 else _FAILS,
        "threshold: 95 % of independent signals, for this number of averages",
        ("figures/fig_07.svg",),
    )


def _orders(drivers: Sequence[Driver]) -> Artifact | None:
    one = drivers[0]
    known = [c for c in one.orders if np.isfinite(c.bic)]
    if not known:
        return None
    bic, fpe = min(known, key=lambda c: c.bic).orders, min(known, key=lambda c: c.fpe).orders
    return Artifact(
        "claim: orders",
        "AIC and FPE choose high orders",
        "low order is chosen by hand",
        f"FPE chooses ({fpe.na}, {fpe.nb}, {fpe.nc}) nk {fpe.nk}",
        f"BIC chooses ({bic.na}, {bic.nb}, {bic.nc}) nk {bic.nk}",
        _SHOWN,
        "BIC's penalty grows with the segment's length, FPE's does not",
        ("tables/orders.csv",),
    )


def _structured(pooled: Sequence[between.Split]) -> Artifact:
    b1 = pooled[2]
    there = b1.minutes.low > 0.0
    return Artifact(
        "claim: structured uncertainty",
        "std of the parameters is the driver's change",
        f"std of b1 {STEERING_TABLES[0].sd[2]}",
        f"std of b1 {b1.naive:.2f}",
        f"of it sampling {b1.sampling:.2f}; between minutes {_interval(b1.minutes)}; "
        f"between drivers {_interval(b1.drivers)}",
        _HOLDS if there and b1.minutes.value > b1.sampling else _FAILS,
        "a minute's fit has a standard error of its own",
        ("tables/structured.csv", "tables/correlations.csv"),
    )


def _bias(drivers: Sequence[Driver]) -> Artifact | None:
    found = [(d.model[:, 2].mean(), d.repeated.bias[2]) for d in drivers if d.repeated is not None]
    if not found:
        return None
    percent = 100.0 * float(np.mean([bias / value for value, bias in found]))
    return Artifact(
        "claim: means of the fits are the driver",
        "averages of minute fits",
        "Tables 1 and 2",
        f"b1 of a minute is off by {percent:+.1f} %",
        "one fit over all minutes, with interval",
        _FAILS,
        "prediction errors of a minute are biased; repetitions of the driver's own loop show it",
        ("tables/bias.csv",),
    )


def _delta(drivers: Sequence[Driver]) -> Artifact:
    found = [d.excess for d in drivers if d.excess is not None]
    if not found:
        return Artifact(
            "claim: |Delta| is unmodeled dynamics",
            "share above the null band",
            "dynamics, nonlinearity and random behavior",
            "",
            "",
            _OPEN,
            "use --bootstraps 200 for the null band",
            ("tables/unmodeled.csv",),
        )
    exceeding = sum(e.frequencies > 0.0 for e in found)
    return Artifact(
        "claim: |Delta| is unmodeled dynamics",
        "share above the null band",
        "dynamics, nonlinearity and random behavior",
        f"median |Delta| {np.median([np.median(np.abs(d.delta)) for d in drivers]):.2f} deg/m",
        f"{100 * np.mean([e.share for e in found]):.0f} % above the band of their segment; "
        f"{exceeding} of {len(found)} drivers exceed the simultaneous band",
        _HOLDS if exceeding > len(found) / 2 else _FAILS,
        "a driver who is the model shows the rest",
        ("tables/unmodeled.csv", "figures/fig_13.svg"),
    )


def _dead_zone(drivers: Sequence[Driver]) -> Artifact | None:
    found = [d.dead_zone for d in drivers if d.dead_zone is not None]
    if not found:
        return None
    there = sum(z.p_value < _LEVEL and z.statistic > 0.0 for z in found)
    return Artifact(
        "claim: complacency adds little to |Delta|",
        "dead zone in the lateral error",
        "|Delta| is not much reduced with it",
        "",
        f"found in {there} of {len(found)} drivers (p < {_LEVEL:g}), by a test of the innovations",
        _SHOWN,
        "|Delta| is linear and hardly sees a dead zone: it cannot say whether there is one",
        ("tables/unmodeled.csv",),
    )


def _robust(robust: dict[str, Robustness]) -> Artifact | None:
    known = [r.small_gain for r in robust.values() if np.isfinite(r.small_gain)]
    if not known:
        return None
    stable = sum(x < 1.0 for x in known)
    return Artifact(
        "use: robust stability",
        "small gain with the bound of |Delta|",
        "not printed",
        "",
        f"max |Delta P / (1 + L)| {min(known):.2f} to {max(known):.2f}: {stable} of {len(known)} drivers robustly stable",
        _SHOWN,
        "one-track car, an assumption",
        ("tables/robustness.csv",),
    )
