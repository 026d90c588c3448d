"""Every effect of the catalogue keeps the contract of `Effect`; a new one is tested by being in the list."""

from __future__ import annotations

import importlib
import io
import re
import tokenize
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.models import effects
from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.models.effects.effect import (
    DriveFeatures,
    Effect,
    Kind,
    MaskInput,
    Params,
    Seen,
    SensorValues,
    Share,
    VehicleState,
)
from canid.models.effects.redundancy import Coefficient
from canid.values.types import Interval

PACKAGE, EFFECTS = Path(canid.__file__).parent, Path(effects.__file__).parent
IDS = {effect.id for effect in (*CATALOGUE, *LANE_CATALOGUE)}
TASKS = {"": CATALOGUE, "lane ": LANE_CATALOGUE}
each = pytest.mark.parametrize(
    "effect", [pytest.param(e, id=f"{task}{e.id}") for task, of in TASKS.items() for e in of]
)

# the argument of `simulate` and its key in a truth file are older than the mask of the same name
ARGUMENTS = {("models/simulation/__init__.py", "cut_in"), ("models/simulation/following.py", "cut_in")}
# a finding of the signal checks has the name of the fault, as the effect that imitates it has
ARGUMENTS |= {
    ("signals/signal_checks/gap_and_range_rate.py", "range_rate_sign"),
    ("signals/signal_checks/gap_and_range_rate.py", "range_rate_scale"),
    ("signals/signal_checks/own_motion.py", "radar_latency"),
    ("analysis/drive/drive_parameters.py", "radar_latency"),
    ("mathematics/estimators/estimator.py", "radar_latency"),
    ("signals/signal_checks/reference_speed.py", "speed_scale"),
}
# headings of columns in people's tables are words of their own
ARGUMENTS |= {
    ("analysis/tables/headings.py", "cruise_control"),
    ("analysis/tables/headings.py", "road_grade"),
}
# modules of canid/models/effects that hold no effect
SHARED = {"effect", "operating_point", "redundancy", "slope", "wanted_gap"}


def modules() -> set[str]:
    """Modules of effects."""
    files = {path.stem for path in EFFECTS.rglob("*.py")}
    return files - SHARED - {"__init__"}


def typical(effect: Effect) -> tuple[float, ...]:
    """Parameters of the hooks in the middle of what they may be."""
    return tuple(p.typical or 0.5 * (max(p.low, -1.0) + min(p.high, 1.0)) for p in effect.parameters)


# --- the engine knows no effect ----------------------------------------------------------------------------


def test_no_effect_is_named_outside_of_the_catalogue() -> None:
    """No file of canid outside effects/ holds an effect's id as a name or in a string, or imports its module."""
    found = []
    study = PACKAGE.with_name("canid_study")
    for path in sorted([*PACKAGE.rglob("*.py"), *study.rglob("*.py")]):
        where = path.relative_to(PACKAGE if path.is_relative_to(PACKAGE) else study.parent).as_posix()
        if path.is_relative_to(EFFECTS):
            continue
        text = path.read_text(encoding="utf-8")
        # one without these words has no such token
        if IDS.isdisjoint(re.findall(r"\w+", text)):
            continue
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            # comments may name an effect; from 3.12 on the text of an f-string is a token of its own
            if token.type in (tokenize.COMMENT, tokenize.OP, tokenize.NUMBER):
                continue
            words = IDS & set(re.findall(r"\w+", token.string))
            found += [f"{where}:{token.start[0]} {w}" for w in words if (where, w) not in ARGUMENTS]
    assert not found


def test_every_effect_file_is_in_the_catalogue() -> None:
    assert modules() == IDS
    for of in TASKS.values():
        assert len({effect.id for effect in of}) == len(of)


# --- every effect ------------------------------------------------------------------------------------------


