"""Hold-out validation: a model of the first part of a drive simulated over the rest, which it has not seen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.drive_series import DriveSeries, series_of
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.signals.samples.trace_assembly import part
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import Array, Trace

# of the usable time, that the model is fitted to: as much as leaves a third for the test (Ljung 1999, section 16.5)
FITTED_SHARE = 2.0 / 3.0
# s of usable driving in the rest: a lead that speeds up and slows down again
MIN_HELD_OUT_S = 20.0


class HeldOutSeries(NamedTuple):
    """One method's simulation of the rest."""

    t: Array  # (n,) s
    simulated: Array  # (n,) from the inputs alone; NaN where a sample is not used
    fit_percent: float  # 100 (1 − ‖measured − simulated‖ / ‖measured − its mean‖)


class HeldOut(NamedTuple):
    """The rest of a drive, and what models of its first part make of it."""

    since: float  # s, where the rest begins
    methods: Mapping[str, HeldOutSeries]


def held_out(trace: Trace, **settings: Any) -> HeldOut | None:
    """Fit each method to the first two thirds of the usable time, and simulate the rest from the inputs alone.

    The constant of each model is that of the first part too: nothing is fitted to the rest.

    Args:
        trace: of a drive.
        **settings: as in `identify`.

    Returns:
        None where the rest is too short, or no method has a model of the first part.
    """
    # once for all: the first part need not show by itself what the output is made of
    trace = fitted_trace(trace)
    used = np.cumsum(trace.learn)
    if not len(used) or (1.0 - FITTED_SHARE) * float(used[-1]) * trace.dt < MIN_HELD_OUT_S:
        return None
    cut = int(np.searchsorted(used, FITTED_SHARE * used[-1])) + 1
    since = float(trace.t[min(cut, len(trace.t) - 1)])
    first = identify(part(trace, slice(0, cut)), select_orders=False, sliding=False, **settings)
    methods = {}
    for name, whole in first.whole.items():
        series = None if whole is None else series_of(trace, name, _constant(whole), **settings)
        if series is not None and (rest := _rest(series, since)) is not None:
            methods[name] = rest
    return HeldOut(since, methods) if methods else None


def _constant(whole: WholeDrive) -> WholeDrive:
    """A model whose offset does not follow the output."""
    model = whole.model
    return whole._replace(model=model._replace(drift=0)) if isinstance(model, ProcessFit) else whole


def _rest(series: DriveSeries, since: float) -> HeldOutSeries | None:
    late = series.t >= since
    left = series.measured - series.simulated
    before, after = series.used & ~late, series.used & late
    if not before.any() or after.sum() < 2:
        return None
    simulated = np.where(series.used, series.simulated + float(left[before].mean()), np.nan)
    y = series.measured[after]
    spread = float(np.linalg.norm(y - y.mean()))
    if not spread > 0.0:
        return None
    fit = 100.0 * (1.0 - float(np.linalg.norm(y - simulated[after])) / spread)
    return HeldOutSeries(series.t[late], simulated[late], fit)
