"""One driver's logs from segments to uncertainties: what the study combines over drivers. Picklable, for a process pool."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax import order_selection
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.values.types import NAN, Array, Trace
from canid_study.artifact import Skipped
from canid_study.chen_ulsoy import (
    between,
    model_structures,
    nonlinearity,
    repetitions,
    stationarity,
    unstructured,
)
from canid_study.chen_ulsoy.closed_loop import fit_car
from canid_study.chen_ulsoy.driver_drift import Drift, drift_of
from canid_study.chen_ulsoy.model_structures import ResidualPlot
from canid_study.chen_ulsoy.nonlinearity import DeadZone
from canid_study.chen_ulsoy.repetitions import ConstantDriver, Sampling
from canid_study.chen_ulsoy.segment_fits import Fits, Joint, fit_joint, fit_segments, reasonable
from canid_study.chen_ulsoy.segments import LENGTHS, MIN_SEGMENTS, Segments, segments_of
from canid_study.chen_ulsoy.settings import ChenUlsoySettings
from canid_study.chen_ulsoy.signals import Spectra, excitation, left_spectra, spectra
from canid_study.chen_ulsoy.unstructured import Complex, Excess, NullBand
from canid_study.printed_numbers import EXCITATION_ORDER

# p value of equal logs below which a driver is left out: one in a thousand folders of one driver
DIFFERENT_LOGS = 1e-3
# segments whose structures are compared: OE takes 15 ms each
_COMPARED = 12
# orders of eq. 2: to d = 20 parameters, as the paper's 7 % (sec. 2.2)
_CANDIDATES = (
    *order_selection.CANDIDATES,
    *(Orders(n, n, 1, 1) for n in (4, 6, 9)),
)
# repetitions that a 95 % quantile needs
_MIN_BOOTSTRAPS = 20


class Stationary(NamedTuple):
    """Share of segments that pass the reverse arrangements test, and its statistic over the whole."""

    error: float
    angle: float
    residual: float
    whole_error: float
    whole_angle: float


class Structures(NamedTuple):
    """Comparison of ARX, ARMAX, OE, BJ."""

    plots: dict[str, ResidualPlot]  # of the first segment compared
    inside: dict[str, float]  # mean share of the autocorrelation's lags inside 99 %
    loss: dict[str, float]  # mean over the segments, of ARMAX's
    segments: int


class Example(NamedTuple):
    """One segment, for Fig. 4."""

    number: int
    error: Array
    angle: Array


class Aliasing(NamedTuple):
    """Mean parameters with an anti-aliasing filter minus those without; (4,) each."""

    difference: Array
    standard_error: Array


class Driver(NamedTuple):
    """One driver; `why` says why there is nothing."""

    name: str
    why: str
    skipped: tuple[Skipped, ...]
    counted: int  # segments that the logs hold, without those of the warm-up
    rejected: int  # of those that were fitted, with unreasonable poles
    number: npt.NDArray[np.int64]  # (S,) segments used
    theta: Array  # (S, 6) a1, a2, b1, b2, c0, c1
    covariance: Array  # (S, 4, 4) of a1 to b2 of each minute's fit, calibrated
    sampling: Array  # (4, 4) that sampling adds to the covariance of the fits
    dt: float
    joint: Joint | None
    constant: ConstantDriver | None
    repeated: Sampling | None
    drift: Drift | None
    stationary: Stationary | None
    spectra: Spectra | None
    example: Example | None
    structures: Structures | None
    orders: tuple[order_selection.Candidate, ...]
    delta: Complex  # (S, F)
    delta_fourth: Complex  # (S, F) of the model of fourth order; NaN where it could not be fitted
    band: NullBand | None
    excess: Excess | None
    dead_zone: DeadZone | None
    equal_logs: float  # p value; NaN: one log
    aliasing: Aliasing | None
    logs: int = 1  # that its segments are of
    left: Spectra | None = None  # of the error and what the models leave of the angle
    excitation: Array | None = None  # (S,) of the error, over its rounding, see `signals.excitation`

    @property
    def model(self) -> Array:
        """(S, 4) a1, a2, b1, b2."""
        return self.theta[:, :4]

    @property
    def group(self) -> tuple[Array, Array]:
        """Models (S, 4) and what sampling adds to each (S, 4, 4), for `between`."""
        return self.model, np.broadcast_to(self.sampling, (len(self.theta), 4, 4))


def driver_of(job: tuple[str, Sequence[tuple[str, Trace]], ChenUlsoySettings]) -> Driver:
    """Analyse one driver.

    Args:
        job: name; name and trace of each log, in time; settings.

    Returns:
        The results, or why there are none. Weak data raise nothing.
    """
    name, logs, settings = job
    selected = segments_of(logs, settings)
    skipped = list(selected.skipped)
    if len(selected.segments.number) < MIN_SEGMENTS:
        why = (
            f"{len(selected.segments.number)} usable segments, and {MIN_SEGMENTS} are needed: "
            f"record {(MIN_SEGMENTS + settings.warm_up) * settings.segment / 60.0:g} minutes and more"
            + (f", or use --segment {LENGTHS[-1]:g}" if settings.segment > LENGTHS[-1] else "")
        )
        return _nothing(name, why, skipped, selected.counted, settings)
    whole = selected.segments
    fits = fit_segments(whole.angle, whole.error)
    good = reasonable(fits.model)
    rejected = int((~good).sum())
    if rejected:
        skipped.append(
            Skipped(
                name, f"{rejected} of {len(good)} segments", "poles that are unstable or negative, or no fit"
            )
        )
    if good.sum() < MIN_SEGMENTS:
        why = f"{int(good.sum())} segments with a reasonable model, and {MIN_SEGMENTS} are needed"
        return _nothing(name, why, skipped, selected.counted, settings)._replace(rejected=rejected)
    used, fits = whole.take(good), fits.take(good)
    joint = fit_joint(used.angle, used.error, np.median(fits.theta[:, repetitions.FIVE], axis=0))
    car = fit_car(used.angle, used.error)
    constant = None
    if joint is not None and car is not None and reasonable(joint.model[None])[0]:
        constant = repetitions.constant_driver(
            joint, car, used.angle, used.error, settings.constant_repetitions, settings.seed
        )
    R = repetitions.calibrated(fits.model_covariance, constant)
    sampling = None
    if constant is not None and joint is not None and car is not None:
        sampling = repetitions.sampling_of(
            fits, joint, constant, car, used.angle, used.error, settings.constant_repetitions, settings.seed
        )
    added = R.mean(axis=0) if sampling is None else sampling.covariance
    logs_p = _equal_logs(used, fits, added)
    if logs_p < DIFFERENT_LOGS:
        why = f"its logs are not of one driver (p = {logs_p:.1g}): name their drivers by --by MAP.toml, or use --by file"
        return _nothing(name, why, skipped, selected.counted, settings)._replace(equal_logs=logs_p)
    n = unstructured.left(used.angle, used.error, fits.theta)
    delta = unstructured.delta(n, used.error, used.dt)
    band = excess = None
    if (
        settings.bootstraps >= _MIN_BOOTSTRAPS
        and sampling is not None
        and joint is not None
        and car is not None
    ):
        offset = repetitions.offsets(sampling, joint, used.angle, used.error)
        band = unstructured.null_band(
            sampling.models,
            offset,
            sampling.c1,
            fits,
            car,
            used.angle,
            used.error,
            used.dt,
            settings.bootstraps,
            settings.seed,
        )
        excess = unstructured.excess(delta, band)
    return Driver(
        name,
        "",
        tuple(skipped),
        selected.counted,
        rejected,
        used.number,
        fits.theta,
        R,
        added,
        used.dt,
        joint,
        constant,
        sampling,
        drift_of(used.number, fits.model, R, settings.seed),
        Stationary(
            float(stationarity.passes(whole.error).mean()),
            float(stationarity.passes(whole.angle).mean()),
            float(stationarity.passes(fits.residual).mean()),
            stationarity.whole(whole.error),
            stationarity.whole(whole.angle),
        ),
        spectra(whole.error, whole.angle, whole.dt),
        Example(int(used.number[0]), used.error[0], used.angle[0]),
        _structures(used),
        tuple(
            order_selection.compare(
                used.angle[0], used.error[0][:, None], np.full(used.angle.shape[1], True), _CANDIDATES
            )
        ),
        delta,
        _fourth_order(used),
        band,
        excess,
        nonlinearity.dead_zone(
            fits, used.angle, used.error, None if constant is None else constant.dead_zone
        ),
        logs_p,
        _aliasing(selected.finer, whole, good, fits),
        len(np.unique(used.log)),
        left_spectra(used.error, n, used.dt, unstructured.SETTLE_S),
        # without the filter, which spreads the rounding
        excitation((whole if selected.finer is None else selected.finer).error, EXCITATION_ORDER),
    )


def _equal_logs(used: Segments, fits: Fits, sampling: Array) -> float:
    which = np.unique(used.log)
    if len(which) < 2:
        return NAN
    groups = [fits.model[used.log == k] for k in which]
    return between.equal_means([(x, np.broadcast_to(sampling, (len(x), 4, 4))) for x in groups])


def _structures(used: Segments) -> Structures:
    at = np.unique(np.linspace(0, len(used.number) - 1, _COMPARED).astype(int))
    plots: dict[str, ResidualPlot] = {}
    inside: dict[str, list[float]] = {s: [] for s in model_structures.STRUCTURES}
    loss: dict[str, list[float]] = {s: [] for s in model_structures.STRUCTURES}
    for k in at:
        made = {s: model_structures.fit(s, used.angle[k], used.error[k]) for s in model_structures.STRUCTURES}
        reference = made["ARMAX"]
        for s, structure_fit in made.items():
            if structure_fit is None or reference is None:
                continue
            plot = model_structures.residual_plot(structure_fit.residual, used.error[k])
            plots.setdefault(s, plot)
            inside[s].append(plot.inside)
            loss[s].append(structure_fit.loss / reference.loss)
    return Structures(
        plots,
        {s: float(np.mean(x)) if x else NAN for s, x in inside.items()},
        {s: float(np.mean(x)) if x else NAN for s, x in loss.items()},
        len(at),
    )


def _fourth_order(used: Segments) -> Complex:
    """Delta of ARMAX(4,4,1), Fig. 14."""
    fits = fit_segments(used.angle, used.error, 4, 4)
    out = np.full((len(used.number), len(unstructured.FREQUENCIES)), NAN, np.complex128)
    stable = np.array(
        [np.isfinite(m).all() and bool((np.abs(np.roots([1.0, *m[:4]])) < 1.0).all()) for m in fits.model]
    )
    if stable.any():
        n = unstructured.left(used.angle[stable], used.error[stable], fits.theta[stable], 4, 4)
        out[stable] = unstructured.delta(n, used.error[stable], used.dt)
    return out


def _aliasing(
    finer: Segments | None, whole: Segments, good: npt.NDArray[np.bool_], fits: Fits
) -> Aliasing | None:
    """Pairs of the same minutes, so that the difference has its own, small error."""
    if finer is None or len(finer.number) != len(whole.number):
        return None
    plain = fit_segments(finer.angle[good], finer.error[good]).model
    away = fits.model - plain
    away = away[np.isfinite(away).all(axis=1)]
    if len(away) < MIN_SEGMENTS:
        return None
    return Aliasing(away.mean(axis=0), away.std(axis=0, ddof=1) / len(away) ** 0.5)


def _nothing(
    name: str, why: str, skipped: list[Skipped], counted: int, settings: ChenUlsoySettings
) -> Driver:
    none = np.zeros((0, len(unstructured.FREQUENCIES)), np.complex128)
    return Driver(
        name,
        why,
        (*skipped, Skipped(name, "the driver", why)),
        counted,
        0,
        np.zeros(0, np.int64),
        np.zeros((0, 6)),
        np.zeros((0, 4, 4)),
        np.full((4, 4), NAN),
        settings.dt,
        None,
        None,
        None,
        None,
        None,
        None,
        None,
        None,
        (),
        none,
        none,
        None,
        None,
        None,
        NAN,
        None,
    )
