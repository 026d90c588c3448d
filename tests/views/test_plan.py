"""The plan of a drive: where it was in m, from either kind of position, and nothing where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_trace
from canid.ui.views.drive_report.plan import plan, positions
from canid.values.shipped_files import shipped
from canid.values.types import Trace

LOG = shipped().parent / "replay_logs" / "following_urban.blf"


@pytest.fixture(scope="module")
def trace() -> Trace:
    return read_trace(LOG, "generic")


def test_latitude_and_longitude_give_the_plan_that_east_and_north_give(trace: Trace) -> None:
    """The log has both, of one drive: they agree within the steps of 1e-6 degrees and of a meter."""
    measured = positions({name: trace.signals[name] for name in ("east", "north")})
    projected = positions({name: trace.signals[name] for name in ("lat", "lon")})
    assert measured is not None
    assert projected is not None
    for one, other in zip(measured, projected, strict=True):
        both = np.isfinite(one) & np.isfinite(other)
        assert np.abs(one - other)[both].max() < 0.005 * np.ptp(one[both]) + 40.0


def test_a_plan_has_one_scale_and_the_colors_lie_in_the_values(trace: Trace) -> None:
    drawn = plan("plan", trace, None, (), "pedal")
    assert drawn is not None
    (colored,) = [one for one in drawn.data if "customdata" in one]
    assert drawn.layout["yaxis"]["scaleanchor"] == "x"
    gap = trace.signals["gap"]
    assert np.nanmin(gap) <= colored["marker"]["cmin"] < colored["marker"]["cmax"] <= np.nanmax(gap)
    assert len(colored["x"]) == len(colored["customdata"]) <= 1200


def test_without_positions_or_where_the_car_stood_there_is_no_plan(trace: Trace) -> None:
    without = {role: x for role, x in trace.signals.items() if role not in ("lat", "lon", "east", "north")}
    assert plan("plan", trace._replace(signals=without), None, (), "pedal") is None
    unknown = np.full(len(trace.t), np.nan)
    nowhere = without | {"east": unknown, "north": unknown}
    assert plan("plan", trace._replace(signals=nowhere), None, (), "pedal") is None
    rng = np.random.default_rng(1)
    stood = without | {"east": rng.normal(0, 2, len(trace.t)), "north": rng.normal(0, 2, len(trace.t))}
    assert plan("plan", trace._replace(signals=stood), None, (), "pedal") is None
