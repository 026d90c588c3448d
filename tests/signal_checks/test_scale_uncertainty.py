"""Where gap and range rate differ in scale the gains are as uncertain as that; nothing else that sensors do widens them."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.drive import scale_uncertainty
from canid.analysis.tables.arrays import from_arrays
from canid.values.types import Trace
from tests import seeds
from tests.plants.outside_drives import drawn_drive
from tests.plants.quoted_intervals import identified, quoted
from tests.plants.sensor_effects import late
from tests.signal_checks.synthetic import DT, Columns, following


def read(given: Columns) -> Trace:
    """What canid makes of it, with a hole in the gap and an empty cell."""
    roles = {role: given[role].copy() for role in ("pedal", "speed", "gap", "range_rate")}
    roles["gap"][700:760] = roles["range_rate"][1400] = np.nan
    return from_arrays(time=DT * np.arange(len(given["gap"])), output="pedal", units={}, **roles)


@pytest.mark.parametrize(("role", "factor"), [("range_rate", 1.06), ("range_rate", 0.93), ("gap", 0.94)])
@seeds.mostly(0.9)
def test_the_ratio_of_the_scales_is_known(role: str, factor: float, seed: int) -> None:
    """Below what is a finding, by either of the two, and of a sound drive it may be 1."""
    given = following(seed, 8.0)
    scale = factor if role == "range_rate" else 1.0 / factor
    trace = read(given | {role: factor * given[role]})
    ratio = scale_uncertainty.measured(trace)
    assert not trace.findings
    assert ratio is not None
    assert ratio.low < scale < ratio.high
    assert scale_uncertainty.measured(read(given)) is None


@seeds.mostly(0.8)
def test_a_gain_holds_where_the_range_rate_has_a_wrong_scale(seed: int) -> None:
    """10 % too small, it made K of range rate as much too large, three half widths of its interval."""
    drive = drawn_drive("acceleration", seed)
    wrong = drive._replace(columns={**drive.columns, "range_rate": 0.9 * drive.columns["range_rate"]})
    result = identified(wrong)
    gains = [each for each in quoted(result, drive.truth) if each.parameter == "K"]
    assert result is not None
    assert not result.findings
    assert {each.channel for each in gains} >= {"range_rate"}
    assert all(each.covers for each in gains), [*map(str, gains)]
    assert any("wrong scale" in line for line in result.whole["fopdt"].lines)  # type: ignore[union-attr]


@seeds.mostly(0.9)
def test_a_late_gap_is_no_other_scale(seed: int) -> None:
    """By 0.3 s."""
    drive = drawn_drive("Helly", seed, seconds=300.0)
    columns = late(drive, 0.3, np.random.default_rng(seed), role="gap").columns
    assert scale_uncertainty.measured(read({role: np.array(x) for role, x in columns.items()})) is None
