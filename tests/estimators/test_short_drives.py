"""Drives that are shorter than what a drift of the level needs have an answer, or the reason why they have none."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.drive import drive_parameters
from canid.mathematics.identification.fopdt import drifting_level
from canid.values.types import QUOTED
from tests.plants.outside_drives import helly_drive
from tests.plants.quoted_intervals import trace


def test_a_drive_without_cosines_has_a_level_of_none() -> None:
    """So few rows that the drift has no coefficient."""
    assert drifting_level.raw(60, 0.1).shape[0] == 0


@pytest.mark.long("identifies whole drives")
@pytest.mark.parametrize("seconds", [6.0, 17.0, 18.0, 19.0, 20.0, 22.0, 25.0])
def test_a_short_drive_is_identified_or_refused(seconds: float, seed: int) -> None:
    """With little noise, so that gains are found at all."""
    drive = helly_drive(np.random.default_rng(seed), seconds=seconds, noise=0.1, driver_noise=(0.2, 1.0))
    found = drive_parameters.whole_drive(trace(drive))
    for channel in found.channels.values():
        assert all(np.isfinite(getattr(channel, name)).all() for name in QUOTED[channel.status])
