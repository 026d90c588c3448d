"""The table of measured drives that needs no measured data to run: the law of one driver's noise on another's drive."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.measured_drives import planted, remnant
from canid.values.types import Trace
from tests.plants import plant_two
from tests.plants.measurement import trace
from tests.seeds import mostly


def drive(seed: int, **effects: dict[str, float]) -> Trace:
    return trace(plant_two.plant(effects, seed=seed, minutes=6, noise="ar1", profile="mixed"))


@mostly(0.95)
def test_a_law_gains_on_another_drive_with_heavy_tails_and_not_on_a_gaussian_one(seed: int) -> None:
    heavy = [remnant.of_drive(drive(seed + k, heavy_tails={"freedom": 3.0})) for k in range(2)]
    plain = remnant.of_drive(drive(seed + 2))
    assert heavy[0] is not None
    assert heavy[1] is not None
    assert plain is not None
    law = remnant.law_search.fitted(heavy[0], remnant.REMNANT, heavy[0].rows).law
    assert remnant.gained(heavy[1], law).low > 0
    assert not remnant.gained(plain, law).low > 0
    assert np.isfinite(remnant.gained(plain, law).value)


def test_every_drive_has_a_line() -> None:
    lines = remnant.table({"a": drive(1), "b": drive(2)})
    assert len(lines) == 4
    assert all(line.count("[") == 2 for line in lines[2:])


@pytest.mark.slow("fits a planted drive and drives it again")
def test_a_fitted_driver_drives_again_with_an_effect() -> None:
    """The noise is that of the drive, so that two drivers with the same draw differ by the effect alone."""
    recorded = drive(1521003)
    plain, closing = (planted.planted(recorded, effect, 1) for effect in (planted.NOTHING, "asymmetric_gain"))
    assert plain is not None
    assert closing is not None
    assert plain.t.size == closing.t.size
    differs = np.nanmax(np.abs(plain.signals["gap"] - closing.signals["gap"]))
    assert 0.1 < differs < 50.0
