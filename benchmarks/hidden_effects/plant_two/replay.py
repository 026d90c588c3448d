"""What the driver gives along a trajectory that is there already: on average over his noise, and without an effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.hidden_effects.plant_two.driver import Touch, answering
from benchmarks.hidden_effects.plant_two.loop import Driven
from benchmarks.hidden_effects.plant_two.plan import STEP, Plan, hung, remnant_of
from benchmarks.hidden_effects.planted import Array

# effects on the pedal whose mean depends on the noise on it
BENT = {"pedal_ceiling", "backlash"}
# pairs of opposite remnants, over which the mean is taken: of what is linear they leave nothing
PAIRS = 3


def on_average(plan: Plan, answers: Array, remnant: Array, without: str = "") -> Array:
    """Mean pedal before its limits (n,) %: the answers through what acts on the foot.

    Args:
        plan: of the drive.
        answers: (n,) % in front of the foot.
        remnant: (n,) % that was there; other remnants are of the same kind and size.
        without: an effect that is left out.
    """
    foot = [effect for effect in plan.foot if effect != without]
    if not foot:
        return answers.copy()
    if not BENT & set(foot):
        return _through([p.touch for p in hung(plan, without) if p.place == "foot"], answers)
    own = remnant_of(plan, "own")
    # how large the noise was at each sample; only state-dependent noise changes its size
    size = np.abs(np.divide(remnant, own, out=np.zeros(plan.n), where=own != 0.0))
    total = np.zeros(plan.n)
    for pair in range(PAIRS):
        other = size * remnant_of(plan, f"other {pair}")
        for noise in (other, -other):
            total += _through([p.touch for p in hung(plan, without) if p.place == "foot"], answers + noise)
    return total / (2.0 * PAIRS)


def answers_without(plan: Plan, drive: Driven, effect: str) -> Array:
    """Answers (n,) % that the driver gives along the drive's trajectory if one effect is not there."""
    if effect in plan.foot:
        return drive.answers
    answer = answering(plan.driver, hung(plan, effect), STEP)
    c = drive.columns
    own = [0.0, *c["accel"][:-1].tolist()]
    moments = zip(
        c["gap"].tolist(),
        c["speed"].tolist(),
        c["range_rate"].tolist(),
        plan.lead_accel.tolist(),
        own,
        strict=True,
    )
    return np.array([answer(k, *moment) for k, moment in enumerate(moments)])


def _through(foot: Sequence[Touch], pedal: Array) -> Array:
    out = []
    for k, x in enumerate(pedal.tolist()):
        for touch in foot:
            x = touch(x, k, 0.0, 0.0, 0.0, 0.0, 0.0)
        out.append(x)
    return np.array(out)
