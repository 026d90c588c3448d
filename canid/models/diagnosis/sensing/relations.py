"""Estimates of the relations between redundant signals: one function per `Relation`, all in `RELATIONS`.

Nothing here rests on a model of the driver or of the car.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from canid.mathematics.identification.confidence import TAIL
from canid.models.diagnosis.driver.driver_data import filled
from canid.models.diagnosis.fitting import uncertainty
from canid.models.diagnosis.fitting.held_out_gain import gain
from canid.models.diagnosis.fitting.uncertainty import Jackknife
from canid.models.diagnosis.sensing import kinematics, own_motion, radar_report_age
from canid.models.effects.redundancy import TOLERANCE, Coefficient, Relation
from canid.values.findings import Check, Flags
from canid.values.types import NAN, Array, Interval

# chance that any effect of this block is named on a drive without one, all relations together
FAMILY_CHANCE = 0.002
# s; bias of the prediction-error estimate of the age by radar noise: on 24 drives without any latency it was 0.03 too
# large on average (benchmarks' simulators), at most 0.11 +- 0.04
AGE_BIAS_S = 0.03
# s; half an interval wider than this identifies no age: ages are between 0.05 and 0.3
KNOWN_WITHIN_S = {Relation.RADAR_AGE: 0.1, Relation.RADAR_AGE_DRIFT: 0.15}
# times the reports' own noise, and m/s: more than this between gap and range rate is a disagreement. A radar's point on
# the car ahead, and bumpers from satellites, move by 0.25 m; over a window that is 0.1 m/s
NOISE_FACTOR, MIN_DISAGREEMENT = 3.0, 0.1
# of the standard deviation of the gap's change: a disagreement of less flattens no answer by more than 4 % (errors in
# variables)
MATERIAL_SHARE = 0.2
# m/s; a gap or a range rate that moves less has nothing to be compared
MIN_MOVEMENT = 0.05
# m/s; below it a car creeps, and radars lose their Doppler signal
CREEP_SPEED = 2.0
# standard deviations to either side that hold 99 %: a signal is not blamed, and corrected, by less
OWN_MOTION_SIGMAS = 2.58
# standard deviations that a normal exceeds once in twenty
ONE_SIDED_95 = 1.645
# s over which two speeds are averaged before they are compared: satellites are late by up to half a second
AVERAGING_S = 5.0
# m/s rms; what lateness may leave between two right speeds
MAX_SPEED_DIFFERENCE = 0.5


class SensorColumns(NamedTuple):
    """Columns (n,) of the signals that are compared."""

    gap: Array  # m, as reported
    range_rate: Array  # m/s, as reported
    speed: Array  # m/s
    gnss_speed: Array | None  # m/s
    accel: Array | None  # m/s²
    valid: Flags  # not frozen, and within one segment: a False between two leads
    dt: float  # s
    scaled: bool = True  # is it known which of gap and range rate has the right scale?

    @property
    def lead(self) -> Flags:
        """Where gap and range rate of one lead are measured."""
        known = np.isfinite(self.gap) & np.isfinite(self.range_rate)
        return known & (self.speed > CREEP_SPEED) & self.valid


class Related(NamedTuple):
    """One relation on one drive."""

    relation: Relation
    check: Check
    coefficient: Coefficient | None = None  # None: not estimated, or no coefficient makes the signals agree
    sd: float = NAN  # of the coefficient
    dof: int = 1
    gain: Interval = (
        Interval()
    )  # relative reduction of the error's variance by a right coefficient, on held-out blocks
    confounded: tuple[Relation, ...] = ()  # relations whose effects would show the same here
    not_testable: str = ""  # why this drive does not identify the coefficient


def critical_value(dof: int) -> float:
    """Standard deviations that chance exceeds in none of the relations with 1 − `FAMILY_CHANCE`."""
    return float(student.isf(FAMILY_CHANCE / len(Relation) / 2, dof))


def range_rate_against_gap(columns: SensorColumns) -> tuple[Related, ...]:
    """Ratio of the range rate to the gap's change, by regression both ways."""
    relation, tolerance = Relation.RANGE_RATE, TOLERANCE[Relation.RANGE_RATE]
    averages = kinematics.averages(columns.gap, columns.range_rate, columns.lead, columns.dt)
    moves = averages.rate.size > 0 and min(np.std(averages.rate), np.std(averages.change)) > max(
        MIN_MOVEMENT, 3 * averages.noise
    )
    fit = (
        uncertainty.jackknife(lambda rows: kinematics.two_ways(averages, rows), averages.block)
        if moves
        else None
    )
    if fit is None:
        seconds = uncertainty.MIN_BLOCKS * kinematics.BLOCK_S
        why = (
            f"the gap hardly changes, or there is too little of it: follow one lead for {seconds / 60:.0f} min, "
            "with changing gaps"
        )
        return (_unmade(relation, why),)
    slope, offset, steep, _ = fit.value.tolist()
    residual = averages.rate - (offset + slope * averages.change)
    disagreement = float(np.sqrt(np.mean(residual**2)))
    limit = max(
        NOISE_FACTOR * averages.noise, MIN_DISAGREEMENT, MATERIAL_SHARE * float(np.std(averages.change))
    )
    low, high = _hull(fit, (0, 2), critical_value(fit.dof))
    low95, high95 = _hull(fit, (0, 2), float(student.isf(TAIL, fit.dof)))
    middle = 0.5 * (slope + steep)
    wrong = not (low <= 1 + tolerance and high >= 1 - tolerance)
    before = float(np.sqrt(np.mean((averages.rate - averages.change) ** 2)))
    check = Check(
        relation.value, disagreement <= limit and not wrong, before, limit,
        f"Range rate and the gap's change over {kinematics.WINDOW_S:.0f} s differ by {before:.3f} m/s rms "
        f"(the reports' own noise explains {averages.noise:.3f} m/s); their ratio is {middle:.3f} "
        f"[{low95:.3f}, {high95:.3f}].",
        "m/s",
    )  # fmt: skip
    if disagreement > limit:
        # no scale makes them agree: one of the two has an error of its own
        return (Related(relation, check),)
    gained = (
        _gain(averages.rate - averages.change, _held_out(averages, fit), averages.block)
        if wrong
        else Interval()
    )
    own_factor = _own_motion(columns, middle) if wrong else Interval()
    coefficient = Coefficient(Interval(middle, low95, high95), Interval(middle, low, high), own_factor)
    width = max(float(fit.sd[0]), float(fit.sd[2]), 1e-9)
    return (Related(relation, check, coefficient, width, fit.dof, gained),)


