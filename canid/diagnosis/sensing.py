"""The sensing block: what two signals say of the same thing must agree, whoever drives.

Nothing here rests on a model of the driver or of the car. Where there is no second signal, that is said.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from canid.diagnosis import blocks, kinematics, radar_age
from canid.diagnosis.blocks import Told
from canid.diagnosis.driver_data import filled
from canid.diagnosis.masks import view
from canid.effects import (
    CATALOGUE,
    clock_skew,
    cut_in,
    radar_latency,
    range_offset,
    range_rate_scale,
    range_rate_sign,
    speed_scale,
    stale_signal,
)
from canid.effects.cause import Effect
from canid.findings import Blocked, Check, Finding, Flags, NotTestable
from canid.types import NAN, Array, Interval, Trace

# chance that any cause of this block is named on a drive without one, all tests together
FAMILY = 0.002
TESTS = 4  # scale and sign of the range rate; scale of the speed; age of the radar's reports; its drift
# less than this is what sensors are sold with, not a cause: a Doppler radar's speed is good to 1 %, a wheel's radius
# changes by 0.5 % with load and temperature, and a report of a 20 Hz radar is 25 ms old on average
SCALE, SPEED, AGE, SKEW = 0.02, 0.005, 0.03, 0.05
# s; what prediction errors make of radar noise beside that: on 24 drives without any latency their age was 0.03 too
# large on average (benchmarks' simulators), at most 0.11 +- 0.04
OLDER = 0.03
# half an interval wider than this tells nothing of an age (s): they are between 0.05 and 0.3
AGE_KNOWN, SKEW_KNOWN = 0.1, 0.15
# times the reports' own noise, and m/s: more than this between gap and range rate is a disagreement. A radar's point on the
# car ahead, and bumpers from satellites, wander by 0.25 m; over a window that is 0.1 m/s
DISAGREES, SMALL = 3.0, 0.1
# of how much the gap's change itself moves: a disagreement of less flattens no answer by more than 4 % (errors in variables)
MATERIAL = 0.2
# m/s; a gap or a range rate that moves less has nothing to be compared
MOVES = 0.05
# m/s; below it a car creeps, and radars lose their Doppler
CREEP = 2.0
NOT_MEASURED = Interval()
# standard deviations that a normal exceeds once in twenty
ONE_SIDED = 1.645
# s over which two speeds are averaged before they are compared: satellites are late by up to half a second
AVERAGED = 5.0
# m/s; what lateness may leave between two right speeds
SPEEDS_DIFFER = 0.5


class Sensing(NamedTuple):
    """What one test adds."""

    findings: tuple[Finding, ...] = ()
    not_testable: tuple[NotTestable, ...] = ()
    checks: tuple[Check, ...] = ()
    ratio: float = 1.0  # of the measured range rate to the true one


class Sensed(NamedTuple):
    """What the block says."""

    findings: tuple[Finding, ...]
    not_testable: tuple[NotTestable, ...]
    checks: tuple[Check, ...]
    block: Blocked
    tried: int  # causes that could be looked for


CAUSES = tuple(effect.id for effect in CATALOGUE if effect.where == "sensing")


def look(trace: Trace, allowed: Collection[str] = CAUSES) -> Sensed:
    """Hold the sensors against each other.

    Args:
        trace: of a drive.
        allowed: ids of the causes that may be named.

    Returns:
        findings, what this drive cannot decide, the checks that were made, and the block's line.
    """
    signals, n = trace.signals, trace.t.size
    gap = signals.get("gap_reported", signals.get("gap"))
    rate = signals.get("range_rate_reported", signals.get("range_rate"))
    speed = signals.get("speed")
    if gap is None or rate is None or speed is None or n < 2:
        return Sensed(
            (), (), (), Blocked("sensing", "not_testable", "No gap, range rate and speed to be compared."), 0
        )
    drive = view(trace)
    doubtful = np.zeros(n, dtype=bool)
    for effect in (stale_signal.EFFECT, cut_in.EFFECT):
        assert effect.mask is not None
        doubtful |= effect.mask(drive)
    # a window must not reach from one target to the next: a False between them
    doubtful[1:] |= np.diff(trace.segment) != 0
    lead = np.isfinite(gap) & np.isfinite(rate) & (speed > CREEP) & ~doubtful
    scale = _range_rate(gap, rate, lead, trace.dt)
    right = rate if not scale.findings else rate / scale.ratio
    parts = (
        scale,
        _speed(speed, signals.get("gnss_speed"), ~doubtful, trace.dt),
        _age(right, speed, signals.get("accel"), lead, trace.dt),
        _offset(),
    )
    findings = tuple(finding for part in parts for finding in part.findings if finding.effect in allowed)
    checks = tuple(check for part in parts for check in part.checks)
    untold = tuple(one for part in parts for one in part.not_testable)
    tried = sum(check.passed is not None for check in checks)
    return Sensed(findings, untold, checks, _line(findings, checks), tried)


def _line(findings: tuple[Finding, ...], checks: tuple[Check, ...]) -> Blocked:
    if findings:
        return Blocked("sensing", "wrong", " ".join(finding.says for finding in findings))
    failed = [check.says for check in checks if check.passed is False]
    if failed:
        return Blocked("sensing", "unexplained", " ".join(failed))
    if any(check.passed for check in checks):
        numbers = " ".join(check.says for check in checks if check.passed)
        return Blocked("sensing", "adequate", f"The sensors agree. {numbers}")
    return Blocked("sensing", "not_testable", "No two signals of this drive say the same thing.")


def needed(dof: int) -> float:
    """How many standard deviations chance exceeds with FAMILY / TESTS."""
    return float(student.isf(FAMILY / TESTS / 2, dof))


def _finding(
    effect: Effect,
    told: dict[str, Interval],
    z: float,
    dof: int,
    gain: Interval = NOT_MEASURED,
    rivals: tuple[str, ...] = (),
) -> Finding:
    says = effect.says
    for name, iv in told.items():
        says = says.replace("{" + name + "}", f"{iv.value:.3g} [{iv.low:.3g}, {iv.high:.3g}]")
    return Finding(
        effect=effect.id, where=effect.where, rivals=rivals, surrogate=False, parameters=told,
        units={p.name: p.unit for p in effect.parameters}, gain=gain, says=says, evidence=z * z,
        needed=needed(dof) ** 2,
    )  # fmt: skip


def _range_rate(gap: Array, rate: Array, usable: Flags, dt: float) -> Sensing:
    """Scale and sign of the range rate, by the gap's change."""
    of = kinematics.averages(gap, rate, usable, dt)
    moves = of.rate.size > 0 and min(np.std(of.rate), np.std(of.change)) > max(MOVES, 3 * of.noise)
    told = blocks.jackknife(lambda rows: kinematics.two_ways(of, rows), of.block) if moves else None
    effects = (range_rate_scale.EFFECT.id, range_rate_sign.EFFECT.id)
    seconds = blocks.FEWEST * kinematics.BLOCK
    if told is None:
        why = (
            f"the gap hardly changes, or there is too little of it: follow one lead for {seconds / 60:.0f} min, "
            "with changing gaps"
        )
        return Sensing(
            not_testable=(NotTestable(effects, why),), checks=(_not_made("range rate against gap"),)
        )
    slope, offset, steep, _ = told.value.tolist()
    left = of.rate - (offset + slope * of.change)
    disagree, limit = (
        float(np.sqrt(np.mean(left**2))),
        max(DISAGREES * of.noise, SMALL, MATERIAL * float(np.std(of.change))),
    )
    low, high = _hull(told, (0, 2), needed(told.dof))
    low95, high95 = _hull(told, (0, 2), float(student.isf(0.025, told.dof)))
    middle = 0.5 * (slope + steep)
    before = float(np.sqrt(np.mean((of.rate - of.change) ** 2)))
    check = Check(
        "range rate against gap", disagree <= limit and low <= 1 + SCALE and high >= 1 - SCALE, before, limit,
        f"Range rate and the gap's change over {kinematics.WINDOW:.0f} s differ by {before:.3f} m/s rms "
        f"(the reports' own noise explains {of.noise:.3f}); their ratio is {middle:.3f} [{low95:.3f}, {high95:.3f}].",
    )  # fmt: skip
    if disagree > limit:
        # no scale makes them agree: the two are measured by something that errs in a way of its own
        return Sensing(checks=(check,))
    width = max(float(told.sd[0]), float(told.sd[2]), 1e-9)
    held = _left_out(of, told)
    if high < 0:
        turned = [
            _finding(
                range_rate_sign.EFFECT,
                {},
                abs(middle) / width,
                told.dof,
                blocks.gain(of.rate - of.change, held, of.block),
            )
        ]
        if low > -1 + SCALE or high < -1 - SCALE:
            share = Interval(-middle - 1, -high95 - 1, -low95 - 1)
            turned.append(
                _finding(range_rate_scale.EFFECT, {"share": share}, abs(middle + 1) / width, told.dof)
            )
        return Sensing(tuple(turned), checks=(check,), ratio=middle)
    if low > 1 + SCALE or high < 1 - SCALE:
        share = Interval(middle - 1, low95 - 1, high95 - 1)
        gained = blocks.gain(of.rate - of.change, held, of.block)
        found = _finding(range_rate_scale.EFFECT, {"share": share}, abs(middle - 1) / width, told.dof, gained)
        return Sensing((found,), checks=(check,), ratio=middle)
    return Sensing(checks=(check,))


