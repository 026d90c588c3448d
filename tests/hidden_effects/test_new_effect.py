"""A new effect is one file: registered in a catalogue, it is planted, looked for and named without any other edit."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import (
    Detector,
    Effect,
    Kind,
    MaskInput,
    Parameter,
    Params,
    PedalDynamics,
    Seen,
    SensorValues,
    Value,
    VehicleHooks,
    VehicleState,
)
from canid.models.effects.redundancy import Redundancy, Relation, excess
from canid.values.findings import Flags, Verdict
from canid.values.runs import lasting
from canid.values.types import Array
from tests.hidden_effects.planted_by_canid import Case, drive


def night(p: Params, seen: Seen) -> Value:
    """More pedal in the second third of a drive, %."""
    return p[0] * np.where((seen.t > seen.duration / 3) & (seen.t < 2 * seen.duration / 3), 1.0, 0.0)


def dragging(p: Params, state: VehicleState) -> Value:
    """A brake that drags in the first two minutes, m/s²."""
    return -p[0] * np.where(np.asarray(state.t) < 120.0, 1.0, 0.0)


def wrong_unit(p: Params, true: SensorValues) -> SensorValues:
    """Speed by a wrong factor."""
    return true._replace(speed=true.speed * (1 + p[0]))


def hands_off(drive: MaskInput) -> Flags:
    """Cruise control by its signal alone."""
    return lasting(np.nan_to_num(drive.signals["cruise_active"]) > 0.5, 5)


def switched(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Switch it on."""
    columns["cruise_active"][at] = 1.0


def freeze(p: Params, state: tuple[int, float], demand: float, dt: float) -> tuple[tuple[int, float], float]:
    """Hold the pedal for 4 s of every 30 s."""
    k, held = state
    away = (k * dt) % 30.0 > 26.0
    y = held if away else demand
    return (k + 1, y), y


# one of each type, and the effects of the catalogue that would be named for it as well
NEW: dict[str, tuple[Effect, set[str]]] = {
    "driver": (
        Effect(
            "night_pedal", "More pedal by {push} %.", "driver", Kind.PARAMETRIC,
            (Parameter("push", "%", -30.0, 30.0, (2.0, -2.0), 2.0),), (), "a test", extra=night, found_at=((6.0,),),
        ),
        {"headway_drift"},
    ),
    "vehicle": (
        Effect(
            "dragging_brake", "A brake drags by {drag} m/s².", "vehicle", Kind.PARAMETRIC,
            (Parameter("drag", "m/s²", 0.0, 2.0, (0.2,), 0.2),), ("speed",), "a test",
            vehicle=VehicleHooks(push=dragging), found_at=((0.5,),),
        ),
        set(),
    ),
    "sensing": (
        Effect(
            "wrong_unit", "The speed is wrong by {share}.", "sensing", Kind.REDUNDANCY,
            (Parameter("share", "1", -0.5, 0.5, (), 0.05),), ("gnss_speed",), "a test", sense=wrong_unit,
            redundancy=Redundancy(Relation.SPEED, excess(Relation.SPEED, 1.0)), found_at=((0.08,),),
        ),
        {"speed_scale"},
    ),
    "mask": (
        Effect(
            "hands_off", "Nobody drives.", "driver", Kind.MASK, (), ("cruise_active",), "a test", mask=hands_off,
            imitate=switched, found_at=((15.0,),),
        ),
        {"cruise_control"},
    ),
    "episodes": (
        Effect(
            "phone_calls", "{rate} times per minute for {length} s.", "driver", Kind.EPISODES,
            (Parameter("rate", "1/min", 0.0, 20.0, (), 2.0), Parameter("length", "s", 1.0, 10.0, (), 4.0)), (), "a test",
            pedal=PedalDynamics(lambda p, first: (0, first), freeze), detectors=(Detector.PEDAL_HOLDS,),
            found_at=((2.0, 4.0),),
        ),
        {"attention_gap"},
    ),
}  # fmt: skip


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("kind", NEW)
def test_a_new_effect_is_named_end_to_end(kind: str) -> None:
    """Planted by the simulator and named by `diagnose`, from a catalogue that holds it and nothing like it.

    What is tested is the way through the catalogue, not the power: one of two drives will do.
    """
    new, alike = NEW[kind]
    catalogue = (*(effect for effect in CATALOGUE if effect.id not in alike), new)
    report = diagnose(drive(Case(new, new.found_at[0], 17), catalogue), catalogue=catalogue)
    if not report.findings and not report.masked:
        report = diagnose(drive(Case(new, new.found_at[0], 18), catalogue), catalogue=catalogue)
    if new.kind is Kind.MASK:
        assert {one.effect for one in report.masked} == {new.id}
        return
    assert report.verdict in (Verdict.NAMED, Verdict.ONE_OF), report.says
    (finding,) = (finding for finding in report.findings if finding.effect == new.id)
    assert "{" not in finding.says
    assert set(finding.parameters) == {p.name for p in new.parameters}
