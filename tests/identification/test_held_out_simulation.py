"""A model of the first part of a drive is simulated over the rest, and nothing of the rest enters it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_trace
from canid.analysis.drive.held_out_simulation import held_out
from canid.signals.samples.trace_assembly import part
from canid.values.types import Trace

LOGS = Path(__file__).parents[2] / "replay_logs"


@pytest.fixture(scope="module")
def drive() -> Trace:
    return read_trace(LOGS / "following_mixed.blf", "generic")


@pytest.mark.slow("identifies a drive twice")
def test_the_rest_enters_no_model(drive: Trace) -> None:
    """With another output in the rest the simulations are the same, and the fit is worse."""
    plain = held_out(drive)
    assert plain is not None
    assert {"fopdt", "armax"} <= set(plain.methods)
    assert 0.5 < plain.since / drive.t[-1] < 0.9
    assert all(20.0 < one.fit_percent < 100.0 for one in plain.methods.values())
    output = np.where(drive.t > plain.since + 0.5, 40.0 - drive.output, drive.output)
    other = held_out(drive._replace(output=output))
    assert other is not None
    for name, one in plain.methods.items():
        a, b = one.simulated, other.methods[name].simulated
        both = np.isfinite(a) & np.isfinite(b)
        assert both.sum() > 50
        np.testing.assert_allclose(a[both], b[both], atol=1e-6)
        assert other.methods[name].fit_percent < 0.0


def test_a_short_rest_is_not_simulated(drive: Trace) -> None:
    assert held_out(part(drive, slice(0, 400))) is None
