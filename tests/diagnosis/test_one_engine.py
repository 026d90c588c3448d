"""What a signal cannot show is asked of no diagnosis: of one drive, of several of one driver, and of several of one car."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from canid.models.diagnosis import car_following
from canid.models.diagnosis.corrections import Corrected, TooLittleError
from canid.models.diagnosis.diagnose import diagnose, diagnose_car, diagnose_drives
from canid.models.simulation import simulate
from canid.values.findings import Report
from canid.values.types import LearnGate, SignalFinding, Trace
from tests.hidden_effects.planted_by_canid import by_columns

SLOW = SignalFinding("output_slow", ("pedal",), 0.0, 60.0, "", "", False, withholds_delays=True)
# what stands still, and what does what a delay does
NOT_SHOWN = {"attention_gap", "act_and_wait", "delay_drift", "lead_acceleration"}
# drives -> the reports on them
Way = Callable[[Sequence[Trace]], Sequence[Report]]
WAYS: dict[str, Way] = {
    "one drive": lambda traces: [diagnose(trace) for trace in traces],
    "one driver": lambda traces: [diagnose_drives(traces, "ab")],
    "one car": lambda traces: diagnose_car(traces, "ab"),
}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """The effects of each diagnosis that would have been made."""
    out: list[set[str]] = []

    def prepare(corrected: Corrected) -> None:
        out.append({effect.id for effect in corrected.settings.catalogue})
        raise TooLittleError("not asked here", corrected.steps)

    monkeypatch.setattr(car_following, "prepare", prepare)
    return out


def drives(seed: int) -> list[Trace]:
    rng = np.random.default_rng(seed)
    return [by_columns(simulate(1.0, int(rng.integers(1_000_000)), "mixed")) for _ in range(2)]


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_a_slow_output_shows_no_holds_and_no_delays_however_drives_are_diagnosed(
    way: Way, asked: list[set[str]], seed: int
) -> None:
    fine = drives(seed)
    way(fine)
    assert asked
    assert all(each >= NOT_SHOWN for each in asked)
    asked.clear()
    way([trace._replace(findings=(SLOW,)) for trace in fine])
    assert asked
    assert not any(each & NOT_SHOWN for each in asked)


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.usefixtures("asked")
def test_an_output_at_its_limit_is_said_however_drives_are_diagnosed(way: Way, seed: int) -> None:
    limited = []
    for trace in drives(seed):
        gate, bound = [*trace.gate], np.full(trace.t.size, np.nan)
        for k in range(100, 150):
            gate[k], bound[k] = LearnGate.OUTPUT_LIMIT, trace.output[k] - 1.0
        limited.append(trace._replace(gate=tuple(gate), bound=bound))
    for report in way(limited):
        assert any("at its upper limit" in step for step in report.steps), report.steps
        assert report.signals == ()
        assert report.time.total > 0.0
