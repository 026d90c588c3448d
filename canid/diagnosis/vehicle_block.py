"""The vehicle's block: does the car do what its pedal asks for, and if not, why; and the car that was fitted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.diagnosis import vehicle_data, vehicle_fit
from canid.diagnosis.evidence import needed, spread
from canid.diagnosis.held_out import BLOCK, FOLDS, gain
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.vehicle_data import VehicleData
from canid.diagnosis.vehicle_fit import SolvedCar
from canid.diagnosis.vehicle_model import (
    BASE,
    DRAG,
    LAG,
    ROLLING,
    STRENGTH,
    accel,
    with_effects,
)
from canid.diagnosis.vehicle_search import CarSearch, NamedCause, search_car
from canid.effects import CATALOGUE
from canid.effects.cause import Effect
from canid.findings import Blocked, Check, Finding, Flags, NotTestable, Tried
from canid.types import NAN, Array, Interval, Trace

VEHICLE = tuple(effect for effect in CATALOGUE if effect.where == "vehicle")
# What every car and every road has some of, in units of the cause's first parameter. It is in the model, as it must be
# if others are to be told, but blames nobody. Roads in rolling country have slopes of 1 to 1.5 % rms, of which ten
# minutes may show 1.8; an idling engine takes 0.05 to 0.15 m/s²; maps are bent by some per cent; intake and driveline
# are a second lag of 0.1 s, and every engine answers a little later from low load; converters slip more in low gears
ORDINARY = {
    "road_grade": 2.0,
    "engine_braking": 0.2,
    "pedal_map": 0.1,
    "actuator_lag": 0.12,
    "turbo_lag": 0.2,
    "gear_ratio": 0.03,
}
# W/kg; every engine gives no more than its power. Passenger cars are sold with 35 to 100 W per kg of their laden mass,
# so only less than that is amiss: a lorry, a trailer, limp-home
SOLD = 35.0
# s; engines follow their pedal within 0.2 to 0.6 s. Of more, this drive may not tell whose it is
SLOWEST = 0.8
# a measured slope confirms itself where the weight along it is what it must be, within so much
CONFIRMED = 0.4
# of the residual's variance, and of what the causes explained: what is left is material only above both (as `gate`)
MATERIAL, FORM = 0.02, 0.1
# of the error's variance on other parts of the drive that a named cause surely takes: a cause whose own form is a little
# off leaves a neighbour some per cent
WORTH = 0.02
# chance that a car whose model is right fails the gate
GATE = 0.005
SIGMAS = 1.96
# s of the score's memory
REACH = 5.0


class Vehicle(NamedTuple):
    """What the block says, and the cars for the closed loop."""

    findings: tuple[Finding, ...]
    tried: tuple[Tried, ...]
    not_testable: tuple[NotTestable, ...]
    checks: tuple[Check, ...]
    block: Blocked
    cars: tuple[SolvedCar, SolvedCar] | None  # without and with what was named; None: nothing could be fitted
    slope: Array  # (n,) what the car's step takes for the road's slope
    gear: Array  # (n,)
    left: Array  # (n,) m/s², measured less modelled; while braking this is the brake


def look(trace: Trace, usable: Flags, catalogue: tuple[Effect, ...] = VEHICLE) -> Vehicle:
    """Look at the car.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
        catalogue: causes that may be named.

    Returns:
        a `Vehicle`; what the drive cannot tell is said, never raised.
    """
    data = vehicle_data.prepare(trace, usable)
    if isinstance(data, str):
        return _nothing(trace, data, catalogue)
    before = vehicle_fit.baseline(data)
    if before is None:
        why = "it drives unbraked, with a person at the pedal, for less than 40 s in a row"
        return _nothing(trace, why, catalogue)
    effects = tuple(effect for effect in catalogue if _there(effect, data) == "")
    expected = {effect.id: _expected(effect, data, before) for effect in effects}
    shown = tuple(effect for effect in effects if expected[effect.id] >= needed(1, len(effects)))
    found = search_car(data, shown, before)
    gate = _gate(found, data)
    told = (
        _finding(one, found, data, passed=gate.passed is not False)
        for one in found.named
        if _matters(one, found, data)
    )
    # only what surely simulates other parts of the drive better: without this a bent map is named beside other causes
    findings = tuple(finding for finding in told if finding.gain.low > WORTH)
    return Vehicle(
        findings, _tried(found, effects, expected), _untold(data, catalogue, effects, expected),
        (*_checks(found, data), gate), _line(findings, found, gate, data),
        (_without(found, data, findings), found.solved), data.seen.slope, data.seen.gear,
        data.output.y - found.solved.fitted.model,
    )  # fmt: skip


def _without(found: CarSearch, data: VehicleData, findings: tuple[Finding, ...]) -> SolvedCar:
    """The car with what every car has, and without what was named."""
    solved = found.solved
    if not findings:
        return solved
    named = {finding.effect for finding in findings}
    pairs = zip(solved.model.effects, solved.model.where, strict=True)
    kept = [(effect, solved.fitted.q[where]) for effect, where in pairs if effect.id not in named]
    q = np.concatenate([solved.fitted.q[: len(BASE)], *(p for _, p in kept)])
    return vehicle_fit.solve(data, [effect for effect, _ in kept], q, solved.noise, solved.rows)


def _nothing(trace: Trace, why: str, catalogue: tuple[Effect, ...]) -> Vehicle:
    ids, n = tuple(effect.id for effect in catalogue), trace.t.size
    return Vehicle(
        (), (), (NotTestable(ids, why),) if ids else (), (),
        Blocked("vehicle", "not_testable", f"The car could not be looked at: {why}."), None,
        np.zeros(n), np.zeros(n), np.full(n, NAN),
    )  # fmt: skip


def _there(effect: Effect, data: VehicleData) -> str:
    """Why a cause cannot be looked for on this drive; "": it can."""
    if effect.id == "headwind":
        return f"{effect.absorbed}; to tell it: {effect.decides}"
    if effect.id == "road_grade" and data.slope_sd != data.slope_sd:
        return f"slow disturbances of the car are slope or wind, and nothing says which: {effect.decides}"
    if effect.id == "road_grade" and data.slope_sd <= vehicle_data.LEVEL:
        return "the road is level"
    if effect.id == "gear_ratio" and not data.geared:
        return f"nobody measures the gear: {effect.decides}"
    return ""


def _expected(effect: Effect, data: VehicleData, before: SolvedCar) -> float:
    """Evidence that a typical strength of a cause would leave on this drive; of a measured slope: it is there or not."""
    if effect.id == "road_grade":
        return np.inf
    p = np.array([parameter.typical for parameter in effect.parameters])
    if effect.id == "power_limit":
        # one that was there may be all that keeps this drive from showing a stronger pull: it is always looked for
        return np.inf
    d = vehicle_fit.direction(before, data, effect, p)
    return float(d @ d)


def _matters(one: NamedCause, found: CarSearch, data: VehicleData) -> bool:
    """Is it more than every car and road has, and where it was measured, what was measured?"""
    model = found.solved.model
    where = model.where[[effect.id for effect in model.effects].index(one.effect.id)]
    value = float(found.solved.fitted.q[where.start])
    sd = float(vehicle_fit.doubt(found.solved, data.output.dt)[where.start])
    if one.effect.id == "road_grade" and abs(value / data.slope_sd - 1) > CONFIRMED:
        return False
    if one.effect.id == "power_limit":
        return value + SIGMAS * sd < SOLD
    return abs(value) - SIGMAS * sd > ORDINARY.get(one.effect.id, 0.0)


def _finding(one: NamedCause, found: CarSearch, data: VehicleData, *, passed: bool) -> Finding:
    effect, model, q = one.effect, found.solved.model, found.solved.fitted.q
    where = model.where[[e.id for e in model.effects].index(effect.id)]
    sd = vehicle_fit.doubt(found.solved, data.output.dt)
    told, says = {}, effect.says
    for parameter, k in zip(effect.parameters, range(where.start, where.stop), strict=True):
        value, wide = float(q[k]), SIGMAS * float(sd[k])
        told[parameter.name] = Interval(
            value, max(value - wide, parameter.low), min(value + wide, parameter.high)
        )
        iv = told[parameter.name]
        says = says.replace("{" + parameter.name + "}", f"{iv.value:.3g} [{iv.low:.3g}, {iv.high:.3g}]")
    return Finding(
        effect=effect.id, where=effect.where, rivals=one.rivals, surrogate=not passed, parameters=told,
        units={p.name: p.unit for p in effect.parameters}, gain=_gain(one, found, data), says=says,
        evidence=one.evidence, needed=one.needed,
    )  # fmt: skip


def _gain(one: NamedCause, found: CarSearch, data: VehicleData) -> Interval:
    """What the cause gains over the model with all others, on stretches that did not fit either."""
    n, dt = data.output.y.size, data.output.dt
    fold = (np.arange(n) // round(BLOCK / dt)) % FOLDS
    with_it = found.solved
    others = [e for e in with_it.model.effects if e.id != one.effect.id]
    kept = [
        with_it.fitted.q[w]
        for e, w in zip(with_it.model.effects, with_it.model.where, strict=True)
        if e.id != one.effect.id
    ]
    q = np.concatenate([with_it.fitted.q[: len(found.before.fitted.q)], *kept])
    errors = np.full((2, n), NAN)
    for k in range(FOLDS):
        rows = with_it.rows & (fold != k)
        fits = (
            vehicle_fit.solve(data, others, q, with_it.noise, rows, turns=1),
            vehicle_fit.solve(data, with_it.model.effects, with_it.fitted.q, with_it.noise, rows, turns=1),
        )
        for row, fitted in zip(errors, fits, strict=True):
            row[fold == k] = ((data.output.y - fitted.fitted.model) ** 2)[fold == k]
    return gain(errors[0], errors[1], data.output.usable, dt)


def _gate(found: CarSearch, data: VehicleData) -> Check:
    """Does the car's residual hold anything that pedal and speed could explain?"""
    solved, dt = found.solved, data.output.dt
    fine = solved.rows

    def standard(x: Array) -> Array:
        sd = float(np.std(x[fine]))
        return np.clip((x - np.mean(x[fine])) / max(sd, 1e-9), -4, 4)

    drive = standard(accel(with_effects(()), data.seen, solved.fitted.q[:4], dt) + _drag(solved, data))
    v, t = standard(data.seen.speed), standard(data.seen.t)
    inverse = standard(1 / np.maximum(data.seen.speed, 3.0))
    columns = np.stack(
        [drive**2, drive**3, drive * v, drive * drive * v, drive * inverse, v**3, inverse, drive * t], axis=1
    )
    directions = whitened(solved.noise, columns)
    directions[~fine] = 0.0
    Q = qr(solved.fitted.jacobian, mode="economic")[0]
    directions = directions - Q @ (Q.T @ directions)
    U, s, _ = np.linalg.svd(directions, full_matrices=False)
    U = U[:, s > 0.05 * s[0]] if s[0] > 1e-9 else U[:, :0]
    e = solved.fitted.scored.e
    k = U.shape[1]
    if not k:
        return Check(
            "vehicle gate", None, NAN, GATE, "The drive moves the car too little for a gate.", gate=True
        )
    score = U.T @ e
    meat = spread(U * e[:, None], round(REACH / dt))
    # nowhere narrower than white residuals of unit variance would make it
    values, vectors = np.linalg.eigh(meat)
    meat = vectors @ np.diag(np.maximum(values, 1.0)) @ vectors.T
    statistic = float(score @ np.linalg.solve(meat, score))
    p = float(chi2.sf(statistic, k))
    share = max(float(score @ score) - float(np.trace(meat)), 0.0) / max(float(e @ e), 1e-9)
    explained = max(1 - solved.noise.sd**2 / found.before.noise.sd**2, 0.0)
    passed = not (p < GATE and share > MATERIAL and share > FORM * explained)
    says = (
        f"The car's residual holds {'nothing' if passed else 'something'} of pedal and speed that the model has not: "
        f"chance {p:.2g} over {k} directions, {100 * share:.1f} % of its variance."
    )
    return Check("vehicle gate", passed, p, GATE, says, gate=True)