def _hull(told: Told, of: tuple[int, ...], sigmas: float) -> tuple[float, float]:
    """The interval that holds those of several estimates."""
    low = min(float(told.value[k] - sigmas * told.sd[k]) for k in of)
    high = max(float(told.value[k] + sigmas * told.sd[k]) for k in of)
    return low, high


def _left_out(of: kinematics.Averages, told: Told) -> Array:
    """Errors of the range rate once its scale is known from the other blocks."""
    _, index = np.unique(of.block, return_inverse=True)
    slope, offset = told.without[index, 0], told.without[index, 1]
    error: Array = (of.rate - offset) / slope - of.change
    return error


def _speed(speed: Array, satellite: Array | None, usable: Flags, dt: float) -> Sensing:
    """Scale of the own speed, by the satellites'."""
    effect = speed_scale.EFFECT
    name = "speed against satellites"
    if satellite is None:
        why = "absorbed by gains and headway; map gnss_speed to tell it"
        return Sensing(not_testable=(NotTestable((effect.id,), why),), checks=(_not_made(name),))
    m = round(AVERAGED / dt)
    good = usable & np.isfinite(speed) & np.isfinite(satellite) & (speed > CREEP)
    whole = good[: good.size // m * m].reshape(-1, m).all(axis=1)
    own, true = (filled(x)[: x.size // m * m].reshape(-1, m).mean(axis=1)[whole] for x in (speed, satellite))
    block = (np.flatnonzero(whole) * AVERAGED // kinematics.BLOCK).astype(np.int64)

    def ratio(rows: Flags) -> Array:
        return np.array([own[rows] @ true[rows] / max(float(true[rows] @ true[rows]), 1e-12)])

    told = blocks.jackknife(ratio, block) if own.size else None
    if told is None:
        why = f"speed and gnss_speed are there together for {own.size * AVERAGED:.0f} s only; drive 3 min or more"
        return Sensing(not_testable=(NotTestable((effect.id,), why),), checks=(_not_made(name),))
    value, sd = float(told.value[0]), float(told.sd[0])
    left = float(np.sqrt(np.mean((own - value * true) ** 2)))
    wide = needed(told.dof) * sd
    share = blocks.interval(value - 1, sd, told.dof)
    wrong = abs(value - 1) - wide > SPEED
    check = Check(
        name, left <= SPEEDS_DIFFER and not wrong, value - 1, SPEED,
        f"The own speed is {1 + share.value:.4f} [{1 + share.low:.4f}, {1 + share.high:.4f}] of the satellites'; "
        f"{left:.2f} m/s rms remain.",
    )  # fmt: skip
    if wrong and left <= SPEEDS_DIFFER:
        _, index = np.unique(block, return_inverse=True)
        gained = blocks.gain(own - true, own / told.without[index, 0] - true, block)
        found = _finding(effect, {"share": share}, abs(value - 1) / max(sd, 1e-9), told.dof, gained)
        return Sensing((found,), checks=(check,))
    return Sensing(checks=(check,))


def _age(rate: Array, speed: Array, accel: Array | None, usable: Flags, dt: float) -> Sensing:
    """How old the radar's reports are, and whether they grow older."""
    latency, skew = radar_latency.EFFECT, clock_skew.EFFECT
    names = ("age of the radar's reports", "drift of their age")
    known = usable if accel is None else usable & np.isfinite(accel)
    told = None if accel is None else radar_age.look(rate, filled(speed), filled(accel), known, dt)
    if told is None:
        why = "map accel" if accel is None else "the own motion hardly shows in the range rate"
        return Sensing(
            not_testable=(
                NotTestable((latency.id,), f"{why}; to tell it: {latency.decides}"),
                NotTestable((skew.id, *skew.rivals), f"{why}; to tell it: {skew.decides}"),
            ),
            checks=tuple(_not_made(name) for name in names),
        )
    dof = max(told.blocks - 1, 1)
    usual, strict = float(student.isf(0.025, dof)), needed(dof)
    drift = blocks.interval(told.drift.value, told.drift.sd, dof)
    # what biases the age may differ between the drive's ends, by no more than the two estimates differ
    bias = abs(told.plain.value - told.instrument.value)
    drifts = abs(told.drift.value) - strict * told.drift.sd > max(SKEW, bias)
    # where it drifts, a latency is what is left at its youngest
    youngest = -0.5 * abs(told.drift.value) if drifts else 0.0
    age = _age_interval(told, usual, youngest)
    # the precise estimate errs to the old side, the one that does not is held against it
    sure = told.plain.value + youngest - strict * told.plain.sd
    late = sure > AGE + OLDER and told.instrument.value + youngest - ONE_SIDED * told.instrument.sd > AGE
    z = max(told.plain.value + youngest, 0.0) / told.plain.sd
    # an age that may have grown from nothing is a clock's as well as a radar's
    steady = drifts or drift.high - drift.low <= 2 * SKEW_KNOWN
    first = _outcome(
        latency, names[0], "delay", age, late, z, dof, AGE, AGE_KNOWN, () if steady else (skew.id,),
        f"The radar's reports are {age.value:.3f} s [{age.low:.3f}, {age.high:.3f}] older than the own speed's.",
    )  # fmt: skip
    second = _outcome(
        skew, names[1], "rate", drift, drifts, abs(told.drift.value) / told.drift.sd, dof, SKEW, SKEW_KNOWN, (),
        f"Over the drive the age of the radar's reports changes by {drift.value:.3f} s "
        f"[{drift.low:.3f}, {drift.high:.3f}].",
    )  # fmt: skip
    return Sensing(
        first.findings + second.findings,
        first.not_testable + second.not_testable,
        first.checks + second.checks,
    )


def _outcome(
    effect: Effect,
    name: str,
    parameter: str,
    told: Interval,
    found: bool,
    z: float,
    dof: int,
    least: float,
    known: float,
    rivals: tuple[str, ...],
    says: str,
) -> Sensing:
    """A finding, a check that was passed, or why neither can be told."""
    if found:
        finding = _finding(effect, {parameter: told}, z, dof, rivals=rivals)
        return Sensing((finding,), checks=(Check(name, False, told.value, least, says),))
    # an interval that leaves the right value out, yet not surely enough for a name, is no passed check either
    if told.high - told.low <= 2 * known and told.low <= least and told.high >= -least:
        return Sensing(checks=(Check(name, True, told.value, least, says),))
    why = f"this drive tells it to {told.low:+.2f} to {told.high:+.2f} s only; to tell it: {effect.decides}"
    return Sensing(not_testable=(NotTestable((effect.id, *effect.rivals), why),), checks=(_not_made(name),))


def _age_interval(told: radar_age.Looked, sigmas: float, added: float) -> Interval:
    """An age that holds what both estimates say, each with its doubt."""
    both = (told.plain, told.instrument)
    weights = np.array([1 / max(age.sd, 1e-6) ** 2 for age in both])
    value = float(weights @ np.array([age.value for age in both]) / weights.sum())
    low = min(age.value - sigmas * age.sd for age in both)
    high = max(age.value + sigmas * age.sd for age in both)
    return Interval(value + added, low + added, high + added)


def _offset() -> Sensing:
    effect = range_offset.EFFECT
    return Sensing(
        not_testable=(
            NotTestable((effect.id, *effect.rivals), f"{effect.absorbed}; to tell it: {effect.decides}"),
        )
    )


def _not_made(name: str) -> Check:
    return Check(name, None, NAN, NAN, f"{name}: not enough to compare.")
