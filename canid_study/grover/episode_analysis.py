"""One episode by his method, step by step (Grover 2021, sec. 4.2-4.5), and the joint fit of the same samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import NAN, Array, Trace
from canid_study.grover import joint, miso, output_error, reduction
from canid_study.grover.episodes import Episode, detrended
from canid_study.grover.joint import Joint
from canid_study.grover.miso import Miso
from canid_study.grover.output_error import OutputError, fit_percent
from canid_study.grover.reduction import Balanced, FirstOrder
from canid_study.grover.settings import GroverSettings

# share of the next episode from which the initial states are found; the rest is predicted. With all of it the 22 initial
# states of two models of order 11 fit most of a record by themselves, whatever the input
BEGINNING = 1.0 / 3.0


class PerInput(NamedTuple):
    """One input by his method."""

    fits: tuple[float, ...]  # %, percentage of fit of orders 1, 2, ...
    growing: tuple[int, ...]  # unstable poles of each order
    model: OutputError  # the selected one
    p1: FirstOrder  # of the model, for the episode's own input
    p1d: FirstOrder
    record: FirstOrder  # P1D of the record itself
    truncated: Balanced


class Held(NamedTuple):
    """Percentages of fit on the next episode after its first third, which gives the initial states, in %."""

    high: float  # high-order models, weighed as fits the episode best; from those states or from rest, what fits better
    reduced: float  # the reduced, weighed alike
    joint: float  # joint fit of this episode
    joint_drive: float  # of the whole drive, which has seen that episode


class Analysis(NamedTuple):
    """All of one episode."""

    episode: Episode
    inputs: tuple[PerInput, PerInput]  # headway error, range rate
    together: Miso
    joint: Joint  # of this episode alone
    joint_fit: float  # %, of the joint fit of the drive on this episode
    joint_simulated: Array  # (n,) output unit, detrended
    held: Held | None  # None: no next episode
    output: Array  # (n,) detrended
    raw: Array  # (n, 3) headway error, range rate, output as recorded


def analyse(
    trace: Trace, episode: Episode, following: Episode | None, drive: Joint, settings: GroverSettings
) -> Analysis | str:
    """Analyse one episode.

    Args:
        trace: of the drive.
        episode: of it.
        following: the next one; None: there is none.
        drive: joint fit of the whole drive.
        settings: largest order.

    Returns:
        A text where nothing can be said: why.
    """
    output, inputs = detrended(trace.output[episode.part]), detrended(trace.inputs[episode.part])
    per_input = []
    for u in inputs.T:
        fits = _per_input(output, u, trace.dt, settings)
        if fits is None:
            return "too short, or without movement, for a transfer function of first order"
        per_input.append(fits)
    high, low = [fits.model for fits in per_input], [fits.p1 for fits in per_input]
    together = miso.together(output, inputs, trace.dt, high, low)
    joint_fit = joint.of_episode(trace, episode)
    held = None
    if following is not None:
        y, u = detrended(trace.output[following.part]), detrended(trace.inputs[following.part])
        weighed = [
            model._replace(K=w * model.K) for model, w in zip(low, together.weights[1].tolist(), strict=True)
        ]
        first = round(BEGINNING * len(y))

        def predicts(models: Sequence[FirstOrder], first: int = first, y: Array = y, u: Array = u) -> float:
            if not models:
                return NAN
            return fit_percent(y[first:], miso.first_order_on(y, u, trace.dt, models, begin=first)[first:])

        # from no sample: at rest
        transfer = [miso.on_another(y, u, high, together.weights[0], begin) for begin in (first, 0)]
        held = Held(
            max(fit_percent(y[first:], simulation[first:]) for simulation in transfer),
            predicts(weighed),
            predicts(joint_fit.models),
            predicts(drive.models),
        )
    simulated = joint.simulated(drive, output, inputs, trace.dt)
    return Analysis(
        episode,
        (per_input[0], per_input[1]),
        together,
        joint_fit,
        fit_percent(output, simulated) if drive.models else NAN,
        simulated,
        held,
        output,
        np.column_stack([trace.inputs[episode.part], trace.output[episode.part]]),
    )


def _per_input(output: Array, u: Array, dt: float, settings: GroverSettings) -> PerInput | None:
    models = output_error.orders(output, u, dt, settings)
    model = output_error.selected(models)
    if model is None:
        return None
    return PerInput(
        tuple(m.fit_percent for m in models),
        tuple(m.growing for m in models),
        model,
        reduction.of_model(model, u, dead_time=False),
        reduction.of_model(model, u, dead_time=True),
        reduction.of_record(output, u, dt, dead_time=True),
        reduction.balanced(model),
    )
