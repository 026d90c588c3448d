"""A cause that is hidden in a drive is found from its log alone; a clean drive stays unblamed; weak data get no name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose
from canid.values.findings import Verdict, extends
from canid.values.types import NAN, LearnGate, Trace
from tests import seeds
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}


def in_turn(purpose: str, cases: list[tuple[Any, ...]]) -> list[Any]:
    """Half of the cases, each with one of the two simulators; all with both where CANID_ALL_CASES is set."""
    chosen = [tuple(PLANTS) if seeds.ALL_CASES else (("one", "two")[k % 2],) for k in range(len(cases))]
    found = [(name, *case) for case, names in zip(cases, chosen, strict=True) for name in names]
    return seeds.in_turn(found, 2, purpose)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "noise", "profile"),
    in_turn("clean", [("ar1", "mixed"), ("resonant", "motorway"), ("state", "urban"), ("ar4", "mixed")]),
)
def test_a_clean_drive_is_not_blamed(simulator: str, noise: str, profile: str) -> None:
    report = diagnose(trace(PLANTS[simulator]({}, seed=71, minutes=8, noise=noise, profile=profile)))
    if noise == "state":
        # its scale follows the response in another form than the noise model: the remnant may be named, the mean not
        assert not extends(report)
        assert all(block.state != "unexplained" for block in report.blocks)
        return
    assert report.verdict is Verdict.ADEQUATE
    assert not report.findings


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "strength", "noise", "profile"),
    in_turn(
        "hidden",
        [
            ("relative_speed_dead_zone", {"width": 0.9}, "ar1", "mixed"),
            ("looming_gain", {"exponent": 0.9}, "white", "urban"),
            ("gain_change", {"share": 0.45, "time": 250.0}, "mix", "mixed"),
            ("attention_gap", {"per_minute": 1.5, "duration": 3.5}, "ar4", "mixed"),
            ("pedal_ceiling", {}, "state", "mixed"),
            ("act_and_wait", {"interval": 1.3}, "ar1", "mixed"),
            ("periodic_task", {"amplitude": 2.5, "frequency": 0.21}, "white", "mixed"),
            ("headway_dead_zone", {"width": 0.6}, "ar1", "mixed"),
        ],
    ),
)
def test_a_hidden_cause_is_named(
    simulator: str, effect: str, strength: dict[str, float], noise: str, profile: str
) -> None:
    report = diagnose(
        trace(PLANTS[simulator]({effect: strength}, seed=83, minutes=10, noise=noise, profile=profile))
    )
    assert report.verdict in (Verdict.NAMED, Verdict.ONE_OF), report.says
    assert any(effect in (finding.effect, *finding.rivals) for finding in report.findings), report.says
    assert all(np.isfinite([iv.low, iv.high]).all() for f in report.findings for iv in f.parameters.values())


def drive(n: int = 3000, **columns: np.ndarray) -> Trace:
    """A drive without anything in it, but for what is given."""
    t = 0.1 * np.arange(n)
    rng = np.random.default_rng(1)
    signals = {
        "pedal": 10 + rng.normal(size=n),
        "speed": np.full(n, 20.0),
        "gap": 40 + np.sin(t / 7),
        "range_rate": np.sin(t / 7),
    } | columns
    inputs = np.stack([signals["gap"] / signals["speed"] - 2.0, signals["range_rate"]], axis=1)
    gates = tuple(LearnGate.OPEN for _ in range(n))
    return Trace(
        0.1, t, signals["pedal"], inputs, ("headway_error", "range_rate"), gates, np.ones(n, bool), np.zeros(n, np.int64),
        signals,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("weak", "missing"),
    [
        (drive(300), "lasts 30 s"),
        (drive(0), "lasts 0 s"),
        (drive(pedal=np.full(3000, 12.0)), "never moves"),
        (drive(range_rate=np.zeros(3000)), "never changes"),
        (drive(gap=np.full(3000, NAN)), "no lead"),
        (drive(speed=np.full(3000, NAN)), "no speed"),
        (drive(pedal=np.full(3000, NAN)), "output"),
        (drive(cruise_active=np.ones(3000)), "cruise_control"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_weak_data_get_no_name_but_what_is_missing(weak: Trace, missing: str) -> None:
    report = diagnose(weak)
    assert report.verdict is Verdict.NOT_ENOUGH_DATA
    assert missing in report.says
    assert not report.findings


def test_noise_alone_explains_nothing() -> None:
    """Inputs that the output does not answer: never a name."""
    report = diagnose(drive())
    assert report.verdict in (Verdict.ADEQUATE, Verdict.NOT_ENOUGH_DATA), report.says
