"""A range rate that saturates, or bends near 0, is found by the gap, and nothing else that sensors do is taken for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from canid.analysis.tables.arrays import from_arrays
from canid.signals.signal_checks.drive_time import usable
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.types import Trace
from tests import seeds
from tests.plants.outside_drives import drawn_drive
from tests.plants.quoted_intervals import trace
from tests.signal_checks.synthetic import DT, Array, Columns, following

ROLES = ("pedal", "speed", "gap", "range_rate", "accel")
NAME, BENT = "range_rate_saturated", "range_rate_nonlinear"


def columns(seed: int, minutes: float = 8.0) -> Columns:
    """A drive."""
    whole = following(seed, minutes)
    return {role: whole[role] for role in ROLES}


def read(given: Columns) -> Trace:
    """What canid makes of it."""
    time = DT * np.arange(len(given["gap"]))
    return from_arrays(time=time, output="pedal", units={"accel": "m/s2"}, **given)


def lagged(x: Array, tau: float) -> Array:
    """First order."""
    out, value, keep = np.empty(len(x)), float(x[0]), np.exp(-DT / tau)
    for k, each in enumerate(x.tolist()):
        value = keep * value + (1.0 - keep) * each
        out[k] = value
    return out


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize("sides", [(True, True), (True, False), (False, True)])
@seeds.mostly(0.9)
def test_a_limit_behind_a_filter_is_found_by_the_gap(sides: tuple[bool, bool], seed: int) -> None:
    """Its extreme is reached by hardly a reading, so that no value is a limit: nothing of the drive is learned from."""
    given = columns(seed)
    rng = np.random.default_rng(seed)
    low, high = np.quantile(given["range_rate"], (0.12, 0.88))
    cut = np.clip(given["range_rate"], low if sides[0] else -99.0, high if sides[1] else 99.0)
    given["range_rate"] = lagged(cut, rng.uniform(0.1, 0.4)) + 0.002 * rng.standard_normal(len(cut))
    trace = read(given)
    assert NAME in {finding.name for finding in trace.findings if finding.withholds}
    assert not usable(with_limits(trace)).any()


# a filter of 0.25 to 0.4 s on 49 of 60 drives: on the others the gap did not show for certain that the rest saturates
@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize("filtered", [True, False])
@seeds.mostly(0.75)
def test_a_limit_that_its_readings_show_does_not_excuse_the_others(filtered: bool, seed: int) -> None:
    """Behind a filter some readings stand at the limit, all others near it say too little; without one they are sound."""
    given = columns(seed, 6.0)
    rng = np.random.default_rng(seed)
    low, high = np.quantile(given["range_rate"], (0.12, 0.88))
    cut = np.clip(given["range_rate"], low, high)
    given["range_rate"] = np.round(lagged(cut, rng.uniform(0.25, 0.4)) if filtered else cut, 3)
    trace = read(given)
    assert {"range_rate_limited", "range_rate_limited_below", "range_rate_limited_above", NAME} & {
        finding.name for finding in trace.findings if finding.withholds
    }
    assert usable(with_limits(trace)).any() != filtered


def delayed(x: Array) -> Array:
    """A quarter of a second later."""
    return np.concatenate([x[:5], x[:-5]])


def in_steps(x: Array) -> Array:
    """Half a standard deviation each."""
    step = 0.5 * float(np.std(x))
    return np.round(x / step) * step


def noisy(x: Array) -> Array:
    """Half a standard deviation of noise."""
    return x + 0.5 * float(np.std(x)) * np.random.default_rng(1).standard_normal(len(x))


OTHERS: dict[str, Callable[[Array], Array]] = {
    "as it is": lambda x: x,
    "lag": lambda x: lagged(x, 0.4),
    "delay": delayed,
    "scale": lambda x: 1.3 * x,
    "steps": in_steps,
    "noise": noisy,
}


@pytest.mark.parametrize("role", ["gap", "range_rate"])
@pytest.mark.parametrize(
    "kind",
    [
        name if name in ("steps", "noise") else pytest.param(name, marks=pytest.mark.slow("six drives"))
        for name in OTHERS
    ],
)
def test_what_is_no_limit_is_not_called_one(kind: str, role: str, seed: int) -> None:
    """A drive as it is, and one with a lag, a delay, a scale, steps or much noise in either signal."""
    given = columns(seed)
    found = read(given | {role: OTHERS[kind](given[role])}).findings
    assert not {NAME, BENT} & {finding.name for finding in found}


# of a range rate that moves by some 1 m/s
NEAR_0: dict[str, Callable[[Array], Array]] = {
    "dead zone": lambda x: x - np.clip(x, -0.15, 0.15),
    "sign lost": lambda x: np.where(np.abs(x) < 0.3, np.abs(x), x),
    "other sign lost": lambda x: np.where(np.abs(x) < 0.3, -np.abs(x), x),
    "rounded towards 0": lambda x: 0.25 * np.trunc(4.0 * x),
}


@pytest.mark.parametrize("kind", NEAR_0)
@seeds.mostly(0.9)
def test_a_range_rate_that_bends_near_0_teaches_nothing(kind: str, seed: int) -> None:
    """In steps of its own, with holes where a target is lost."""
    given, rng = columns(seed), np.random.default_rng(seed)
    rate = given["range_rate"] / float(np.std(given["range_rate"]))
    gap = 40.0 + (given["gap"] - 40.0) / float(np.std(given["range_rate"]))
    lost = int(rng.uniform(0.0, len(rate) - 100.0))
    gone = slice(lost, lost + 50)
    rate = NEAR_0[kind](rate)
    rate[gone] = gap[gone] = np.nan
    trace = read(given | {"range_rate": rate, "gap": gap})
    assert BENT in {finding.name for finding in trace.findings if finding.withholds}
    assert not usable(with_limits(trace)).any()


@pytest.mark.long("takes a whole drive")
def test_a_sign_that_most_range_rates_lose_is_a_bend() -> None:
    """Up to 0.5 m/s, behind a calm lead: no term up to the median shows it."""
    drive = drawn_drive("acceleration", 1545001, dt=0.1)
    rate = drive.columns["range_rate"]
    lost = drive._replace(
        columns={**drive.columns, "range_rate": np.where(np.abs(rate) < 0.5, np.abs(rate), rate)}
    )
    assert BENT in {each.name for each in trace(lost).findings}
    assert not trace(drive).findings


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize(("low", "high"), [(-0.6, 0.6), (-np.inf, 0.6)])
@seeds.mostly(0.8)
def test_a_limit_that_a_coarse_and_calm_range_rate_reaches_now_and_then_is_found(
    low: float, high: float, seed: int
) -> None:
    """In steps of 0.1 m/s no stay shows with which slope it began, and the range rate stands there at its extreme."""
    given = columns(seed, 5.0)
    calm = 0.35 / float(np.std(given["range_rate"]))
    given["gap"] = 40.0 + calm * (given["gap"] - 40.0)
    given["range_rate"] = np.round(np.clip(calm * given["range_rate"], low, high), 1)
    names = {finding.name for finding in read(given).findings if finding.withholds}
    assert names & {NAME, "range_rate_limited", "range_rate_limited_below", "range_rate_limited_above"}