@each
def test_an_effect_is_described(effect: Effect) -> None:
    folder = "masks" if effect.kind is Kind.MASK else effect.where
    module = importlib.import_module(f"canid.models.effects.{folder}.{effect.id}")
    assert effect is (module.LANE if effect in LANE_CATALOGUE and hasattr(module, "LANE") else module.EFFECT)
    assert (module.__doc__ or "").strip().splitlines()[0].endswith((".", ")"))
    assert effect.source
    assert effect.where in ("driver", "vehicle", "sensing", "remnant")
    assert effect.decides or effect.kind is Kind.MASK
    assert effect.identifiable or effect.absorbed
    assert set(effect.rivals) <= IDS - {effect.id}


@each
def test_a_sentence_holds_parameters_and_nothing_else(effect: Effect) -> None:
    held = set(re.findall(r"\{(\w+)\}", effect.says))
    assert held <= {p.name for p in effect.parameters}
    assert held or not effect.parameters
    assert effect.says.endswith((".", ")"))


@each
def test_parameters_have_units_and_stay_within_bounds(effect: Effect) -> None:
    drive = DriveFeatures(
        600.0, np.linspace(8.0, 20.0, 99), np.linspace(5.0, 30.0, 99), np.linspace(2.0, 20.0, 99), 3.0
    )
    for p in effect.parameters:
        assert p.unit
        assert p.low < p.high
        assert p.low <= p.typical <= p.high or callable(p.initial)
        assert all(p.low <= guess <= p.high for guess in p.guesses(drive))
        assert p.guesses(drive) or effect.detectors or effect.kind is Kind.REDUNDANCY


@each
def test_an_effect_has_the_hooks_of_its_kind(effect: Effect) -> None:
    answers = (effect.headway, effect.range_rate, effect.extra, effect.gain, effect.dead_time)
    acts = any((*answers, effect.pedal, effect.vehicle, effect.lane))
    assert acts == (effect.kind not in (Kind.MASK, Kind.REDUNDANCY, Kind.REMNANT))
    assert (effect.remnant is not None) == (effect.kind is Kind.REMNANT) == (effect.where == "remnant")
    assert (effect.mask is not None) == (effect.kind is Kind.MASK)
    assert (effect.imitate is not None) == (effect.kind is Kind.MASK)
    assert (effect.redundancy is not None and effect.sense is not None) == (effect.kind is Kind.REDUNDANCY)
    assert (effect.vehicle is not None) == (effect.where == "vehicle")
    assert bool(effect.detectors) or effect.kind not in (Kind.EPISODES, Kind.RANDOM_WALK, Kind.LINE)


@each
def test_hooks_work_on_floats_and_columns_alike(effect: Effect) -> None:
    """A column's hook is its values' hooks, one by one; everything is finite."""
    rng, n = np.random.default_rng(3), 40
    seen = Seen(
        np.arange(n) * 0.1, 60.0, rng.uniform(1, 3, n), rng.normal(0, 2, n), rng.uniform(10, 60, n),
        rng.uniform(3, 30, n), rng.normal(0, 1, n),
    )  # fmt: skip
    e, p = (
        rng.normal(0, 1, n),
        effect.draw(typical(effect), 60.0, rng).params if effect.draw else typical(effect),
    )
    one = [Seen(t, 60.0, *values) for t, *values in zip(seen.t, *seen[2:], strict=True)]
    for bend in (effect.headway, effect.range_rate):
        if bend is not None:
            same(bend(p, e, seen), [bend(p, float(x), s) for x, s in zip(e, one, strict=True)])
    for term in (effect.extra, effect.gain, effect.dead_time):
        if term is not None:
            same(np.broadcast_to(term(p, seen), n), [term(p, s) for s in one])
    if effect.vehicle is not None:
        on_the_vehicle(effect, p, rng)
    if effect.lane is not None and effect.lane.offset is not None:
        same(effect.lane.offset(p, e), [effect.lane.offset(p, float(x)) for x in e])
    if effect.lane is not None and effect.lane.curvature is not None:
        add = effect.lane.curvature
        same(
            add(p, lambda ahead: 1e-3 * (e + ahead)),
            [add(p, lambda ahead, x=x: 1e-3 * (x + ahead)) for x in e],
        )
    if effect.sense is not None:
        true = SensorValues(seen.t, 60.0, seen.gap, seen.range_rate, seen.speed, np.zeros(n))
        sensed = effect.sense(p, true)
        single = [
            effect.sense(p, SensorValues(t, 60.0, *v, 0.0))
            for t, *v in zip(*true[:1], *true[2:5], strict=True)
        ]
        for k in range(2, 6):
            same(np.broadcast_to(sensed[k], n), [s[k] for s in single])


