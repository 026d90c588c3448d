"""The identified model over a drive: measured output, simulation from the inputs alone, residual and its autocorrelation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.drive.drive_parameters import Identified
from canid.mathematics.estimators import fopdt, pooling, whole_drive
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.identification import residual_tests
from canid.mathematics.identification.armax import simulated_fit
from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.mathematics.identification.fopdt import fopdt_residual, offset_drift
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import Array, Trace

# of the normal distribution: the bound that a white residual's autocorrelation exceeds at one lag in a hundred
QUANTILE_99 = 2.576


class Autocorrelation(NamedTuple):
    """Autocorrelation of the whitened residual, as the whiteness test takes it."""

    lag: Array  # (k,) s, from one step on
    r: Array  # (k,)
    bound: float  # 99 % of one lag of white noise; NaN: too few data


class DriveSeries(NamedTuple):
    """The headline's model over the drive; NaN where a value is not measured or not simulated."""

    estimator: str  # whose model
    t: Array  # (n,) s
    measured: Array  # (n,) the output
    simulated: Array  # (n,) from the inputs alone
    used: npt.NDArray[np.bool_]  # (n,) what the model was fitted to
    autocorrelation: Autocorrelation | None  # None: no residual


def drive_series(trace: Trace, identified: Identified, **settings: object) -> DriveSeries | None:
    """Simulate the model of the headline over the whole drive.

    Args:
        trace: of the drive.
        identified: from `identify`, of the same trace.
        **settings: as in `identify`.

    Returns:
        None where there is no model of the whole drive, or the estimator's cannot be simulated here.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> series = drive_series(drive, canid.identify(drive, select_orders=False))
        >>> left = (series.measured - series.simulated)[series.used]
        >>> bool(np.nanstd(left) < 0.4 * np.nanstd(series.measured[series.used]))
        True
    """
    name = identified.ranked[0] if identified.whole else ""
    return None if identified.headline is None else series_of(trace, name, identified.headline, **settings)


def series_of(trace: Trace, name: str, result: WholeDrive, **settings: object) -> DriveSeries | None:
    """Simulate the model of one method over a drive, which may be another one than it was fitted to.

    Args:
        trace: of the drive.
        name: of the method.
        result: of it.
        **settings: as in `identify`.
    """
    learned = fitted_trace(trace)
    if name == FOPDT.name and result.model is not None and result.model.start is not None:
        fopdt_settings = whole_drive.settings_of(FOPDT, trace, settings)
        return _fopdt(learned, result, fopdt_settings)
    if isinstance(result.model, ArmaxFit):
        return _armax(learned, result.model, name)
    return None


def _fopdt(trace: Trace, result: WholeDrive, settings: fopdt.FopdtSettings) -> DriveSeries:
    setup = fopdt.configure(trace.input_names, trace.dt, settings)
    fit = result.model
    rows = fopdt_residual.simulate_drive(setup.layout, trace, fit, setup.settle)
    e, _ = fopdt_residual.whitened(rows, fit, settings.output_filter)
    n, per_row = len(rows.output), setup.layout.per_row
    t = np.asarray(
        float(trace.t[0]) + (np.arange(n) * per_row + 0.5 * (per_row - 1)) * trace.dt, dtype=np.float64
    )
    simulated = rows.answer + fit.point.offset
    used = rows.usable & np.isfinite(simulated)
    if fit.drift:
        raw = np.where(used, rows.output - simulated, 0.0)
        left = offset_drift.of_fit(fit.drift, raw, used, fit.noise, fit.stride, rows.step)
        simulated = np.where(used, rows.output - left, simulated)
    found_r = _autocorrelation(e, fit.stride, setup.layout.step, len(fit.noise))
    return DriveSeries(FOPDT.name, t, rows.output, simulated, used, found_r)


def _armax(trace: Trace, fit: ArmaxFit, name: str) -> DriveSeries:
    rows = pooling.pooled(trace)
    simulated = simulated_fit.simulate(fit, rows.inputs, rows.segment, rows.dt)
    ready = rows.learn & np.isfinite(rows.output) & np.isfinite(simulated)
    # the offset of a simulation from rest is what makes its mean that of the output
    if ready.any():
        simulated = simulated + float(np.mean((rows.output - simulated)[ready]))
    n_coefficients = fit.orders.na + fit.orders.nc
    return DriveSeries(
        name,
        rows.t,
        rows.output,
        simulated,
        ready,
        _autocorrelation(fit.residual, 1, rows.dt, n_coefficients),
    )


def _autocorrelation(e: Array, stride: int, step: float, fitted: int) -> Autocorrelation | None:
    """Autocorrelation of a residual over all phases of its stride; None: too few data to test it."""
    known = int(np.isfinite(e).sum())
    lags = min(residual_tests.LAGS, known // stride // 4)
    x = residual_tests.phases(e, stride)
    here = np.isfinite(x)
    x = np.where(here, x, 0.0)
    power = float(x @ x)
    if lags <= fitted or not power > 0.0:
        return None
    r = np.array([float(x[k:] @ x[:-k]) / power for k in range(1, lags + 1)])
    # phases know the same: they count as one
    lag = np.asarray(np.arange(1, lags + 1) * (stride * step), dtype=np.float64)
    return Autocorrelation(lag, r, QUANTILE_99 * (stride / known) ** 0.5)
