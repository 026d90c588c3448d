"""canid's joint fit of both inputs (FOPDT) over a drive and over one episode, and what it simulates of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.estimators.fopdt_whole_drive import Fitting
from canid.mathematics.estimators.whole_drive import settings_of
from canid.mathematics.identification import feedback_bias
from canid.mathematics.identification.fopdt import fopdt_fit
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import NAN, Array, Channel, Identifiable, Trace
from canid_study.grover import miso
from canid_study.grover.episodes import INPUTS, Episode
from canid_study.grover.reduction import FirstOrder

# s of inputs before an episode that its first samples may respond to: the ends of FOPDT's box of lag and dead time
HISTORY_S = 4.5


class Joint(NamedTuple):
    """A joint fit: both inputs at once, with a noise model."""

    channels: Mapping[str, Channel]  # input name -> gain, lag, dead time with 95 % intervals and status
    models: tuple[FirstOrder, ...]  # at the posterior's mean, one per input; none: no fit
    fit_percent: float  # of the simulation over the data used
    says: str = ""  # what speaks against it
    changes: int = 0  # steps of the gains within the drive


def of_drive(trace: Trace) -> Joint:
    """Fit all usable samples of a drive.

    Args:
        trace: of car following.

    Example:
        >>> import canid
        >>> fit = of_drive(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> fit.channels["range_rate"].K.low < 5.62 < fit.channels["range_rate"].K.high  # its truth
        True
    """
    trusted = fitted_trace(trace)
    assert FOPDT.identify is not None
    whole = FOPDT.identify(trusted, settings_of(FOPDT, trace, {}))
    if whole is None or not isinstance(whole.model, ProcessFit) or whole.model.start is None:
        return Joint({name: Channel() for name in trace.input_names}, (), NAN, "too few usable samples")
    changes = len(whole.details.get("changes") or ())
    says = "; ".join(whole.lines)
    return Joint(whole.channels, _models(whole.model), whole.fit_percent or NAN, says, changes)


def of_episode(trace: Trace, episode: Episode) -> Joint:
    """Fit the samples of one episode; the inputs before it are its history.

    Args:
        trace: of the drive.
        episode: of it.
    """
    fit = _fit(trace, episode)
    if fit.start is None:
        return Joint({name: Channel() for name in INPUTS}, (), NAN, "no fit")
    return Joint(dict(zip(INPUTS, fit.channels, strict=True)), _models(fit), fit.fit_percent)


def one_input(trace: Trace, index: int) -> Joint:
    """Fit one input alone over a whole drive, with the same noise model: what is left out is then part of the noise.

    Args:
        trace: of the drive.
        index: of the input.
    """
    how = _fitting(trace)
    fit = how.fit(
        trace._replace(inputs=trace.inputs[:, [index]], input_names=(trace.input_names[index],)), slice(None)
    )
    if fit.start is None:
        return Joint({trace.input_names[index]: Channel()}, (), NAN, "no fit")
    return Joint({trace.input_names[index]: fit.channels[0]}, _models(fit), fit.fit_percent)


def with_speed(trace: Trace) -> float:
    """Percentage of fit of the joint model with speed times the headway error (eq. 2.1); NaN: no speed.

    Args:
        trace: of the drive.
    """
    speed = trace.signals.get("speed")
    if speed is None:
        return NAN
    inputs = np.column_stack([trace.inputs[:, 0] * speed, trace.inputs[:, 1]])
    return _fitting(trace).fit(trace._replace(inputs=inputs), slice(None)).fit_percent


def simulated(joint: Joint, output: Array, inputs: Array, dt: float) -> Array:
    """Simulate on an episode, from the initial states and the line that fit best, as the models per input have them.

    Args:
        joint: with models.
        output: (n,) detrended.
        inputs: (n, 2) detrended.
        dt: s.
    """
    if not joint.models:
        return np.full(len(output), NAN)
    return miso.first_order_on(output, inputs, dt, joint.models, line=True)


def known(channel: Channel) -> bool:
    """Whether the gain may be quoted.

    >>> known(Channel())
    False
    """
    return channel.status is not Identifiable.NOT


def _fitting(trace: Trace) -> Fitting:
    settings = settings_of(FOPDT, trace, {})
    return Fitting(settings.tau_max, settings.dead_time_max, settings.prior, settings.output_filter)


def _fit(trace: Trace, episode: Episode) -> ProcessFit:
    settings = settings_of(FOPDT, trace, {})
    first = max(episode.first - round(HISTORY_S / trace.dt), 0)
    part = slice(first, episode.stop)
    learn = np.zeros(episode.stop - first, dtype=bool)
    learn[episode.first - first :] = True
    return fopdt_fit.fit_process(
        trace.output[part],
        trace.inputs[part],
        learn,
        trace.dt,
        fopdt_fit.Settings(
            tau_max=settings.tau_max,
            dead_time_max=settings.dead_time_max,
            output_filter=settings.output_filter,
            held=feedback_bias.held(trace.input_names),
        ),
        segment=trace.segment[part],
    )


def _models(fit: ProcessFit) -> tuple[FirstOrder, ...]:
    at = fit.point
    return tuple(
        FirstOrder(float(K), float(tau), float(theta), fit.fit_percent)
        for K, tau, theta in zip(at.K, at.tau, at.dead_time, strict=True)
    )