def _drag(solved: SolvedCar, data: VehicleData) -> Array:
    out: Array = solved.fitted.q[ROLLING] + solved.fitted.q[DRAG] * data.seen.speed**2
    return out


def _checks(found: CarSearch, data: VehicleData) -> tuple[Check, ...]:
    use = data.output.usable
    y = data.output.y[use]
    left = float(np.var(y - found.solved.fitted.model[use])) / max(float(np.var(y)), 1e-12)
    q, sd = found.solved.fitted.q, vehicle_fit.doubt(found.solved, data.output.dt)

    def told(k: int, unit: str) -> str:
        return f"{q[k]:.3g} ± {SIGMAS * sd[k]:.2g} {unit}"

    says = (
        f"Pedal and speed explain {100 * (1 - left):.0f} % of the acceleration ({data.signal}): "
        f"{told(STRENGTH, 'm/s² per %')}, lag {told(LAG, 's')}, "
        f"rolling and slope {told(ROLLING, 'm/s²')}, drag {told(DRAG, '1/m')}."
    )
    late = (
        f"The pull follows the pedal by {told(LAG, 's')}; engines do within {SLOWEST} s. What is more is an actuator's or "
        "a charger's, and only load that changes tells which."
    )
    return (
        Check("vehicle fit", left < 0.5, 1 - left, 0.5, says),
        Check("vehicle lag", q[LAG] - SIGMAS * sd[LAG] <= SLOWEST, float(q[LAG]), SLOWEST, late, "s"),
    )