def on_the_vehicle(effect: Effect, p: Params, rng: np.random.Generator) -> None:
    assert effect.vehicle is not None
    n = 40
    columns = (
        np.arange(n) * 0.1, rng.uniform(0, 60, n), rng.uniform(3, 30, n), rng.normal(0, 1, n),
        rng.integers(1, 7, n).astype(float), rng.uniform(0, 60, n),
    )  # fmt: skip
    state, single = (
        VehicleState(*columns, 0.04),
        [VehicleState(*values, 0.04) for values in zip(*columns, strict=True)],
    )
    hook = effect.vehicle
    if hook.pedal is not None:
        same(hook.pedal(p, state.pedal), [hook.pedal(p, s.pedal) for s in single])
    if hook.thrust is not None:
        same(hook.thrust(p, state.lagged_pedal, state), [hook.thrust(p, s.lagged_pedal, s) for s in single])
    for term in (hook.lag, hook.push):
        if term is not None:
            same(np.broadcast_to(term(p, state), n), [term(p, s) for s in single])


def same(column: np.ndarray, values: list[float]) -> None:
    assert np.isfinite(column).all()
    np.testing.assert_allclose(column, values, rtol=1e-12)


@each
def test_pedal_dynamics_along_a_drive_are_its_steps(effect: Effect) -> None:
    if effect.pedal is None:
        return
    rng = np.random.default_rng(4)
    demand, dt = 15 + np.cumsum(rng.normal(0, 0.5, 300)), 0.1
    p = effect.draw(typical(effect), 30.0, rng).params if effect.draw else typical(effect)
    state, out = effect.pedal.init(p, float(demand[0])), []
    for x in demand.tolist():
        state, y = effect.pedal.step(p, state, x, dt)
        out.append(y)
    assert np.isfinite(out).all()
    # decisions between two samples are interpolated along a drive, and taken at the next sample step by step
    if effect.pedal.column is not None and not effect.intermittent:
        np.testing.assert_allclose(effect.pedal.column(p, demand, dt), out, atol=1e-6)


@each
def test_a_mask_masks_nothing_of_an_empty_or_silent_drive(effect: Effect) -> None:
    if effect.mask is None:
        return
    for n in (0, 1, 50):
        nothing = MaskInput(np.arange(n) * 0.1, 0.1, {}, np.zeros(n), True)
        flags = effect.mask(nothing)
        assert flags.shape == (n,)
        assert not flags.any()


@each
def test_a_right_coefficient_means_no_effect(effect: Effect) -> None:
    if effect.redundancy is None or effect.redundancy.recognise is None:
        return
    assert effect.redundancy.relation is not None
    nominal = 1.0 if effect.redundancy.relation.name in ("RANGE_RATE", "SPEED") else 0.0
    narrow = Interval(nominal, nominal - 1e-4, nominal + 1e-4)
    assert effect.redundancy.recognise(Coefficient(narrow, narrow)) is None


@each
def test_strengths_are_within_bounds(effect: Effect) -> None:
    top = {None: 1.0, Share.DURATION: 600.0, Share.TOP_SPEED: 30.0, Share.TOP_PEDAL: 20.0}
    for strength in (*effect.found_at, *effect.silent_at):
        if effect.kind is Kind.MASK:
            assert strength[0] > 0
            continue
        assert len(strength) == len(effect.parameters)
        for x, p in zip(strength, effect.parameters, strict=True):
            # a silent one may be less than anybody would call by the name
            assert strength in effect.silent_at or p.low <= x * top[p.share_of] <= p.high
    assert effect.identifiable or not effect.found_at
    assert effect.found_at or effect.silent_at


def test_one_effect_is_in_the_demo() -> None:
    assert sum(effect.in_demo for effect in CATALOGUE) == 1
