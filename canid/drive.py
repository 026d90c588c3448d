"""A drive's parameters: over sliding windows, as the estimators tell them live, and over the whole drive."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.estimators import ESTIMATORS, agreement
from canid.identification import moments, orders, residuals
from canid.identification.armax_batch import ArmaxFit, Orders, fit_armax
from canid.identification.orders import Candidate
from canid.identification.process_fit import fit_process
from canid.types import ArmaxSettings, Channel, Estimate, FopdtSettings, ResidualTests, Sample, Trace

# s between two windows that are reported: a sixth of the window, so that they overlap and nothing is missed
EVERY = 10.0


class ArmaxDrive(NamedTuple):
    """The ARMAX model of the whole drive."""

    fit: ArmaxFit
    channels: dict[str, Channel]
    residual_tests: ResidualTests


class Identified(NamedTuple):
    """What one drive tells of its driver."""

    duration: float  # s
    driver_time: float  # s in which a person drove and followed
    windows: tuple[Estimate, ...]
    channels: dict[str, Channel]  # FOPDT over the whole drive
    fit_percent: float
    armax: ArmaxDrive | None  # None: too few data, or no stable model
    orders: tuple[Candidate, ...]  # compared on this drive, best first


def identify(
    trace: Trace,
    *,
    armax: ArmaxSettings = ArmaxSettings(),
    fopdt: FopdtSettings = FopdtSettings(),
    select_orders: bool = True,
) -> Identified:
    """Identify the driver of a whole drive.

    Args:
        trace: from `read_trace`.
        armax: orders of the ARMAX model.
        fopdt: window and box of the FOPDT fit.
        select_orders: compare other orders as well.

    Returns:
        an `Identified`; what the drive cannot tell is NaN, never an exception.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> told = canid.identify(drive, select_orders=False)
        >>> told.channels["range_rate"].K.low < 5.62 < told.channels["range_rate"].K.high  # its truth
        True
    """
    names = trace.input_names
    usable = trace.learn & np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    duration = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    whole = fit_process(
        trace.output,
        trace.inputs,
        trace.learn,
        trace.dt,
        segment=trace.segment,
        tau_max=fopdt.tau_max,
        dead_time_max=fopdt.dead_time_max,
        prior=fopdt.prior,
    )
    return Identified(
        duration=duration,
        driver_time=float(usable.sum() * trace.dt),
        windows=tuple(windows(trace, armax, fopdt)),
        channels=dict(zip(names, whole.channels, strict=True)),
        fit_percent=whole.fit_percent,
        armax=_armax(trace, usable, armax),
        orders=tuple(
            orders.compare(trace.output, trace.inputs, usable, segment=trace.segment) if select_orders else ()
        ),
    )


def samples(trace: Trace) -> list[Sample]:
    """The trace row by row, as the estimators take it."""
    rows = zip(trace.t, trace.output, trace.inputs, trace.gate, trace.learn, trace.segment, strict=True)
    return [
        Sample(float(t), float(y), tuple(float(x) for x in u), gate, bool(learn), int(segment), {})
        for t, y, u, gate, learn, segment in rows
    ]


def windows(trace: Trace, armax: ArmaxSettings, fopdt: FopdtSettings) -> list[Estimate]:
    """What each estimator said along the drive, every `EVERY` s: the same numbers as live."""
    settings: dict[str, Any] = {"armax": armax, "fopdt": fopdt}
    running = [make(trace.input_names, trace.dt, settings[name]) for name, make in ESTIMATORS]
    states, agreed = [estimator.init() for estimator in running], agreement.init()
    due = dict.fromkeys((estimator.name for estimator in running), EVERY)
    out = []
    for sample in samples(trace):
        spoken = []
        for k, estimator in enumerate(running):
            states[k], estimate = estimator.step(states[k], sample)
            spoken += [estimate] if estimate is not None else []
        agreed, told = agreement.step(agreed, spoken)
        for estimate in told:
            if estimate.t >= due[estimate.estimator] - 1e-6:
                out.append(estimate)
                due[estimate.estimator] = EVERY * (np.floor(estimate.t / EVERY + 1e-6) + 1)
    return out


def _armax(trace: Trace, usable: npt.NDArray[np.bool_], settings: ArmaxSettings) -> ArmaxDrive | None:
    chosen = Orders(settings.na, settings.nb, settings.nc, settings.nk)
    fit = fit_armax(trace.output, trace.inputs, usable, chosen, segment=trace.segment)
    if fit is None:
        return None
    channels = moments.channels(trace.input_names, fit.A, fit.B, chosen.nk, fit.covariance, trace.dt)
    tests = residuals.look(fit.residual, trace.inputs, trace.input_names, chosen.na + chosen.nc)
    return ArmaxDrive(fit, channels, tests)
