"""The same log gives the same numbers: cut anywhere, replayed at any speed, read as a trace; and they are true."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.drive import drive_reader
from canid.analysis.drive.drive_parameters import samples
from canid.io.logs import open_log
from canid.mathematics.estimators.fopdt import FOPDT
from canid.models.pipeline import pipeline
from canid.signals.vehicle import read_vehicle
from canid.values.frame_columns import chunks
from canid.values.types import Estimate, Frame, Identifiable, LearnGate, Sample, Status
from canid.values.window import Window
from tests.exact import exact
from tests.fixtures.measured_logs import MEASURED, needs_measured

REPO = Path(__file__).parents[1]
LOG = REPO / "replay_logs" / "following_urban.blf"


def outputs(frames: list[Frame], vehicle: str = "generic", cut: int | None = None) -> list:
    """Everything that comes out; the state is pickled between the frames before and from `cut` on."""
    running = pipeline.build(read_vehicle(vehicle))
    state, out = running.init(), []
    for part in (frames[:cut], frames[cut:] if cut is not None else []):
        for chunk in chunks(part, 500):
            state, now = running.step(state, chunk)
            out += [item for _, item in now]
        state = pickle.loads(pickle.dumps(state))
    return out


def same(a: list, b: list) -> bool:
    """Equal to the last bit, NaN included."""
    return len(a) == len(b) and all(exact(x) == exact(y) for x, y in zip(a, b, strict=True))


@pytest.mark.parametrize("dt", [0.0, -0.1, 1e-9, 5.0, float("nan"), float("inf"), "0.1", None])
def test_a_step_that_is_none_is_refused_before_the_log_is_read(dt: object) -> None:
    """Of the pipeline itself, and of a log that is read with it: the value, and what to give."""
    for call in (
        lambda: pipeline.build(read_vehicle("generic"), dt=dt),
        lambda: drive_reader.read_drive(LOG, "generic", dt=dt, estimating=False),
    ):
        with pytest.raises(ValueError, match=r"^dt=.* is no step of the grid in s; give one of 0\.001 to 1"):
            call()


@pytest.mark.slow("whole drives through the pipeline")
def test_the_stream_may_be_cut_anywhere() -> None:
    """Pickle the state in the middle, go on: the same numbers to the last bit."""
    frames = list(Window(0.0, 40.0).frames(open_log(LOG)))
    whole = outputs(frames)
    assert any(isinstance(x, Estimate) and x.status is Status.OK for x in whole)
    for cut in (1, 2017, len(frames) // 2):
        assert same(outputs(frames, cut=cut), whole)


@pytest.mark.slow("whole drives through the pipeline")
def test_replay_and_trace_agree() -> None:
    """Batch columns are the samples that the estimators get in a replay at the log's own speed."""
    trace = drive_reader.read_drive(LOG, "generic", estimating=False, stop=25.0).trace
    stream = [
        item
        for _, _, out in drive_reader.run(
            open_log(LOG), read_vehicle("generic"), within=Window(stop=25.0), span=0.05
        )
        for item in out
        if isinstance(item, Sample)
    ]
    np.testing.assert_array_equal(trace.t, [s.t for s in stream])
    np.testing.assert_array_equal(trace.output, [s.output for s in stream])
    np.testing.assert_array_equal(trace.inputs, [s.inputs for s in stream])


def test_frames_that_are_not_mapped_change_nothing() -> None:
    frames = list(Window(0.0, 30.0).frames(open_log(LOG)))
    rng = np.random.default_rng(0)
    noise = [
        Frame(float(t), 0, 0x7A0 + int(k), bytes(8)) for k, t in enumerate(sorted(rng.uniform(0, 30, 300)))
    ]
    mixed = sorted(frames + [f._replace(id=0x7A0) for f in noise], key=lambda f: f.t)
    a = [x for x in outputs(frames) if isinstance(x, Estimate)]
    b = [x for x in outputs(mixed) if isinstance(x, Estimate)]
    assert same(a, b[: len(a)])


