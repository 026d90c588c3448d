"""Several drives of one driver become one: weighted by what each drive knows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.analysis.sumo.pooled_driver import pooled
from canid.analysis.sumo.sumo_models import MODELS
from tests.seeds import mostly
from tests.sumo.planted_models import X, drive


def test_one_drive_is_itself() -> None:
    one = drive(X, 0.001)
    found = pooled("a", [one])
    assert found.parameters == one.model.chosen.parameters
    assert not found.spread


def test_equal_drives_have_their_mean_and_less_error() -> None:
    one = pooled("a", [drive(X, 0.001)] * 2)
    four = pooled("a", [drive(X, 0.001)] * 8)
    for name, x in pooled("a", [drive(X, 0.001)]).parameters.items():
        assert one.parameters[name].value == pytest.approx(x.value)
    assert (
        four.parameters["T"].high - four.parameters["T"].low
        < one.parameters["T"].high - one.parameters["T"].low
    )
    assert all(x == 0.0 for x in one.spread.values())


def test_what_a_drive_does_not_show_has_no_say() -> None:
    """A parameter at the end of its range with infinite variance next to one that is known."""
    sure = drive(X, 1e-5)
    blind = drive(np.where(np.arange(5) == 2, 0.0, X), np.where(np.arange(5) == 2, math.inf, 1e-5))
    found = pooled("a", [sure, blind])
    assert found.parameters["s0"].value == pytest.approx(sure.model.chosen.parameters["s0"].value, rel=0.02)


@mostly(0.95)
def test_spread_between_drives_is_found(seed: int) -> None:
    """Drives that differ by a sd of 0.1 on the cube, each known to 0.02: the sd comes back."""
    rng = np.random.default_rng(seed)
    drives = [
        drive(X + 0.1 * rng.standard_normal(5) + 0.02 * rng.standard_normal(5), 0.02**2) for _ in range(30)
    ]
    found = pooled("a", drives)
    for name, sd in found.spread.items():
        assert 0.05 < sd < 0.17, name


def test_the_model_of_the_smallest_error_over_all_drives_is_taken() -> None:
    """A long drive counts more than a short one; noise is the geometric mean."""
    found = pooled("a", [drive(X, 1e-3, 100.0, sd=0.1), drive(X, 1e-3, 100.0, sd=0.4)])
    assert found.model == MODELS[0].name
    assert found.noise.sd.value == pytest.approx(0.2)
    assert found.seconds == 200.0
    with pytest.raises(ValueError, match="no drive"):
        pooled("a", [])