def _tried(found: CarSearch, effects: tuple[Effect, ...], expected: dict[str, float]) -> tuple[Tried, ...]:
    rivals = {rival for one in found.named for rival in one.rivals}
    seen = {step.effect.id for step in found.steps}
    out = [
        Tried(
            s.effect.id, s.effect.where, s.step, s.evidence, s.needed, expected[s.effect.id],
            "accepted" if s.accepted else "rival" if s.effect.id in rivals else "rejected",
            "" if s.accepted else "another one explained more" if s.evidence > s.needed else "chance does as much",
        )
        for s in found.steps
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


def _untold(
    data: VehicleData, catalogue: tuple[Effect, ...], effects: tuple[Effect, ...], expected: dict[str, float]
) -> tuple[NotTestable, ...]:
    out = []
    for effect in catalogue:
        why = _there(effect, data)
        if effect not in effects and why != "the road is level":
            out.append(NotTestable((effect.id,), why))
        elif effect in effects and expected[effect.id] < needed(1, len(effects)):
            why = f"a typical one would leave evidence {expected[effect.id]:.0f} on this drive; it takes {effect.decides}"
            out.append(NotTestable((effect.id,), why))
    if data.slope_sd != data.slope_sd:
        # nothing measures the slope: it and the wind are one question
        out = [one for one in out if one.effects not in (("headwind",), ("road_grade",))]
        why = (
            "slow disturbances of the car are one or the other, and nothing says which: map grade or altitude"
        )
        out.append(NotTestable(("road_grade", "headwind"), why))
    why = (
        "the car's strength, rolling and drag take up its mass, its drag area and a constant slope; "
        "they take a torque signal, a coast-down or a known mass"
    )
    out.append(NotTestable(("mass", "drag_area", "constant_grade"), why))
    return tuple(out)


def _line(findings: tuple[Finding, ...], found: CarSearch, gate: Check, data: VehicleData) -> Blocked:
    named = {finding.effect for finding in findings}
    rest = [one for one in found.named if one.effect.id not in named]
    ordinary = [_briefly(one.effect, found) for one in rest if not _matters(one, found, data)]
    unsure = [_briefly(one.effect, found) for one in rest if _matters(one, found, data)]
    usual = f" As usual, and in the model: {', '.join(ordinary)}." if ordinary else ""
    usual += f" Helps, but not surely on other parts of the drive: {', '.join(unsure)}." if unsure else ""
    if gate.passed is False:
        return Blocked("vehicle", "unexplained", gate.says + usual)
    if findings:
        return Blocked("vehicle", "wrong", " ".join(finding.says for finding in findings) + usual)
    left = found.solved.fitted.model - data.output.y
    sd = float(np.std(left[data.output.usable]))
    return Blocked("vehicle", "adequate", f"The car does what its pedal asks for, to {sd:.2g} m/s².{usual}")


def _briefly(effect: Effect, found: CarSearch) -> str:
    """A cause with its first number."""
    model = found.solved.model
    first = model.where[[e.id for e in model.effects].index(effect.id)].start
    unit = effect.parameters[0].unit
    return f"{effect.id} {found.solved.fitted.q[first]:.2g}{' ' + unit if unit != '1' else ''}"
