"""A drive's driver as a car-following model of SUMO: calibrated in closed loop on the gap, chosen on held-out data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from canid.analysis.sumo import driver_noise
from canid.analysis.sumo.driver_noise import DriverNoise
from canid.analysis.sumo.following import Following, distributions, following, in_stretches, quantiles
from canid.analysis.sumo.krauss import STEP_S
from canid.analysis.sumo.sumo_models import MODELS, SumoModel, sensitivity
from canid.models.diagnosis.driver.closed_loop import MIN_GAP_M
from canid.models.diagnosis.driver.held_out import FOLDS
from canid.models.diagnosis.rivals.calibration import Calibrated, calibrate, covariance, intervals
from canid.models.diagnosis.rivals.comparison import MIN_STRETCHES
from canid.models.diagnosis.rivals.recommendation import MARGIN
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.models.diagnosis.rivals.rival_simulation import Leads, leads, simulate
from canid.values.findings import ClosedLoopError, nrmse
from canid.values.text import json_values
from canid.values.types import NAN, Array, Interval, Trace

# grows when a name of the JSON goes or changes its meaning
VERSION = 1
NOT_ENOUGH_DATA = "not_enough_data"
OK = "ok"
# of the highest speed driven: a lower wanted speed may fit a drive, and loses every lead that drives faster
FASTER = 1.1
# m/s; behind a steadier lead every driver keeps a gap, and nothing shows how
LEAST_LEAD_SD = 0.5
# a model whose gap errs by more than it varies describes nobody
WORST_ERROR = 1.0


class Candidate(NamedTuple):
    """One model, calibrated to a drive."""

    model: str
    source: str
    parameters: Mapping[str, Interval]
    units: Mapping[str, str]
    x: tuple[float, ...]  # on the unit cube
    covariance: tuple[tuple[float, ...], ...]  # of x; variance inf: not identified
    error: ClosedLoopError  # on held-out data
    collides: bool  # on held-out data
    noise: DriverNoise


class DriverModel(NamedTuple):
    """The driver of one drive."""

    model: str  # of the candidate that was chosen
    why: str  # it was chosen, as one line
    candidates: tuple[Candidate, ...]
    seconds: float  # of following that it rests on
    top_speed: float  # m/s, 99.5 % point while following
    quantiles: Mapping[str, tuple[float, ...]]  # gap, time_gap, speed, accel at `following.PERCENT`

    @property
    def chosen(self) -> Candidate:
        """The candidate that was chosen."""
        return next(candidate for candidate in self.candidates if candidate.model == self.model)


class NoModel(NamedTuple):
    """A drive that shows too little of its driver."""

    reason: str


def fit(trace: Trace, output: str = "") -> DriverModel | NoModel:
    """Fit SUMO's models to a drive.

    Args:
        trace: of a drive behind a lead.
        output: role of the driver's output. Gap and speed alone count, as SUMO has no pedal; a drive that is steered has no
            model.

    Returns:
        the models with the chosen one, or the reason why there is none.

    Example:
        >>> import canid
        >>> model = fit(canid.read_trace("replay_logs/following_urban.blf", "generic"), "pedal")
        >>> model.model, model.chosen.error.gap < 0.5
        ('ACC', True)
    """
    if output == "steering_angle":
        return NoModel("the driver steers: SUMO's car-following models know gap and speed alone")
    columns = following(trace)
    if columns is None:
        return NoModel("gap, range rate or speed was not measured")
    where = in_stretches(columns)
    if len(where) < MIN_STRETCHES:
        return NoModel(f"{len(where)} stretches behind a lead, {MIN_STRETCHES} are needed: drive longer")
    if not _moves(columns):
        return NoModel(
            f"the lead's speed hardly changes (standard deviation below {LEAST_LEAD_SD} m/s): drive with varying speed"
        )
    side = leads(columns.gap, columns.speed, columns.lead, where, columns.dt, STEP_S)
    fold = np.array([stretch.block % FOLDS for stretch in where])
    driven = quantiles(distributions(columns.gap, columns.speed, columns.shown, columns.dt))
    top_speed = driven["speed"][-1]
    candidates = tuple(_candidate(model, top_speed, side, fold) for model in MODELS)
    best = _best(candidates)
    if best is None:
        return NoModel("no model follows the lead of this drive in closed loop")
    return DriverModel(*best, candidates, float(columns.shown.sum()) * columns.dt, top_speed, driven)


def _moves(columns: Following) -> bool:
    """Does the lead's speed change by more than a sensor's noise?"""
    return float(np.std(columns.lead[columns.shown])) >= LEAST_LEAD_SD


def _above(rival: RivalModel, top_speed: float) -> RivalModel:
    """The model with a wanted speed that is above the highest one driven."""
    least = FASTER * top_speed
    return rival._replace(
        parameters=tuple(
            parameter._replace(low=min(max(parameter.low, least), 0.5 * parameter.high))
            if parameter.name == "v0"
            else parameter
            for parameter in rival.parameters
        )
    )


def _on_cube(calibrated: RivalModel, rival: RivalModel, x: Array) -> tuple[Array, Array]:
    """Parameters on the cube of the listed ranges, and how many of its units are one of the own."""
    scale, out = np.ones_like(x), x.copy()
    for k, (a, b) in enumerate(zip(calibrated.parameters, rival.parameters, strict=True)):
        if a.low != b.low:
            span = math.log(b.high / b.low)
            scale[k] = math.log(a.high / a.low) / span
            out[k] = math.log(a.low / b.low) / span + scale[k] * x[k]
    return out, scale


def _candidate(model: SumoModel, top_speed: float, stretches: Leads, fold: Array) -> Candidate:
    rival = _above(model.rival, top_speed)
    whole = calibrate(rival, stretches)
    q = rival.physical(whole.x)
    # a model that sets the speed drives it within one step
    sd, time = driver_noise.noise(rival, q, stretches, 1.0 / STEP_S if model.noise_of == "speed" else 1.0)
    x, scale = _on_cube(rival, model.rival, whole.x)
    return Candidate(
        rival.name,
        rival.source,
        intervals(rival, whole),
        {parameter.name: parameter.unit for parameter in rival.parameters},
        tuple(x.tolist()),
        tuple(tuple(row) for row in (covariance(whole) * np.outer(scale, scale)).tolist()),
        *_held_out(rival, whole, stretches, fold),
        DriverNoise(sd, time, sensitivity(model, q, stretches)),
    )


def _held_out(
    rival: RivalModel, whole: Calibrated, stretches: Leads, fold: Array
) -> tuple[ClosedLoopError, bool]:
    """Errors of stretches that did not calibrate, and whether the model collides there."""
    q = np.empty((whole.x.size, 1, fold.size))
    for k in np.unique(fold):
        others = fold != k
        fitted = calibrate(rival, stretches.take(others), (whole.x,)) if others.any() else whole
        q[:, 0, ~others] = rival.physical(fitted.x)[:, None]
    gap, speed = (x[:, 0][stretches.inside] for x in simulate(rival, q, stretches))
    measured = stretches.gap[stretches.inside]
    error = ClosedLoopError(nrmse(gap, measured), nrmse(speed, stretches.speed[stretches.inside]))
    return error, bool(np.any((gap <= MIN_GAP_M) & (measured > 2 * MIN_GAP_M)))


def _best(candidates: tuple[Candidate, ...]) -> tuple[str, str] | None:
    """The model and why; None: no one follows the lead."""
    known = [candidate for candidate in candidates if candidate.error.gap <= WORST_ERROR]
    # whoever collides is no driver, however small his error
    safe = [candidate for candidate in known if not candidate.collides] or known
    if not safe:
        return None
    least = min(safe, key=lambda candidate: candidate.error.gap)
    says = "held-out error of the gap: " + ", ".join(
        f"{candidate.model} {candidate.error.gap:.3f}{' (collides)' if candidate.collides else ''}"
        for candidate in candidates
    )
    # errors on the same stretches differ by chance
    first = next(candidate for candidate in safe if candidate.error.gap * (1.0 - MARGIN) <= least.error.gap)
    if first is least:
        return least.model, says
    return first.model, f"{says}; {least.model} is not better by {100 * MARGIN:.0f} %"


def to_json(model: DriverModel | NoModel) -> dict[str, Any]:
    """As a JSON object; null: not known.

    Example:
        >>> to_json(NoModel("drive longer"))
        {'version': 1, 'status': 'not_enough_data', 'reason': 'drive longer'}
    """
    if isinstance(model, NoModel):
        return {"version": VERSION, "status": NOT_ENOUGH_DATA, "reason": model.reason}
    candidates = [
        {
            "model": candidate.model,
            "source": candidate.source,
            "parameters": {
                name: {**x._asdict(), "unit": candidate.units[name]}
                for name, x in candidate.parameters.items()
            },
            "x": candidate.x,
            "covariance": candidate.covariance,
            "nrmse": candidate.error._asdict(),
            "collides": candidate.collides,
            "noise": candidate.noise,
        }
        for candidate in model.candidates
    ]
    whole = model._asdict()
    del whole["candidates"]
    made: dict[str, Any] = json_values.plain(
        {"version": VERSION, "status": OK, **whole, "candidates": candidates}
    )
    return made


def from_json(made: Mapping[str, Any]) -> DriverModel | NoModel:
    """Read what `to_json` wrote.

    Raises:
        ValueError: it is of another version, or no such object.
    """
    if made.get("version") != VERSION:
        raise ValueError(
            f"driver model of version {made.get('version')!r}, not {VERSION}: analyse the drive again"
        )
    try:
        if made["status"] != OK:
            return NoModel(str(made["reason"]))
        return DriverModel(
            str(made["model"]),
            str(made["why"]),
            tuple(_read(entry) for entry in made["candidates"]),
            float(made["seconds"]),
            float(made["top_speed"]),
            {str(name): tuple(float(v) for v in x) for name, x in made["quantiles"].items()},
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no driver model: {error!r}") from None


def _read(made: Mapping[str, Any]) -> Candidate:
    parameters, noise = made["parameters"], made["noise"]
    return Candidate(
        str(made["model"]),
        str(made["source"]),
        {name: _as_interval(x) for name, x in parameters.items()},
        {name: str(x["unit"]) for name, x in parameters.items()},
        tuple(float(x) for x in made["x"]),
        tuple(tuple(math.inf if c is None else float(c) for c in row) for row in made["covariance"]),
        ClosedLoopError(_as_number(made["nrmse"]["gap"]), _as_number(made["nrmse"]["speed"])),
        bool(made["collides"]),
        DriverNoise(_as_interval(noise["sd"]), _as_interval(noise["time"]), _as_number(noise["sensitivity"])),
    )


def _as_number(x: Any) -> float:
    return NAN if x is None else float(x)


def _as_interval(x: Mapping[str, Any]) -> Interval:
    return Interval(_as_number(x["value"]), _as_number(x["low"]), _as_number(x["high"]))
