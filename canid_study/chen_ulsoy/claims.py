"""The claims of Chen & Ulsoy 2001 on a log: each by a test that can say that it holds, fails, or is not decided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from canid.mathematics.identification.confidence import MISS
from canid_study import verdict_tests
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.chen_ulsoy import between
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.robustness import Robustness
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.chen_ulsoy.signals import Spectra
from canid_study.printed_numbers import (
    EXCITATION_ORDER,
    FALL_AT_NYQUIST_DB,
    STATIONARY_SHARE,
    STEERING_TABLES,
)

_SHOWN = ClaimVerdict.SHOWN
# p value below which one driver is said to change, or a dead zone to be there
_LEVEL = 0.01
# by which the share of segments that pass may be below a constant driver's, and they still are as stationary as his
_FEWER_PASS = 0.10
# coherence that is called reasonably good: half of the angle's power comes from the error
_GOOD_COHERENCE = 0.5
# that is called close to unity
_NEAR_UNITY = 0.9
# of the band up to 1 Hz: each part has to be good
_BAND_PARTS = 4
# frequencies of a Hann window that say what one does: its noise bandwidth
_HANN_BINS = 1.5


def claims(
    drivers: Sequence[Driver], pooled: Sequence[between.Split], robust: dict[str, Robustness]
) -> list[Artifact]:
    """One row per claim.

    Args:
        drivers: analysed.
        pooled: the split of each parameter's standard deviation.
        robust: by driver.
    """
    return [
        row
        for row in (
            _stationarity(drivers),
            _change(drivers),
            _aliasing(drivers),
            _coherence(drivers),
            _coherence_left(drivers),
            _excitation(drivers),
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
    error = float(np.mean([s.error for s, _ in both]))
    constant = float(np.mean([c.stationary_angle for _, c in both]))
    constant_error = float(np.mean([c.stationary_error for _, c in both]))
    # segments of each driver, and how many of them each signal's test lets pass
    n = sum(len(d.number) + d.rejected for d in drivers if d.stationary is not None)
    tests = [_as_many_pass(share, n, p) for share, p in ((measured, constant), (error, constant_error))]
    holds, fails = max(p[0] for p in tests), min(min(2.0 * p[1] for p in tests), 1.0)
    return Artifact(
        "claim: stationary segments",
        "reverse arrangements",
        f"about {100 * STATIONARY_SHARE:.0f} % pass, so each is stationary",
        f"steering angle {100 * measured:.0f} %, error {100 * error:.0f} %",
        f"a driver who never changes passes {100 * constant:.0f} % (angle), "
        f"{100 * constant_error:.0f} % (error)",
        verdict_tests.decided(holds, fails),
        "compared with a constant driver, whose share is what the test lets pass: it counts trends within a "
        f"segment, not changes between them; {verdict_tests.stated('binomial', holds, fails)}, margin "
        f"{100 * _FEWER_PASS:.0f} points",
        ("tables/stationarity.csv",),
    )


def _as_many_pass(share: float, n: int, constant: float) -> tuple[float, float]:
    """P values of as many passes as a constant driver has, and of fewer."""
    count = round(share * n)
    return (
        verdict_tests.more_than(count, n, max(constant - _FEWER_PASS, 0.0)),
        verdict_tests.fewer_than(count, n, constant),
    )


def _change(drivers: Sequence[Driver]) -> Artifact | None:
    known = [d.drift for d in drivers if d.drift is not None]
    if not known:
        return None
    drifts = [d.drift for d in drivers if d.drift is not None and d.logs == 1]
    if not drifts:
        return Artifact(
            "claim: the driver changes with time",
            "local level over the segments",
            "std of the segments' fits shows it",
            "",
            f"largest likelihood ratio {max(x.statistic for x in known):.1f}, over several logs",
            ClaimVerdict.UNDECIDED,
            "segments of several logs differ by road, weather and assistant as well: one long log of each driver decides",
            ("tables/stationarity.csv", "figures/fig_11.svg"),
        )
    changed = sum(x.p_value < _LEVEL for x in drifts)
    most = max(x.variation.high for x in drifts)
    holds = verdict_tests.more_than(changed, len(drifts), _LEVEL)
    # a profile interval: one end is beyond the truth at half the level
    fails = 0.5 * verdict_tests.LEVEL if most < 1.0 and holds > verdict_tests.LEVEL else 1.0
    largest = max(x.statistic for x in drifts)
    whole = np.mean([abs(d.stationary.whole_error) for d in drivers if d.stationary is not None])
    return Artifact(
        "claim: the driver changes with time",
        "local level over the segments",
        "std of the segments' fits shows it",
        f"whole drive: |z| of the error {whole:.1f}",
        f"{changed} of {len(drifts)} drivers change (p < {_LEVEL:g}); largest likelihood ratio {largest:.1f}",
        verdict_tests.decided(holds, fails),
        "a standard deviation does not know the order of the segments; the likelihood ratio does. "
        f"{verdict_tests.stated('number of drivers that change (binomial)', holds, float('nan'))}; it fails where the 95 % "
        "interval of every driver's change over the drive is below one standard error of a segment: largest "
        f"{most:.1f}",
        ("tables/stationarity.csv", "figures/fig_11.svg"),
    )


def _aliasing(drivers: Sequence[Driver]) -> Artifact:
    falls = [d.spectra.fall_angle_db for d in drivers if d.spectra is not None]
    differences = [d.aliasing for d in drivers if d.aliasing is not None]
    reproduced = f"angle falls by {np.mean(falls):.0f} dB to the Nyquist frequency" if falls else ""
    if differences:
        away = np.mean([x.difference for x in differences], axis=0)
        se = np.sqrt(np.sum([x.standard_error**2 for x in differences], axis=0)) / len(differences)
        # a difference is small that is below the error of one segment's fit
        fit_error = np.sqrt(np.mean([np.diag(d.sampling) for d in drivers if d.aliasing is not None], axis=0))
        holds, fails = verdict_tests.small(away, se, fit_error)
        corrected = "with - without filter: " + ", ".join(
            f"{n} {a:+.3f} ± {s:.3f}" for n, a, s in zip(NAMES, away, se, strict=True)
        )
    else:
        holds = fails = float("nan")
        corrected = "not comparable: the trace has no finer grid than the model's"
    return Artifact(
        "claim: no anti-aliasing needed",
        "fall of the spectra",
        f"almost {FALL_AT_NYQUIST_DB:.0f} dB",
        reproduced,
        corrected,
        verdict_tests.decided(holds, fails),
        "driver noise through C/A does not fall by more than 18 to 36 dB; "
        + (
            verdict_tests.stated("difference below the error of one segment's fit", holds, fails)
            if differences
            else "record lane signals faster than the model's grid"
        ),
        ("figures/fig_06.svg",),
    )


def _coherence(drivers: Sequence[Driver]) -> Artifact | None:
    spectra = drivers[0].spectra
    if spectra is None:
        return None
    band = (spectra.frequency > 0.0) & (spectra.frequency <= 1.0)
    share = float((spectra.coherence[band] > spectra.threshold).mean())
    holds, fails = _coherent(spectra)
    return Artifact(
        "claim: coherence up to 1 Hz",
        "coherence of error and angle",
        "reasonably good up to 1 Hz",
        f"above the threshold at {100 * share:.0f} % of frequencies to 1 Hz, mean {spectra.coherence[band].mean():.2f}",
        "",
        verdict_tests.decided(holds, fails),
        "threshold: 95 % of independent signals, for this number of averages; "
        + verdict_tests.stated(
            f"mean coherence above {_GOOD_COHERENCE:g} in each quarter of the band (Fisher's z)", holds, fails
        ),
        ("figures/fig_07.svg",),
    )


def _coherence_left(drivers: Sequence[Driver]) -> Artifact | None:
    """Sec. 3: the reason for a linear model of |Delta|."""
    spectra = drivers[0].left
    if spectra is None:
        return None
    band = (spectra.frequency > 0.0) & (spectra.frequency <= 1.0)
    holds, fails = _coherent(spectra, _NEAR_UNITY)
    return Artifact(
        "claim: coherence of error and remainder",
        "coherence of y and n = angle - (B/A) y (sec. 3)",
        "close to unity up to 1 Hz, which justifies the linear form of |Delta|",
        f"mean {spectra.coherence[band].mean():.2f}, lowest {spectra.coherence[band].min():.2f} up to 1 Hz "
        f"({drivers[0].name})",
        "",
        verdict_tests.decided(holds, fails),
        "n is made of y by the model, and the loop returns the driver's noise as y: coherence near 1 shows neither "
        "that the rest is linear nor that it is the driver's; "
        + verdict_tests.stated(
            f"mean coherence above {_NEAR_UNITY:g} in each quarter of the band (Fisher's z)", holds, fails
        ),
    )


def _excitation(drivers: Sequence[Driver]) -> Artifact | None:
    """Sec. 2.3."""
    excitation = drivers[0].excitation
    if excitation is None:
        return None
    holds, fails = verdict_tests.above(excitation, 1.0)
    return Artifact(
        "claim: excitation",
        f"the error excites persistently of order {EXCITATION_ORDER} (sec. 2.3)",
        "so it does for the data tested",
        f"smallest eigenvalue of the covariance of {EXCITATION_ORDER} successive errors {np.median(excitation):.3g} times "
        f"that of their rounding (median of {len(excitation)} segments of {drivers[0].name})",
        "",
        verdict_tests.decided(holds, fails),
        "rounded values are positive definite whatever was there before; "
        + verdict_tests.stated("above the rounding's own (signed ranks of the segments)", holds, fails),
    )


def _coherent(spectra: Spectra, good: float = _GOOD_COHERENCE) -> tuple[float, float]:
    """P values of a coherence that is good in each part of the band, and of one part at least in which it is not.

    Fisher's transform of the root of a coherence over n averages has the variance 1 / (2 (n - 1)), and a bias of as much
    (Enochson & Goodman 1965).
    """
    band = (spectra.frequency > 0.0) & (spectra.frequency <= 1.0)
    variance = 0.5 / max(spectra.averages - 1, 1)
    z = np.arctanh(np.sqrt(np.clip(spectra.coherence[band], 0.0, 1.0 - 1e-12))) - variance
    parts = [part for part in np.array_split(z, _BAND_PARTS) if len(part)]
    away = np.array([part.mean() for part in parts]) - np.arctanh(np.sqrt(good))
    se = np.sqrt([variance * min(_HANN_BINS / len(part), 1.0) for part in parts])
    # of all parts the worst: the claim is of each
    p = norm.sf(away / se), norm.cdf(away / se)
    return float(p[0].max()), float(min(len(parts) * p[1].min(), 1.0))


def _orders(drivers: Sequence[Driver]) -> Artifact | None:
    driver = drivers[0]
    known = [c for c in driver.orders if np.isfinite(c.bic)]
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
    # ends of a 95 % interval: each is beyond the truth at half the level
    half = 0.5 * verdict_tests.LEVEL
    known = np.isfinite(b1.minutes.value)
    holds = (half if b1.minutes.low > b1.sampling else 1.0) if known else float("nan")
    fails = (half if b1.minutes.high < b1.sampling else 1.0) if known else float("nan")
    return Artifact(
        "claim: structured uncertainty",
        "std of the parameters is the driver's change",
        f"std of b1 {STEERING_TABLES[0].sd[2]}",
        f"std of b1 {b1.naive:.2f}",
        f"of it sampling {b1.sampling:.2f}; between segments {between.shown(b1.minutes)}; "
        f"between drivers {between.shown(b1.drivers)}",
        verdict_tests.decided(holds, fails),
        "a segment's fit has a standard error of its own: the claim holds where the 95 % interval of the change between "
        "segments is above it, and fails where it is below",
        ("tables/structured.csv", "tables/correlations.csv"),
    )


def _bias(drivers: Sequence[Driver]) -> Artifact | None:
    repeated = [(d, d.repeated) for d in drivers if d.repeated is not None]
    if not repeated:
        return None
    percent = 100.0 * float(
        np.mean([repetition.bias[2] / d.model[:, 2].mean() for d, repetition in repeated])
    )
    # a bias matters that is above the standard error of the mean over the drive: the interval would miss the driver
    margin = np.concatenate([d.model.std(axis=0, ddof=1) / len(d.model) ** 0.5 for d, _ in repeated])
    holds, fails = verdict_tests.small(
        np.concatenate([repetition.bias for _, repetition in repeated]),
        np.concatenate([repetition.bias_sd for _, repetition in repeated]),
        margin,
    )
    return Artifact(
        "claim: means of the fits are the driver",
        "averages of the segments' fits",
        "Tables 1 and 2",
        f"b1 of a segment is off by {percent:+.1f} %",
        "one fit over all segments, with interval",
        verdict_tests.decided(holds, fails),
        "repetitions of the driver's own loop show the bias; "
        + verdict_tests.stated("bias below the standard error of the mean over the drive", holds, fails),
        ("tables/bias.csv",),
    )


def _delta(drivers: Sequence[Driver]) -> Artifact:
    excesses = [d.excess for d in drivers if d.excess is not None]
    if not excesses:
        return Artifact(
            "claim: |Delta| is unmodeled dynamics",
            "share above the null band",
            "dynamics, nonlinearity and random behavior",
            "",
            "",
            ClaimVerdict.NOT_CHECKABLE,
            "use --bootstraps 200 for the null band",
            ("tables/unmodeled.csv",),
        )
    exceeding = sum(e.frequencies > 0.0 for e in excesses)
    holds = verdict_tests.more_than(exceeding, len(excesses), MISS)
    # of each driver the most that may be left over of dynamics, as a share of |Delta|, at the worst frequency
    most = max(_most_left(d) for d in drivers if d.excess is not None)
    fails = verdict_tests.LEVEL if most < 0.5 and holds > verdict_tests.LEVEL else 1.0
    return Artifact(
        "claim: |Delta| is unmodeled dynamics",
        "share above the null band",
        "dynamics, nonlinearity and random behavior",
        f"median |Delta| {np.median([np.median(np.abs(d.delta)) for d in drivers]):.2f} deg/m",
        f"{100 * np.mean([e.share for e in excesses]):.0f} % above the band of their segment; "
        f"{exceeding} of {len(excesses)} drivers exceed the simultaneous band",
        verdict_tests.decided(holds, fails),
        "a driver who is the model shows the rest; "
        f"{verdict_tests.stated('number of drivers beyond their band (binomial)', holds, float('nan'))}; it fails where at "
        f"most half of |Delta| can be left over of dynamics (simultaneous 95 % band): {100 * most:.0f} %",
        ("tables/unmodeled.csv", "figures/fig_13.svg"),
    )


def _most_left(driver: Driver) -> float:
    """The upper end of what is systematic in Delta, against its median size, at the worst frequency."""
    band, excess = driver.band, driver.excess
    if band is None or excess is None or not np.isfinite(excess.systematic).all():
        return float("inf")
    radius = np.sqrt(band.limit * np.linalg.eigvalsh(np.linalg.inv(band.precision))[:, -1])
    return float(((excess.systematic + radius) / np.nanmedian(np.abs(driver.delta), axis=0)).max())


def _dead_zone(drivers: Sequence[Driver]) -> Artifact | None:
    dead_zones = [d.dead_zone for d in drivers if d.dead_zone is not None]
    if not dead_zones:
        return None
    there = sum(z.p_value < _LEVEL and z.statistic > 0.0 for z in dead_zones)
    return Artifact(
        "claim: complacency adds little to |Delta|",
        "dead zone in the lateral error",
        "|Delta| is not much reduced with it",
        "",
        f"found in {there} of {len(dead_zones)} drivers (p < {_LEVEL:g}), by a test of the innovations",
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