def _own_motion(columns: SensorColumns, ratio: float) -> Interval:
    """Factor, −1 apart, of the own motion in the range rate, turned to the gap's sign; NaN: not known."""
    accel = columns.accel
    if accel is None:
        return Interval()
    rate, known = columns.range_rate * np.sign(ratio), columns.lead & np.isfinite(accel)
    # halfway between what either of the two signals would be wrong by
    begin = float(np.sqrt(abs(ratio)))
    factor = own_motion.coefficient(
        rate, filled(columns.speed), filled(accel), known, columns.dt, begin, OWN_MOTION_SIGMAS
    )
    return Interval() if factor is None else factor


def _hull(fit: Jackknife, which: tuple[int, ...], sigmas: float) -> tuple[float, float]:
    """Smallest interval that contains those of several estimates."""
    low = min(float(fit.value[k] - sigmas * fit.sd[k]) for k in which)
    high = max(float(fit.value[k] + sigmas * fit.sd[k]) for k in which)
    return low, high


def _gain(before: Array, after: Array, block: npt.NDArray[np.int64]) -> Interval:
    """Relative reduction of squared errors (n,) on blocks that did not fit them."""
    return gain(before**2, after**2, block, uncertainty.MIN_BLOCKS)


def _held_out(averages: kinematics.Averages, fit: Jackknife) -> Array:
    """Errors of the range rate once its scale is known from the other blocks."""
    _, index = np.unique(averages.block, return_inverse=True)
    slope, offset = fit.without[index, 0], fit.without[index, 1]
    error: Array = (averages.rate - offset) / slope - averages.change
    return error


