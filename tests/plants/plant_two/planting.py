"""One call: effects in, a drive with its truth out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tests.plants.plant_two.loop import driven
from tests.plants.plant_two.plan import IN_DRIVER, STEP_S, planned
from tests.plants.plant_two.replay import answers_without, on_average
from tests.plants.planted_drive import Planted


def plant(
    effects: Mapping[str, Mapping[str, float]],
    *,
    seed: int,
    minutes: float,
    noise: str,
    profile: str,
    **changes: Any,
) -> Planted:
    """Plant effects into one simulated drive; see `planted.Plant`.

    `demand` is what the driver gives on average over the noise. That is what the driver would give without noise, but for
    a ceiling and for backlash, which noise rounds off. Sensing effects and stale signals change nothing here: they
    are drawn and stored in `truth`, for the sensors.

    Args:
        effects: id -> {parameter: value}; parameters that are not given are drawn.
        seed: of everything that is drawn.
        minutes: how long.
        noise: one of `planted.NOISES`.
        profile: one of `planted.PROFILES`.
        changes: fields of `Driver` (the common lag also as tau1 or tau2) and of `Car` that are not to be drawn.

    Returns:
        The drive at 100 Hz, with `without` for every effect that sits in the driver.

    Raises:
        ValueError: an effect, parameter, noise, profile or change that this simulator does not know.

    >>> drive = plant({"speed_gain": {"exponent": 1.0}}, seed=1, minutes=0.2, noise="ar1", profile="mixed")
    >>> drive.truth["effects"], drive.demand.shape, sorted(drive.without)
    ({'speed_gain': {'exponent': 1.0}}, (1200,), ['speed_gain'])
    """
    plan = planned(effects, seed, minutes, noise, profile, changes)
    drive = driven(plan)
    demand = on_average(plan, drive.answers, drive.remnant)
    without = {
        effect: on_average(plan, answers_without(plan, drive, effect), drive.remnant, effect)
        for effect in plan.effects
        if effect in IN_DRIVER
    }
    truth = {
        "simulator": "two",
        "seed": seed,
        "profile": profile,
        "noise": noise,
        "minutes": minutes,
        "driver": plan.driver.truth(),
        "car": plan.car._asdict(),
        "effects": plan.effects,
        "episodes": plan.episodes,
    }
    return Planted(STEP_S, drive.columns, demand, drive.remnant, truth, without)
