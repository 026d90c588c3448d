"""The driver's pedal along a given trajectory: averaged over the noise, and without an effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.plants.plant_two.driver import Touch, answering
from tests.plants.plant_two.loop import Driven
from tests.plants.plant_two.plan import STEP_S, Plan, hung, remnant_of
from tests.plants.planted_drive import Array

# effects on the pedal whose mean depends on the noise on it
NONLINEAR = {"pedal_ceiling", "backlash"}
# pairs of opposite remnants, over which the mean is taken: of what is linear they leave nothing
REMNANT_PAIRS = 3


def on_average(plan: Plan, answers: Array, remnant: Array, without: str = "") -> Array:
    """Mean pedal before its limits (n,) %: the answers through what acts on the pedal.

    Args:
        plan: of the drive.
        answers: (n,) % before the pedal effects.
        remnant: (n,) % that was there; other remnants are of the same kind and size.
        without: an effect that is left out.
    """
    acting = [effect for effect in plan.pedal_effects if effect != without]
    if not acting:
        return answers.copy()
    if not NONLINEAR & set(acting):
        return _through([p.touch for p in hung(plan, without) if p.place == "pedal"], answers)
    own = remnant_of(plan, "own")
    # how large the noise was at each sample; only state-dependent noise changes its size
    size = np.abs(np.divide(remnant, own, out=np.zeros(plan.n), where=own != 0.0))
    total = np.zeros(plan.n)
    for pair in range(REMNANT_PAIRS):
        other = size * remnant_of(plan, f"other {pair}")
        for noise in (other, -other):
            total += _through([p.touch for p in hung(plan, without) if p.place == "pedal"], answers + noise)
    return total / (2.0 * REMNANT_PAIRS)


def answers_without(plan: Plan, drive: Driven, effect: str) -> Array:
    """Answers (n,) % that the driver gives along the drive's trajectory if one effect is not there."""
    if effect in plan.pedal_effects:
        return drive.answers
    answer = answering(plan.driver, hung(plan, effect), STEP_S)
    c = drive.columns
    own = [0.0, *c["accel"][:-1].tolist()]
    instants = zip(
        c["gap"].tolist(),
        c["speed"].tolist(),
        c["range_rate"].tolist(),
        plan.lead_accel.tolist(),
        own,
        strict=True,
    )
    return np.array([answer(k, *instant) for k, instant in enumerate(instants)])


def _through(touches: Sequence[Touch], pedal: Array) -> Array:
    out = []
    for k, x in enumerate(pedal.tolist()):
        for touch in touches:
            x = touch(x, k, 0.0, 0.0, 0.0, 0.0, 0.0)
        out.append(x)
    return np.array(out)
