"""One row per equation, table, figure and claim of Chen & Ulsoy 2001: published, reproduced, corrected, verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.chen_ulsoy import between, claims, tables
from canid_study.chen_ulsoy.bounds import Bound
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.poles import poles_and_gain
from canid_study.chen_ulsoy.robustness import Robustness
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.printed_numbers import (
    DC_GAIN_RANGE,
    FPE_INCREASE,
    FPE_PARAMETERS,
    SEGMENT_SAMPLES,
    STEERING_TABLES,
)

_SHOWN = ClaimVerdict.SHOWN


def artifacts(
    drivers: Sequence[Driver],
    pooled: Sequence[between.Split],
    bounds: Sequence[Bound],
    robust: dict[str, Robustness],
) -> tuple[Artifact, ...]:
    """All rows."""
    first = drivers[0]
    return (
        *_equations(first, drivers, bounds),
        *_tables(drivers, pooled),
        *_figures(first, drivers, bounds, robust),
        *claims.claims(drivers, pooled, robust),
    )


def _mean_sd(x: Array) -> str:
    return f"{x.mean():.3f} ± {x.std(ddof=1):.3f}" if len(x) > 1 else "–"


def _equations(driver: Driver, drivers: Sequence[Driver], bounds: Sequence[Bound]) -> list[Artifact]:
    joint = driver.joint
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
    theta = driver.theta.mean(axis=0)
    fitted = ", ".join(f"{n} {theta[k]:.3f}" for n, k in zip((*NAMES, "c1"), (0, 1, 2, 3, 5), strict=True))
    return [
        Artifact(
            "eq. 1",
            "ARMAX of steering",
            "A angle = B error + C e",
            "fitted to each segment",
            "",
            _SHOWN,
            f"{len(driver.number)} segments of {driver.name}",
            ("tables/segments.csv",),
        ),
        Artifact(
            "eq. 2",
            "FPE",
            f"d = {d}, N = {N}: about {100 * FPE_INCREASE:.0f} %",
            f"{100 * fpe:.1f} %",
            "",
            _SHOWN,
            "with N in the numerator too; of the printed numbers, not of this log",
            ("tables/orders.csv",),
        ),
        Artifact(
            "eq. 3",
            "orders (2, 2, 1), one delay",
            "c1 not printed",
            f"{driver.name}, mean of the segments: {fitted}",
            f"one fit over all segments: {corrected}" if corrected else "",
            _SHOWN,
            "averages of fits of segments are biased",
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
    first = tables.halves(drivers[0])
    every = {
        part: np.concatenate([tables.halves(d)[part] for d in drivers])
        for part in ("estimation", "validation")
    }
    for number, made, files in ((1, first, "tables/table_1.csv"), (2, every, "tables/table_2.csv")):
        for part in ("estimation", "validation"):
            printed = next(t for t in STEERING_TABLES if t.table == number and t.part == part)
            x = made[part]
            words = ", ".join(f"{n} {_mean_sd(x[:, j])}" for j, n in enumerate(NAMES)) if len(x) > 1 else ""
            published = ", ".join(
                f"{n} {m} ± {s}" for n, m, s in zip(NAMES, printed.mean, printed.sd, strict=True)
            )
            split = pooled[2]
            corrected = (
                f"std of b1 {split.naive:.2f}: sampling {split.sampling:.2f}, "
                f"between segments {between.shown(split.minutes)}, "
                f"between drivers {between.shown(split.drivers)}"
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
    driver: Driver, drivers: Sequence[Driver], bounds: Sequence[Bound], robust: dict[str, Robustness]
) -> list[Artifact]:
    poles = poles_and_gain(driver.model, driver.covariance, driver.dt)
    gains = f"DC gain {np.quantile(poles.gain, 0.05):.2f} to {np.quantile(poles.gain, 0.95):.2f} (5 to 95 %)"
    margins = "; ".join(
        f"{name}: wc {r.margins.crossover:.2f} rad/s, phase margin {r.margins.phase_margin_deg:.0f}°"
        for name, r in list(robust.items())[:3]
    )
    drift = (
        ""
        if driver.drift is None
        else f"likelihood ratio {driver.drift.statistic:.1f}, p {driver.drift.p_value:.2g}"
    )
    coherent = ""
    if driver.spectra is not None:
        above = driver.spectra.coherence > driver.spectra.threshold
        last = driver.spectra.frequency[above].max() if above.any() else 0.0
        coherent = f"above the 95 % threshold {driver.spectra.threshold:.3f} up to {last:.2f} Hz"
    inside = ""
    if driver.structures is not None:
        inside = ", ".join(f"{s} {100 * x:.0f} %" for s, x in driver.structures.inside.items())
    fourth = [b for b in bounds if b.name.endswith("fourth order")]
    several = [b for b in bounds[2:] if len(drivers) > 1][-1:]
    return [
        Artifact(
            "Fig. 4",
            "a segment",
            "curves are not in the stored text",
            driver.name,
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
            f"means over {0 if driver.structures is None else driver.structures.segments} segments",
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
            f"{len(driver.number)} segments of {driver.name}",
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
            "part of the range is sampling: each segment has its interval",
            ("figures/fig_12.svg",),
        ),
        Artifact(
            "Fig. 13",
            "|Delta| of one driver",
            "curves are not in the stored text",
            _null_words([driver]),
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
