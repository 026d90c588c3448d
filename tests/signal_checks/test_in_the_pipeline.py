"""Findings are the same live, in batch and after a restart, and no estimate is `ok` while one stands."""

from __future__ import annotations

import random
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive import drive_reader
from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.vehicle_check import check
from canid.io.logs import open_log, write_log
from canid.models.diagnosis.diagnose import diagnose
from canid.models.pipeline import pipeline
from canid.models.saving.saved_state import Restored, saver
from canid.signals.signal_checks import signal_checks
from canid.signals.signal_checks.drive_time import of_trace
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.findings import Verdict
from canid.values.frame_columns import columns_of
from canid.values.types import Estimate, Frame, SignalReport, Status
from tests.exact import exact

REPO = Path(__file__).parents[2]
LOG = REPO / "replay_logs" / "following_urban.blf"
SECONDS = 100.0


@pytest.fixture(scope="session")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    """The generic vehicle with a range rate of the wrong sign."""
    folder = tmp_path_factory.mktemp("wrong")
    shutil.copy(REPO / "dbc/generic.dbc", folder)
    text = (REPO / "dbc/generic.toml").read_text(encoding="utf-8")
    right = 'range_rate = "RADAR_LEAD.LeadRelSpeed"'
    assert right in text
    text = text.replace(right, 'range_rate = { signal = "RADAR_LEAD.LeadRelSpeed", scale = -1 }')
    (folder / "wrong.toml").write_text(text, encoding="utf-8")
    return read_vehicle(folder / "wrong.toml")


@cache
def frames() -> list[Frame]:
    """The log; do not change it."""
    return [frame for frame in open_log(LOG) if frame.t < SECONDS]


def run(vehicle: Vehicle, sizes: list[int], estimating: bool) -> tuple[list[pipeline.Output], pipeline.State]:
    """All outputs for chunks of these sizes, in turn."""
    running = pipeline.build(vehicle, estimating=estimating)
    state, out, k, n = running.init(), [], 0, 0
    while k < len(frames()):
        size = sizes[n % len(sizes)]
        state, made = running.step(state, columns_of(frames()[k : k + size]))
        out += [item for _, item in made]
        k, n = k + size, n + 1
    return out, state


@pytest.mark.slow("checks whole drives")
def test_findings_do_not_depend_on_the_chunks(wrong: Vehicle, seed: int) -> None:
    """The reports and the state of the checks are the same to the last bit, however frames are divided."""
    sizes = [random.Random(seed).choice((7, 30, 200, 1000)) for _ in range(50)]
    one, one_state = run(wrong, [10**9], estimating=False)
    other, other_state = run(wrong, sizes, estimating=False)
    reports = [item for item in one if isinstance(item, SignalReport)]
    assert reports
    assert exact(reports) == exact([item for item in other if isinstance(item, SignalReport)])
    assert exact(one_state.signals) == exact(other_state.signals)


@pytest.mark.slow("checks whole drives")
def test_no_estimate_is_ok_while_a_finding_stands(wrong: Vehicle, tmp_path: Path) -> None:
    """From the report on nothing is `ok` and nothing carries the headline; the windows of a drive are the same."""
    out, _ = run(wrong, [400], estimating=True)
    raised = next(item for item in out if isinstance(item, SignalReport))
    assert {"range_rate_sign", "gap_contradicts_range_rate"} & {one.name for one in raised.findings}
    later = [item for item in out[out.index(raised) :] if isinstance(item, Estimate)]
    assert len(later) > 20
    assert not any(item.headline or item.status is Status.OK for item in later)

    path = tmp_path / "drive.blf"
    write_log(path, frames(), 1.7e9)
    trace = drive_reader.read_trace(path, wrong)
    assert [one.name for one in trace.findings][-1] == "range_rate_sign"
    estimates = {(e.t, e.estimator): e for e in out if isinstance(e, Estimate)}
    windows = identify(trace, select_orders=False).windows
    assert windows
    for window in windows:
        live = estimates[window.t, window.estimator]
        assert (window.status, window.says) == (live.status, live.says)


@pytest.mark.slow("checks whole drives")
def test_all_verbs_count_the_same_seconds(tmp_path: Path, wrong: Vehicle) -> None:
    """`check`, `identify` and `diagnose` mean the same by driving, behind a lead and usable."""
    path = tmp_path / "drive.blf"
    write_log(path, frames(), 1.7e9)
    for vehicle in (read_vehicle("generic"), wrong):
        trace = drive_reader.read_trace(path, vehicle)
        checked = check(open_log(path).columns(), vehicle)
        times = [
            checked.time,
            of_trace(trace),
            identify(trace, select_orders=False).time,
            diagnose(trace, minimum=1e6).time,
        ]
        assert all(time == times[0] for time in times), times
        assert times[0].usable <= times[0].behind_lead <= times[0].driving <= times[0].total
    assert checked.findings
    assert any("range rate" in problem for problem in checked.problems)


@pytest.mark.slow("checks whole drives")
def test_a_restart_keeps_a_finding(wrong: Vehicle) -> None:
    """What stands is saved and restored, and goes on to withhold."""
    _, state = run(wrong, [1000], estimating=True)
    running = pipeline.build(wrong)
    saving = saver(wrong, running)
    known = pipeline.known(state)
    assert known is not None
    restored = saving.restore(saving.save(known, 1e9), 1e9 + 60.0)
    assert isinstance(restored, Restored), restored
    assert exact(restored.known.signals) == exact(known.signals)
    resumed = running.resume(running.init(), restored.known)
    assert signal_checks.findings(resumed.signals)


@pytest.mark.slow("checks whole drives")
def test_a_diagnosis_blames_no_driver_for_a_dead_range_rate(tmp_path: Path) -> None:
    """With a range rate of 0 the verdict is that the data do not suffice, and the sentence says why."""
    path = tmp_path / "drive.blf"
    write_log(path, open_log(LOG), 1.7e9)
    trace = drive_reader.read_trace(path, "generic")
    signals = {**trace.signals, "range_rate_reported": np.zeros(trace.t.size)}
    state, reports = signal_checks.init(), []
    for sample in _samples(trace._replace(signals=signals)):
        state, report = signal_checks.step(state, sample, read_vehicle("generic").driver, trace.dt)
        reports += [] if report is None else [report]
    found = signal_checks.episodes(reports)
    assert {"range_rate_dead", "range_rate_frozen"} & {one.name for one in found}
    report = diagnose(trace._replace(signals=signals, findings=found))
    assert report.verdict is Verdict.NOT_ENOUGH_DATA
    assert not [finding for finding in report.findings if finding.where == "driver"]
    assert report.signals == found


def _samples(trace):
    from tests.plants.monitor_runs import samples

    return samples(trace)
