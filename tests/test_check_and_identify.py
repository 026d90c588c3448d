"""`check` fails on every log of which `identify` quotes nothing, with the same reason, and on no other for that reason.

But for gains that are averages over a cause of the driver's, which are no fault of the vehicle file.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.identification_verdict import verdict, why_nothing
from canid.analysis.drive.vehicle_check import check
from canid.io.logs import open_log
from canid.models.pipeline import pipeline
from canid.signals.samples import trace_assembly
from canid.signals.signal_checks import signal_checks
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.frame_columns import chunks, columns_of
from canid.values.types import Frame, Sample, SignalReport, Trace

LOGS = Path(__file__).parents[1] / "replay_logs"
SHIPPED = LOGS.parent / "dbc"


def trace_of(frames: list[Frame], vehicle: Vehicle) -> Trace:
    """As `read_trace`, of frames."""
    running = pipeline.build(vehicle, estimating=False)
    state, out = running.init(), []
    for chunk in chunks(frames):
        state, more = running.step(state, chunk)
        out += [item for _, item in more]
    trace = trace_assembly.trace([x for x in out if isinstance(x, Sample)], vehicle.driver, pipeline.DT)
    return trace._replace(findings=signal_checks.episodes(x for x in out if isinstance(x, SignalReport)))


def until(seconds: float) -> Callable[[list[Frame]], list[Frame]]:
    return lambda frames: [frame for frame in frames if frame.t < seconds]


CASES: dict[str, tuple[str, Callable[[list[Frame]], list[Frame]]]] = {
    "11 s": ("following_mixed", until(11.0)),
    "13 s": ("following_mixed", until(13.0)),
    "15 s": ("following_urban", until(15.0)),
    "18 s": ("following_urban", until(18.0)),
    "no lead": ("following_urban", lambda frames: [f for f in frames if f.id != 0x130]),
    "all": ("following_mixed", lambda frames: frames),
}


@pytest.mark.slow("a fit of the whole drive twice for each case")
@pytest.mark.parametrize("case", CASES)
def test_check_fails_where_nothing_may_be_quoted(case: str) -> None:
    name, change = CASES[case]
    vehicle = read_vehicle("generic")
    frames = change(list(open_log(LOGS / f"{name}.blf")))
    checked = check([columns_of(frames)], vehicle)
    found = identify(trace_of(frames, vehicle), select_orders=False, **vehicle.estimators)
    said = verdict(found, "pedal")
    assert bool(checked.problems) is not said.identifiable, checked.problems
    if checked.findings or not checked.time.usable:
        return
    why = why_nothing(found, "pedal").rstrip(".").casefold()
    assert said.identifiable or any(why in problem.casefold() for problem in checked.problems)


# another line for a signal of the generic vehicle file: wrong scales and signs, which other signals contradict
CONTRADICTIONS = {
    "range rate turned round": ("range_rate", "scale = -1"),
    "gap of feet": ("gap", "scale = 0.3048"),
    "range rate in km/h": ("range_rate", "scale = 3.6"),
    "speed of mph": ("speed", "scale = 0.6214"),
    "pedal of counts": ("pedal", "scale = 2.55"),
}


@pytest.mark.slow("a fit of the whole drive twice for each case")
@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_check_fails_where_signals_contradict_each_other(case: str, tmp_path: Path) -> None:
    """One list of findings for both; `check` fails on each log of which `identify` withholds the numbers."""
    role, words = CONTRADICTIONS[case]
    text = (SHIPPED / "generic.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith(f"{role} = "))
    signal = line.partition('"')[2].partition('"')[0]
    path = tmp_path / "car.toml"
    changed = text.replace(line, f'{role} = {{ signal = "{signal}", {words} }}')
    path.write_text(changed.replace("generic.dbc", str(SHIPPED / "generic.dbc")))
    vehicle = read_vehicle(str(path))
    frames = list(open_log(LOGS / "following_mixed.blf"))
    checked = check([columns_of(frames)], vehicle)
    trace = trace_of(frames, vehicle)
    assert checked.findings == trace.findings
    found = identify(trace, select_orders=False, sliding=False, **vehicle.estimators)
    said = verdict(found, "pedal")
    sentences = [signal_checks.sentence(one) for one in trace.findings]
    assert set(sentences) <= set(checked.problems)
    assert bool(checked.problems) is not said.identifiable
