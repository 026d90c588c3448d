"""A model fitted to one drive and judged behind another lead, with the published ones."""

from __future__ import annotations

import math

from benchmarks.other_drive import BASELINE, CHOSEN, best_rival, carried, chosen, prepared, summary
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.rivals.rival_models import MODELS
from canid.values.types import Trace
from tests.plants import plant_one
from tests.plants.measurement import trace
from tests.seeds import mostly


def accelerating(seed: int, profile: str) -> Trace:
    """A planted drive whose output is the acceleration."""
    seen = trace(plant_one.plant({}, seed=seed, minutes=6, noise="white", profile=profile))
    signals = {role: x for role, x in seen.signals.items() if role not in ("pedal", "brake")}
    return seen._replace(output=seen.signals["accel"], signals=signals)


@mostly(0.95)
def test_models_are_carried_to_another_drive(seed: int) -> None:
    here, there = accelerating(seed, "motorway"), accelerating(seed + 1, "mixed")
    one, other = prepared(here), prepared(there)
    assert one is not None
    assert other is not None
    model = chosen(one, diagnose(here))
    errors = carried(one, other, {BASELINE: one.fitted, CHOSEN: model})
    assert list(errors) == [BASELINE, CHOSEN, *(rival.name for rival in MODELS)]
    assert all(0 < x < 2 and math.isfinite(x) for error in errors.values() for x in error)
    if not model.model.effects:
        assert errors[CHOSEN] == errors[BASELINE]
    best = best_rival(errors)
    assert best.gap == min(errors[rival.name].gap for rival in MODELS)
    lines = summary([errors, errors])
    assert (
        lines[-1]
        == f"| best rival | {best.gap:.3f} | {best.gap:.3f} | {best.speed:.3f} | {best.speed:.3f} | 100 % (2) | 100 % (2) |"
    )
