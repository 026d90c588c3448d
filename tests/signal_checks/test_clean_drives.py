"""No finding on clean drives of two simulators that share no code with canid."""

from __future__ import annotations

import itertools

import pytest

from canid.signals.signal_checks import signal_checks
from canid.values.types import Driver, SignalReport
from tests.plants.measurement import trace
from tests.plants.monitor_runs import kinds, samples
from tests.seeds import mostly

# drives of the usual run; `python -m benchmarks signal_faults` has 50
DRIVES, MINUTES = 6, 4.0


@pytest.mark.slow("checks whole drives")
@mostly(0.95)
def test_clean_drives_raise_no_finding(seed: int) -> None:
    """Radars, noises and roads of the plants, drawn anew in each run; at most one false alarm in 24 minutes."""
    found: list[tuple[object, SignalReport]] = []
    for plant, how in itertools.islice(kinds(seed), DRIVES):
        drive = trace(plant({}, minutes=MINUTES, **how))
        state = signal_checks.init()
        for sample in samples(drive):
            state, report = signal_checks.step(state, sample, Driver(), drive.dt)
            found += [] if report is None else [(how, report)]
    assert len(found) <= 1, found
    print(found)