@pytest.mark.slow("whole drives through the pipeline")
def test_windows_do_not_lead_each_other_astray() -> None:
    """A window that starts where the one before ended never reports a gain that excludes the truth from above.

    In the first minute of this hardly excited drive a noise that drifts can excuse a gain of eight times the truth.
    """
    rows = list(samples(canid.read_trace(REPO / "replay_logs" / "following_mixed.blf", "generic")))[:700]
    estimator = FOPDT.make(("headway_error", "range_rate"), pipeline.DT)
    state, lows = estimator.init(), []
    for row in rows:
        state, estimate = estimator.step(state, row)
        if estimate is not None and estimate.channels["headway_error"].status is not Identifiable.NOT:
            lows.append(estimate.channels["headway_error"].K.low)
    assert lows
    assert max(lows) < 6.04  # its truth


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("name", ["following_mixed.blf", "following_urban.blf", "following_motorway.asc"])
def test_the_whole_drive_tells_the_truth(name: str) -> None:
    """Gains of the simulated drivers lie in (slightly widened: several drives, one test) intervals of the drive."""
    truth = json.loads((REPO / "replay_logs" / (name.split(".")[0] + ".truth.json")).read_text())["channels"]
    identified = canid.identify(canid.read_trace(REPO / "replay_logs" / name, "generic"), select_orders=False)
    for channel, of in truth.items():
        ch = identified.channels[channel]
        if ch.status is not Identifiable.NOT:
            half = (ch.K.high - ch.K.low) / 2
            assert ch.K.low - 0.5 * half <= of["K"] <= ch.K.high + 0.5 * half, (channel, ch.K, of["K"])
        if ch.status is Identifiable.SUM_ONLY:
            iv = ch.tau_plus_dead_time
            half = (iv.high - iv.low) / 2
            assert iv.low - 0.5 * half <= of["tau"] + of["dead_time"] <= iv.high + 0.5 * half
    assert identified.channels["range_rate"].status is not Identifiable.NOT


@needs_measured
def test_rav4_lead_and_cruise() -> None:
    """The person's pedal is never identified while cruise control drives, and the lead is continuous."""
    drive = drive_reader.read_drive(MEASURED / "rav4" / "rav4_highway.blf", "toyota_rav4_2017")
    assert drive.health.frames == 135_468
    assert not [e for e in drive.estimates if e.status is Status.OK]
    late = [e for e in drive.estimates if e.t >= 9.1]
    assert {e.status for e in late} == {Status.NO_DRIVER}
    trace = drive.trace
    cruise = trace.t > 11.0
    assert {g for g, c in zip(trace.gate, cruise, strict=True) if c} == {LearnGate.CRUISE}
    gap = trace.signals["gap"][cruise]
    assert np.isfinite(gap).all()
    assert gap.min() > 20.0
    assert gap.max() < 80.0
    # continuous: the gap moves as the range rate says
    slope = np.gradient(gap, trace.t[cruise])
    assert np.abs(slope - trace.signals["range_rate"][cruise]).max() < 2.0
    assert len(set(trace.segment[cruise])) == 1


@pytest.mark.slow("whole drives through the pipeline")
@needs_measured
def test_rav4_the_controller_itself_is_identified(tmp_path: Path) -> None:
    text = (REPO / "dbc" / "toyota_rav4_2017.toml").read_text()
    text = text.replace('output = "pedal"', 'output = "accel_command"')
    text = text.replace('file = "', f'file = "{REPO / "dbc"}/')
    (tmp_path / "acc.toml").write_text(text)
    drive = drive_reader.read_drive(MEASURED / "rav4" / "rav4_highway.blf", tmp_path / "acc.toml")
    assert not [e for e in drive.estimates if e.t < 9.0 and e.status is Status.OK]
    good = [e for e in drive.estimates if e.status is Status.OK and e.estimator == "fopdt"]
    assert good, [e.says for e in drive.estimates][-2:]
    K = good[-1].channels["range_rate"].K
    assert 0.1 < K.value < 1.5


def test_the_estimators_start_without_scipy() -> None:
    """Nothing that a live start imports needs scipy.signal or matplotlib, which take a second each."""
    heavy = "{'scipy.signal', 'scipy.stats', 'filterpy', 'matplotlib'}"
    code = f"import sys, canid.models.pipeline.pipeline; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
