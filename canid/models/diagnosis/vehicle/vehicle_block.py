"""Diagnosis of the vehicle: does the car follow its pedal, and if not, why; and the fitted car."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.driver.held_out import FOLD_BLOCK_S, FOLDS, gain
from canid.models.diagnosis.fitting.candidates import direction, model_directions, rival_causes
from canid.models.diagnosis.fitting.fitted_model import dropped, extended, solve, without_parameters
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.model import place
from canid.models.diagnosis.fitting.score_test import independent, score_test
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.fitting.uncertainty import needed, of_effect
from canid.models.diagnosis.vehicle import vehicle_data, vehicle_search
from canid.models.diagnosis.vehicle.vehicle_data import VehicleData
from canid.models.diagnosis.vehicle.vehicle_model import DRAG, LAG, ROLLING, STRENGTH, accel, with_effects
from canid.models.diagnosis.vehicle.vehicle_search import (
    FittedVehicle,
    VehicleSearch,
    features,
    search_vehicle,
)
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import DriveFeatures, Effect, Screening, Unavailable
from canid.values.findings import Blocked, Check, Finding, Flags, NotTestable, Tried
from canid.values.text.names import readable
from canid.values.text.numbers import chance, number
from canid.values.types import NAN, Array, Interval, Trace

VEHICLE = tuple(effect for effect in CATALOGUE if effect.where == "vehicle")
# s; engines follow their pedal within 0.2 to 0.6 s. A longer lag may be of another part of the car
SLOWEST_ENGINE_S = 0.8
# of the residual's variance, and of what the causes explained: what is left is material only above both (as in `adequacy`)
VEHICLE_MATERIAL_SHARE, VEHICLE_LEFT_BEHIND_SHARE = 0.02, 0.1
# of the error's variance on held-out data, that the interval of a named cause's gain must exceed: a cause with an
# approximate form leaves some per cent to a neighbour
MIN_HELD_OUT_GAIN = 0.02
# of the acceleration's variance; a car that explains less is none
LEAST_EXPLAINED = 0.1
# probability that a car with the right model fails the adequacy test
VEHICLE_FALSE_ALARM = 0.005
# s after which scores are independent
VEHICLE_SCORE_LAG_S = 5.0


class Vehicle(NamedTuple):
    """Findings of the block, and the cars for the closed loop."""

    findings: tuple[Finding, ...]
    tried: tuple[Tried, ...]
    not_testable: tuple[NotTestable, ...]
    checks: tuple[Check, ...]
    block: Blocked
    cars: (
        tuple[FittedVehicle, FittedVehicle] | None
    )  # without and with what was named; None: nothing could be fitted
    slope: Array  # (n,) what the car's step takes for the road's slope
    gear: Array  # (n,)
    left: Array  # (n,) m/s², measured less modelled; while braking this is the brake
    missed: float = 0.0  # share of the residual's variance that depends on pedal and speed


def diagnose_vehicle(trace: Trace, usable: Flags, catalogue: tuple[Effect, ...] = VEHICLE) -> Vehicle:
    """Diagnose the vehicle.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
        catalogue: effects that may be named.

    Returns:
        a `Vehicle`. What the drive cannot decide is in `not_testable`, never an exception.
    """
    data = vehicle_data.prepare(trace, usable)
    if isinstance(data, str):
        return nothing(trace, data, catalogue)
    before = vehicle_search.baseline(data)
    if before is None:
        why = "it drives unbraked, with a person at the pedal, for less than 40 s in a row"
        return nothing(trace, why, catalogue)
    known = features(data, before)
    effects = tuple(effect for effect in catalogue if _unavailable(effect, known) is None)
    expected = {effect.id: _expected(effect, data, before) for effect in effects}
    shown = tuple(effect for effect in effects if expected[effect.id] >= needed(1, len(effects)))
    search = search_vehicle(data, shown, before)
    adequate, missed = _adequacy(search, data)
    candidates = (
        _finding(named, search, data, passed=adequate.passed is not False)
        for named in search.named
        if _unusual(named, search, data)
    )
    # only what surely simulates held-out data better: otherwise a bent map is named in addition to other causes
    findings = tuple(finding for finding in candidates if finding.gain.low > MIN_HELD_OUT_GAIN)
    return Vehicle(
        findings, _tried(search, effects, expected), _not_testable(known, catalogue, effects, expected),
        (*_checks(search, data), adequate), _line(findings, search, adequate, data),
        (_without(search, data, findings), search.solved), data.seen.slope, data.seen.gear,
        data.output.y - search.solved.fitted.model, missed,
    )  # fmt: skip


def _without(search: VehicleSearch, data: VehicleData, findings: tuple[Finding, ...]) -> FittedVehicle:
    """The car with what every car has, and without what was named."""
    return (
        dropped(data, search.solved, *(finding.effect for finding in findings)) if findings else search.solved
    )


def nothing(trace: Trace, why: str, catalogue: tuple[Effect, ...]) -> Vehicle:
    """Result where no car could be fitted, and why."""
    ids, n = tuple(effect.id for effect in catalogue), trace.t.size
    return Vehicle(
        (), (), (NotTestable(ids, why),) if ids else (), (),
        Blocked("vehicle", "not_testable", f"The car could not be diagnosed: {why}."), None,
        np.zeros(n), np.zeros(n), np.full(n, NAN),
    )  # fmt: skip


def _unavailable(effect: Effect, drive: DriveFeatures) -> Unavailable | None:
    """Reason why an effect cannot be tested on this drive; None: it can."""
    why = effect.unavailable(drive)
    if why is None and not effect.identifiable:
        return Unavailable(f"{effect.absorbed}; what would decide: {effect.decides}")
    return why


def _expected(effect: Effect, data: VehicleData, before: FittedVehicle) -> float:
    """Evidence that a typical strength of an effect would leave on this drive; infinite where that does not screen it."""
    if effect.screening is not Screening.DETECTABLE:
        return np.inf
    model = extended(before.model, effect)
    q = np.concatenate([before.q, [parameter.typical for parameter in effect.parameters]])
    d = direction(data, before, model_directions(before), model.bind(data)(q) - before.fitted.model)
    return float(d @ d)


def _unusual(named: Named, search: VehicleSearch, data: VehicleData) -> bool:
    """Is it more than every car and road has?"""
    at = place(search.solved.model, named.effect.id).start
    value = float(search.solved.q[at])
    wide = SIGMAS * float(vehicle_search.standard_errors(search.solved, data.output.dt)[at])
    return named.effect.unusual(Interval(value, value - wide, value + wide), features(data, search.solved))


def _finding(named: Named, search: VehicleSearch, data: VehicleData, *, passed: bool) -> Finding:
    effect = named.effect
    estimates, says = of_effect(data, search.solved, effect), effect.says
    for name, iv in estimates.items():
        says = says.replace("{" + name + "}", f"{number(iv.value)} [{number(iv.low)}, {number(iv.high)}]")
    return Finding(
        effect=effect.id, where=effect.where, rivals=named.rivals, surrogate=not passed, parameters=estimates,
        units={p.name: p.unit for p in effect.parameters}, gain=_gain(named, search, data), says=says,
        evidence=named.evidence, needed=named.needed,
        rival_causes=rival_causes(named, partial(of_effect, data)),
    )  # fmt: skip


def _gain(named: Named, search: VehicleSearch, data: VehicleData) -> Interval:
    """Gain of the cause over the model with all others, on held-out stretches."""
    n, dt, solved = data.output.y.size, data.output.dt, search.solved
    fold = (np.arange(n) // round(FOLD_BLOCK_S / dt)) % FOLDS
    other, q = without_parameters(solved, named.effect.id)
    errors = np.full((2, n), NAN)
    for k in range(FOLDS):
        rows = solved.rows & (fold != k)
        for row, model, begin in zip(errors, (other, solved.model), (q, solved.q), strict=True):
            left = data.output.y - solve(data, model, begin, solved.noise, rows, joint=False).fitted.model
            row[fold == k] = (left**2)[fold == k]
    return gain(errors[0], errors[1], data.output.usable, dt)


def _adequacy(search: VehicleSearch, data: VehicleData) -> tuple[Check, float]:
    """Adequacy of the fitted car: score test of its residual against functions of pedal and speed; their share of it."""
    solved, dt = search.solved, data.output.dt
    fine = solved.rows

    def standard(x: Array) -> Array:
        sd = float(np.std(x[fine]))
        return np.clip((x - np.mean(x[fine])) / max(sd, 1e-9), -4, 4)

    drive = standard(accel(with_effects(()), data.seen, solved.q[:4], dt) + _drag(solved, data))
    v, t = standard(data.seen.speed), standard(data.seen.t)
    inverse = standard(1 / np.maximum(data.seen.speed, 3.0))
    columns = drive**2, drive**3, drive * v, drive * drive * v, drive * inverse, v**3, inverse, drive * t
    X = whitened(solved.noise, np.stack([data.as_measured(x) for x in columns], axis=1))
    X[~fine] = 0.0
    Q = model_directions(solved)
    X = X - Q @ (Q.T @ X)
    turn, e = independent(X), solved.fitted.scored.e
    k = turn.shape[1]
    if not k:
        says = "The drive moves the car too little to test the residual."
        return Check("vehicle gate", None, NAN, VEHICLE_FALSE_ALARM, says, gate=True), 0.0
    tested = score_test(X, turn, e, round(VEHICLE_SCORE_LAG_S / dt))
    p = tested.p
    share = max(tested.gain - tested.expected, 0.0) / max(float(e @ e), 1e-9)
    explained = max(1 - solved.noise.sd**2 / search.baseline.noise.sd**2, 0.0)
    passed = not (
        p < VEHICLE_FALSE_ALARM
        and share > VEHICLE_MATERIAL_SHARE
        and share > VEHICLE_LEFT_BEHIND_SHARE * explained
    )
    says = (
        f"The car's residual {'does not depend' if passed else 'still depends'} on pedal and speed: "
        f"chance {chance(p)} over {k} directions, {100 * share:.1f} % of its variance."
    )
    return Check("vehicle gate", passed, p, VEHICLE_FALSE_ALARM, says, gate=True), share


def _drag(solved: FittedVehicle, data: VehicleData) -> Array:
    out: Array = solved.q[ROLLING] + solved.q[DRAG] * data.seen.speed**2
    return out


def _checks(search: VehicleSearch, data: VehicleData) -> tuple[Check, ...]:
    use = data.output.usable
    y = data.output.y[use]
    left = float(np.var(y - search.solved.fitted.model[use])) / max(float(np.var(y)), 1e-12)
    q, sd = search.solved.q, vehicle_search.standard_errors(search.solved, data.output.dt)

    def estimate(k: int, unit: str) -> str:
        return f"{number(q[k])} ± {number(SIGMAS * sd[k], digits=2)} {unit}"

    says = (
        f"Pedal and speed explain {100 * (1 - left):.0f} % of the acceleration ({data.signal}): "
        f"{estimate(STRENGTH, 'm/s² per %')}, lag {estimate(LAG, 's')}, "
        f"rolling and slope {estimate(ROLLING, 'm/s²')}, drag {estimate(DRAG, '1/m')}."
    )
    late = (
        f"The pull follows the pedal by {estimate(LAG, 's')}; engines do within {SLOWEST_ENGINE_S} s. "
        "A longer lag is an actuator's or a charger's, and only a changing load shows which."
    )
    return (
        Check("vehicle fit", left < 0.5, 1 - left, 0.5, says),
        Check(
            "vehicle lag",
            q[LAG] - SIGMAS * sd[LAG] <= SLOWEST_ENGINE_S,
            float(q[LAG]),
            SLOWEST_ENGINE_S,
            late,
            "s",
        ),
    )


def _tried(
    search: VehicleSearch, effects: tuple[Effect, ...], expected: dict[str, float]
) -> tuple[Tried, ...]:
    rivals = {rival for named in search.named for rival in named.rivals}
    seen = {step.effect.id for step in search.steps}
    out = [
        Tried(
            s.effect.id, s.effect.where, s.step, s.evidence, s.needed, expected[s.effect.id],
            "accepted" if s.accepted else "rival" if s.effect.id in rivals else "rejected",
            "" if s.accepted else "another one explained more" if s.evidence > s.needed else "chance explains as much",
        )
        for s in search.steps
    ]  # fmt: skip
    for effect in effects:
        if effect.id not in seen:
            enough = expected[effect.id] >= needed(1, len(effects))
            out.append(
                Tried(
                    effect.id, effect.where, 1, NAN, needed(len(effect.parameters), len(effects)), expected[effect.id],
                    "rejected" if enough else "not_testable",
                    "its direction explains next to nothing" if enough else "this drive would not show it",
                )
            )  # fmt: skip
    return tuple(out)


def _not_testable(
    known: DriveFeatures,
    catalogue: tuple[Effect, ...],
    effects: tuple[Effect, ...],
    expected: dict[str, float],
) -> tuple[NotTestable, ...]:
    """What this drive cannot decide; effects with one reason in common are one line."""
    reasons: dict[str, tuple[str, ...]] = {}
    for effect in catalogue:
        unavailable = _unavailable(effect, known)
        if unavailable is not None and not unavailable.ruled_out:
            reasons[unavailable.why] = (*reasons.get(unavailable.why, ()), effect.id)
        elif unavailable is None and expected[effect.id] < needed(1, len(effects)):
            why = f"a typical one would leave evidence {expected[effect.id]:.0f} on this drive; it takes {effect.decides}"
            reasons[why] = (effect.id,)
    out = [NotTestable(ids, why) for why, ids in sorted(reasons.items(), key=lambda pair: len(pair[1]))]
    why = (
        "the car's strength, rolling and drag take up its mass, its drag area and a constant slope; "
        "they take a torque signal, a coast-down or a known mass"
    )
    out.append(NotTestable(("mass", "drag_area", "constant_grade"), why))
    return tuple(out)


def _line(
    findings: tuple[Finding, ...], search: VehicleSearch, adequate: Check, data: VehicleData
) -> Blocked:
    named = {finding.effect for finding in findings}
    rest = [cause for cause in search.named if cause.effect.id not in named]
    ordinary = [_briefly(cause.effect, search) for cause in rest if not _unusual(cause, search, data)]
    unsure = [_briefly(cause.effect, search) for cause in rest if _unusual(cause, search, data)]
    usual = f" As usual, and in the model: {', '.join(ordinary)}." if ordinary else ""
    usual += f" Helps, but not reliably on held-out data: {', '.join(unsure)}." if unsure else ""
    if adequate.passed is False:
        return Blocked("vehicle", "unexplained", adequate.says + usual)
    if findings:
        return Blocked("vehicle", "wrong", " ".join(finding.says for finding in findings) + usual)
    use = data.output.usable
    left = (search.solved.fitted.model - data.output.y)[use]
    sd, explained = (
        float(np.std(left)),
        1 - float(np.var(left)) / max(float(np.var(data.output.y[use])), 1e-12),
    )
    if explained < LEAST_EXPLAINED:
        says = f"Pedal and speed explain {100 * explained:.0f} % of the acceleration ({data.signal}): no car is identified."
        return Blocked(
            "vehicle", "not_testable", f"{says} Check the pedal's signal, and who drove (canid check)."
        )
    return Blocked(
        "vehicle", "adequate", f"The car does what its pedal asks for, to {number(sd, digits=2)} m/s².{usual}"
    )


def _briefly(effect: Effect, search: VehicleSearch) -> str:
    """An effect with its first parameter."""
    model = search.solved.model
    first = place(model, effect.id).start
    unit = effect.parameters[0].unit
    return (
        f"{readable(effect.id)} {number(search.solved.q[first], digits=2)}{' ' + unit if unit != '1' else ''}"
    )
