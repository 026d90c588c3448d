"""Diagnosis of a driver who keeps the lane: as of car following, with the driver's block alone."""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32

import numpy as np

from canid.mathematics.estimators import armax_whole_drive, output_stamps
from canid.mathematics.identification.identifiability import gain_only
from canid.models.diagnosis.corrections import Context, Corrected, TooLittleError
from canid.models.diagnosis.driver import held_out
from canid.models.diagnosis.driver.driver_intervals import episode_parameters
from canid.models.diagnosis.lane import lane_adequacy, lane_fit, lane_search
from canid.models.diagnosis.lane.lane_fit import FittedLane
from canid.models.diagnosis.lane.lane_model import LaneData, LaneModel
from canid.models.diagnosis.lane.lane_model import prepare as columns
from canid.models.diagnosis.lane.lane_null import Keeping
from canid.models.diagnosis.null import confirmed_search
from canid.models.diagnosis.null.confirmed_search import Confirmed
from canid.models.diagnosis.remnant.remnant_block import RemnantReport
from canid.models.diagnosis.report import Assessed, explained, finding, fit_quality, search_steps
from canid.models.diagnosis.sensing.sensing_block import SensingFindings
from canid.models.diagnosis.vehicle import vehicle_block
from canid.models.diagnosis.verdict import Gained
from canid.models.effects.effect import Effect
from canid.values.findings import Blocked, Fit
from canid.values.types import Array, Channel, Trace

# m/s; standard deviation of a speed that has no axis of its own in a map
STEADY_SPEED = 0.5
NO_ANSWER = (
    "the wheel answers the lateral offset by no more than chance: is it the right signal, and does a person steer? "
    "If so, drive longer"
)
AT_LOCK = "The wheel is at its lock for part of the time: no gain or delay is quoted, steer within its range"
NO_SENSING = Blocked("sensing", "not_testable", "Nothing is redundant with a lateral offset.")
NO_VEHICLE = Blocked("vehicle", "not_testable", "How the car answers the wheel is not diagnosed.")
NO_REMNANT = Blocked("remnant", "not_testable", "The noise of a driver who keeps the lane is not diagnosed.")


class Baseline(NamedTuple):
    """A drive whose driver may be searched for causes."""

    corrected: Corrected
    data: LaneData
    fitted: FittedLane
    late: str  # why the offset is taken to be recorded late, or by another clock; "": it is neither
    slow: bool  # the offset lags: gains hold, delays do not


class Searched(NamedTuple):
    """What the search found on a baseline."""

    baseline: Baseline
    confirmed: Confirmed[LaneData, LaneModel]
    effects: tuple[Effect, ...]  # candidates; (): the baseline was refused
    refused: str  # why the baseline does not describe the drive; "": it does


def context(trace: Trace) -> Context:
    """Sensors and car of a lane drive, of which nothing is diagnosed."""
    vehicle = vehicle_block.nothing(trace, "", ())._replace(block=NO_VEHICLE)
    sensing = SensingFindings((), (), (), NO_SENSING, 0)
    return Context(trace, np.ones(trace.t.size, dtype=bool), (), sensing, vehicle, (), NO_REMNANT)


def prepare(corrected: Corrected) -> Baseline:
    """Fit the baseline.

    Args:
        corrected: the drive.

    Raises:
        TooLittleError: too little was measured, or the wheel answers nothing.
    """
    steps = corrected.steps
    trace, usable = output_stamps.at_own_stamps(corrected.trace, corrected.usable)
    missing = corrected.lacking or lane_fit.lacking(trace, usable, corrected.settings.minimum)
    missing = missing or output_stamps.too_slow_to_steer(trace)
    if missing:
        raise TooLittleError(missing, steps)
    data = columns(trace, usable)
    fitted = lane_fit.baseline(data)
    if fitted is None:
        raise TooLittleError("too few samples in a row in which a person keeps the lane", steps)
    if not lane_fit.answered(data, fitted):
        raise TooLittleError(NO_ANSWER, steps)
    fitted_rows = data.output.usable & ~data.output.hidden
    late = armax_whole_drive.own_motion(trace, fitted_rows)[0]
    slow = late == armax_whole_drive.CAR_SLOW
    late = "" if slow else late
    # the steps may be all that speaks against the driver
    if late and armax_whole_drive.input_coarse(trace, fitted_rows, lane_fit.VISIBLE_STILL_SHARE):
        raise TooLittleError(late, steps)
    return Baseline(corrected._replace(trace=trace, usable=usable), data, fitted, late, slow)