def speed_against_gnss(columns: SensorColumns) -> tuple[Related, ...]:
    """Ratio of the own speed to the speed by GNSS."""
    relation, tolerance = Relation.SPEED, TOLERANCE[Relation.SPEED]
    if columns.gnss_speed is None:
        return (_unmade(relation, "gains and headway take it up, and no `gnss_speed` is mapped"),)
    satellite, m = columns.gnss_speed, round(AVERAGING_S / columns.dt)
    good = columns.valid & np.isfinite(columns.speed) & np.isfinite(satellite) & (columns.speed > CREEP_SPEED)
    whole = good[: good.size // m * m].reshape(-1, m).all(axis=1)
    own_speed, true = (
        filled(x)[: x.size // m * m].reshape(-1, m).mean(axis=1)[whole] for x in (columns.speed, satellite)
    )
    block = (np.flatnonzero(whole) * AVERAGING_S // kinematics.BLOCK_S).astype(np.int64)

    def ratio(rows: Flags) -> Array:
        return np.array([own_speed[rows] @ true[rows] / max(float(true[rows] @ true[rows]), 1e-12)])

    fit = uncertainty.jackknife(ratio, block) if own_speed.size else None
    if fit is None:
        why = f"speed and GNSS speed are there together for {own_speed.size * AVERAGING_S:.0f} s only; drive 3 min or more"
        return (_unmade(relation, why),)
    value, sd = float(fit.value[0]), float(fit.sd[0])
    left = float(np.sqrt(np.mean((own_speed - value * true) ** 2)))
    share = uncertainty.interval(value - 1, sd, fit.dof)
    wide = critical_value(fit.dof) * sd
    wrong = abs(value - 1) - wide > tolerance
    check = Check(
        relation.value, left <= MAX_SPEED_DIFFERENCE and not wrong, value - 1, tolerance,
        f"The own speed is {1 + share.value:.4f} [{1 + share.low:.4f}, {1 + share.high:.4f}] of the satellites'; "
        f"{left:.2f} m/s rms remain.",
    )  # fmt: skip
    if left > MAX_SPEED_DIFFERENCE:
        return (Related(relation, check),)
    gained = Interval()
    if wrong:
        _, index = np.unique(block, return_inverse=True)
        gained = _gain(own_speed - true, own_speed / fit.without[index, 0] - true, block)
    estimate = Interval(1 + share.value, 1 + share.low, 1 + share.high)
    coefficient = Coefficient(estimate, Interval(value, value - wide, value + wide))
    return (Related(relation, check, coefficient, max(sd, 1e-9), fit.dof, gained),)


def age_of_radar(columns: SensorColumns) -> tuple[Related, ...]:
    """Age of the radar's reports, and its change over the drive."""
    latency, skew = Relation.RADAR_AGE, Relation.RADAR_AGE_DRIFT
    rate, accel, usable = columns.range_rate, columns.accel, columns.lead
    ages = None
    if accel is not None and columns.scaled:
        known = usable & np.isfinite(accel)
        ages = radar_report_age.estimate_age(rate, filled(columns.speed), filled(accel), known, columns.dt)
    if ages is None:
        why = "map accel" if accel is None else "the own motion hardly shows in the range rate"
        if not columns.scaled:
            why = "whether the gap or the range rate has the wrong scale is not known"
        return _unmade(latency, why), _unmade(skew, why)
    dof = max(ages.blocks - 1, 1)
    usual, strict = float(student.isf(TAIL, dof)), critical_value(dof)
    drift = uncertainty.interval(ages.drift.value, ages.drift.sd, dof)
    # the bias of the age may differ between the drive's ends, by no more than the two estimates differ
    bias = max(abs(ages.plain.value - ages.instrument.value) - TOLERANCE[skew], 0.0)
    wide = strict * ages.drift.sd + bias
    sure_drift = Interval(ages.drift.value, ages.drift.value - wide, ages.drift.value + wide)
    drifts = max(sure_drift.low, -sure_drift.high) > TOLERANCE[skew]
    # where the age drifts, a latency is the smallest age
    youngest = -0.5 * abs(ages.drift.value) if drifts else 0.0
    age = _age_interval(ages, usual, youngest)
    # the precise estimate errs towards old ages, so the other one must confirm it
    plain, instrument = ages.plain.value + youngest, ages.instrument.value + youngest
    sure = min(plain - strict * ages.plain.sd - AGE_BIAS_S, instrument - ONE_SIDED_95 * ages.instrument.sd)
    sure_age = Interval(max(plain, 0.0), sure, np.inf)
    # an age that may have grown from nothing is a clock's as well as a radar's
    steady = drifts or drift.high - drift.low <= 2 * KNOWN_WITHIN_S[skew]
    return (
        _of_age(
            latency, Coefficient(age, sure_age), ages.plain.sd, dof, () if steady else (skew,),
            f"The radar's reports are {age.value:.3f} s [{age.low:.3f}, {age.high:.3f}] older than the own speed's.",
        ),
        _of_age(
            skew, Coefficient(drift, sure_drift), ages.drift.sd, dof, (),
            f"Over the drive the age of the radar's reports changes by {drift.value:.3f} s "
            f"[{drift.low:.3f}, {drift.high:.3f}].",
        ),
    )  # fmt: skip


def _of_age(
    relation: Relation, age: Coefficient, sd: float, dof: int, confounded: tuple[Relation, ...], says: str
) -> Related:
    """A wrong age, a passed check, or why the drive identifies neither."""
    estimate, tolerance, known = age.estimate, TOLERANCE[relation], KNOWN_WITHIN_S[relation]
    if max(age.sure.low, -age.sure.high) > tolerance:
        check = Check(relation.value, False, estimate.value, tolerance, says, "s")
        return Related(relation, check, age, sd, dof, confounded=confounded)
    # an interval without the right value, yet not surely enough for a name, is no passed check either
    if (
        estimate.high - estimate.low <= 2 * known
        and -tolerance <= estimate.high
        and estimate.low <= tolerance
    ):
        return Related(
            relation, Check(relation.value, True, estimate.value, tolerance, says, "s"), age, sd, dof
        )
    why = f"this drive shows only that it is between {estimate.low:+.2f} and {estimate.high:+.2f} s"
    return _unmade(relation, why)


def _age_interval(ages: radar_report_age.AgeEstimates, sigmas: float, added: float) -> Interval:
    """An age whose interval contains those of both estimates."""
    both = (ages.plain, ages.instrument)
    weights = np.array([1 / max(age.sd, 1e-6) ** 2 for age in both])
    value = float(weights @ np.array([age.value for age in both]) / weights.sum())
    low = min(age.value - sigmas * age.sd for age in both)
    high = max(age.value + sigmas * age.sd for age in both)
    return Interval(value + added, low + added, high + added)


def _unmade(relation: Relation, why: str) -> Related:
    """A relation that this drive does not identify."""
    check = Check(relation.value, None, NAN, NAN, f"{relation.value}: not enough to compare.")
    return Related(relation, check, not_testable=why)


# in the order of the report; the range rate comes first, as a wrong one is corrected before its age is estimated
RELATIONS: tuple[Callable[[SensorColumns], tuple[Related, ...]], ...] = (
    range_rate_against_gap,
    speed_against_gnss,
    age_of_radar,
)