def search(base: Baseline) -> Searched:
    """Search for causes until every name stands; where no model describes the drive, none does.

    Args:
        base: the drive and its baseline.
    """
    settings = base.corrected.settings
    # the same drive gives the same replicates
    seed = crc32(np.ascontiguousarray(base.corrected.trace.output).tobytes())
    block = Keeping(base.data, base.fitted, settings.catalogue, seed)
    confirmed = confirmed_search.search_causes(block, settings.catalogue, settings.progress)
    # curves turn the wheel more than an offset does: with a cause that explains them the model may hold
    refused = lane_fit.refusal(confirmed.search.data, confirmed.search.solved) or base.late
    if not refused:
        return Searched(base, confirmed, settings.catalogue, "")
    nothing = confirmed_search.search_causes(block, (), settings.progress)
    return Searched(base, nothing, (), refused)


def assess(searched: Searched) -> Assessed:
    """Test what the final model leaves, and what the causes are worth.

    Args:
        searched: what was found.
    """
    base, confirmed, effects = searched.baseline, searched.confirmed, searched.effects
    data, search, trace = base.data, confirmed.search, base.corrected.trace
    before, solved, used = search.baseline, search.solved, data.output.usable & ~data.output.hidden
    after_out = held_out.simulated(search, solved, None)
    held = lane_adequacy.assess(search, explained(before, solved, data))
    # the interval of a lane keeper's gain is that of a bootstrap on this drive
    gained = Gained(confirmed.gain, confirmed.null_gain, confirmed.log_score, predicted=False)
    estimates = lane_fit.parameters(solved, search.data)
    seconds = float(used.sum()) * data.output.dt
    findings = tuple(
        finding(
            cause,
            episode_parameters(cause, seconds) if cause.episodes else estimates.get(cause.effect.id, {}),
            held,
            gained,
            confirmed.log_scores[cause.effect.id],
            lambda rival, effect: lane_fit.parameters(rival, search.data, effect.id)[effect.id],
        )
        for cause in search.named
    )
    expected = lane_search.expected(effects, data, before)
    undecided = lane_search.undecided(effects, expected, {stated.effect for stated in findings})
    moves = float(np.std(data.speed[used])) > STEADY_SPEED
    rows, order = int(before.rows.sum()), before.noise.A.size - 1
    return Assessed(
        base.corrected, trace, used,
        _fit(searched, before, before.fitted.model), _fit(searched, solved, after_out),
        (before.fitted.model, after_out), findings, held, gained, len(effects), search.steps,
        expected=expected,
        undecided=undecided,
        advice=[reason.why.rpartition("what would decide: ")[2] for reason in undecided],
        steps=(
            *base.corrected.steps,
            *confirmed.refused,
            *search_steps(held, search.named, search.steps, len(effects), rows, order),
        ),
        remarks=(*confirmed.refused, *([AT_LOCK] if (data.output.usable & data.output.hidden).any() else [])),
        maps=[(("lateral_offset", data.offset), ("speed", data.speed))] if moves else [],
        inputs={"lateral_offset": data.offset},
        remnant=RemnantReport((), NO_REMNANT),
        refused=searched.refused,
    )  # fmt: skip


def _fit(searched: Searched, solved: FittedLane, out: Array) -> Fit:
    data = searched.baseline.data
    percent, sd = fit_quality(data.output.y, out, data.output.usable & ~data.output.hidden)
    # what does not describe the drive has no number to quote
    channels = lane_fit.channels(solved, data) if not searched.refused else {"lateral_offset": Channel()}
    if searched.baseline.slow:
        channels = {
            name: gain_only(channel, armax_whole_drive.CAR_SLOW) for name, channel in channels.items()
        }
    return Fit(channels, percent, out, sd)
