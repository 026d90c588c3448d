"""The monitor is silent on clean drives, and reports since when which block does not fit."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from canid.models.monitor import arx_model, change_monitor, evalue_cusum, stuck_output
from canid.models.pipeline import pipeline
from canid.models.saving.saved_state import resume, saver
from canid.models.saving.state_codec import codec
from canid.models.simulation import frames, simulate
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.ui.views.terminal_view.picture import render
from canid.ui.views.terminal_view.state import View, update
from canid.values.frame_columns import chunks
from canid.values.types import BlockStatus, MonitorReport, Sample
from tests.exact import exact
from tests.pipeline_outputs import outputs
from tests.plants import measurement, plant_one, plant_two
from tests.plants.changes import CHANGES, Changed, Scene
from tests.plants.monitor_runs import Alarm, alarms, kinds, reports, samples
from tests.terminal import plain

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
NAMES = ("headway_error", "range_rate")
MINUTES = 7.0
BY_NAME = {change.name: change for change in CHANGES}


def planted(name: str, simulator: str, seed: int) -> Changed:
    """A drive that changes somewhere in its middle; noise and profile go with the seed."""
    rng = np.random.default_rng(seed)
    noise, profile = rng.choice(["white", "ar1", "ar4", "state", "mix"]), rng.choice(["mixed", "urban"])
    how = {"seed": seed, "minutes": MINUTES, "noise": str(noise), "profile": str(profile)}
    return BY_NAME[name].make(Scene(PLANTS[simulator], how, float(rng.uniform(200.0, 260.0))))


def alarms_after(changed: Changed) -> list[Alarm]:
    """The monitor's alarms, in time since the change."""
    reported = alarms(reports(measurement.trace(changed.drive)))
    return [a._replace(t=a.t - changed.at, since=a.since - changed.at) for a in reported]


@pytest.mark.slow("monitors long drives")
def test_clean_drives_are_silent_and_seen() -> None:
    """Six drives, one of each noise, of both simulators: no alarm, and each block fits in the end."""
    every = list(islice(kinds(4100), 12))
    for k in range(6):
        plant, how = every[2 * k + k % 2]
        reported = reports(measurement.trace(plant({}, minutes=6.0, **how)))
        assert alarms(reported) == [], how
        assert {of.state for of in reported[-1].blocks.values()} == {BlockStatus.FITS}, how
        assert reported[-1].fits
        assert math.isnan(reported[-1].since)


@pytest.mark.slow("monitors long drives")
@pytest.mark.parametrize(
    ("name", "simulator"),
    [
        ("range rate with the wrong sign", "one"),
        ("range rate off by 30 %", "two"),
        ("speed reads 8 % more", "one"),
        ("speed stands still", "two"),
        ("gap and range rate stand still", "one"),
        ("gap and range rate stand still", "two"),
    ],
)
def test_a_sensor_fault_is_detected_within_half_a_minute(name: str, simulator: str) -> None:
    """Sensing is suspected, no block before; the change point is right within some seconds."""
    reported = alarms_after(planted(name, simulator, 510 + len(name)))
    assert reported[0].block == "sensing"
    assert 0.0 < reported[0].t < 30.0
    assert abs(reported[0].since) < 15.0


@pytest.mark.slow("monitors long drives")
@pytest.mark.parametrize(
    ("name", "block", "seeds"),
    [
        ("gains fall by 60 %", "driver", range(620, 622)),
        ("engine pulls 40 % less", "vehicle", range(622, 624)),
    ],
)
def test_a_change_of_driver_or_vehicle_is_attributed_to_the_right_block(name, block, seeds) -> None:
    """Three of four drives at least: slow noise can hide a driver's change for minutes, a level road a car's.

    Never is another block suspected first, nor anything before the change.
    """
    every = [alarms_after(planted(name, simulator, seed)) for simulator in PLANTS for seed in seeds]
    first = [reported[0] for reported in every if reported]
    assert len(first) >= 0.75 * len(every)
    assert {a.block for a in first} == {block}
    assert min(a.t for a in first) > 0.0
    # in a closed loop the inputs move together: how it does not fit is a hint, and mostly right
    right = ["less strongly" in a.says or "worse" in a.says for a in first]
    assert np.mean(right) >= 0.75
    assert abs(np.median([a.since for a in first])) < 30.0


@pytest.mark.slow("whole drives through the pipeline")
def test_a_stuck_pedal_signal_is_a_sensor_fault() -> None:
    """Constant to the last bit while the vehicle's motion changes: neither driver nor vehicle, dated to the second."""
    changed = planted("pedal stands still", "two", 701)
    reported = alarms_after(changed)
    assert reported[0].t > 0.0
    last = reported[-1]
    assert last.says == "the driver's output is stuck, but the vehicle's motion no longer follows from it"
    assert last.block == "sensing"
    assert abs(last.since) < 2.0


@pytest.mark.slow("whole drives through the pipeline")
def test_after_a_change_the_model_learns_and_fits_again() -> None:
    """No alarm lasts for ever: the changed behaviour is learnt."""
    changed = planted("gains fall by 60 %", "one", 622)
    reported = reports(measurement.trace(changed.drive))
    suspected = [s for s in reported if not s.fits]
    assert {s.block for s in suspected} == {"driver"}
    # as long as something is suspected it is repeated, at least every 10 s
    assert np.diff([s.t for s in suspected]).max() < 10.5
    assert reported[-1].fits
    assert reported[-1].since > suspected[0].t


@pytest.mark.slow("monitors long drives")
def test_lane_keeping_is_monitored_too() -> None:
    vehicle = read_vehicle("generic_lane")
    drive = simulate(minutes=4, seed=3, profile="lane", noise="ar1")
    running = pipeline.build(vehicle)
    reported = [x for x in outputs(running, frames(drive, vehicle)) if isinstance(x, MonitorReport)]
    assert reported[-1].blocks["driver"].state is BlockStatus.FITS
    assert alarms(reported) == []


# --- weak data -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clean() -> list[Sample]:
    """Five minutes of following."""
    drive = plant_one.plant({}, seed=33, minutes=5.0, noise="ar1", profile="urban")
    return list(samples(measurement.trace(drive)))


def run(of: list[Sample], names: tuple[str, ...] = NAMES) -> list[MonitorReport]:
    monitor = change_monitor.make(names)
    state, reported = monitor.init(), []
    for sample in of:
        state, now = monitor.step(state, sample)
        reported += [now] if now is not None else []
    return reported


@pytest.mark.parametrize(
    ("gone", "unseen"),
    [
        (("gnss_speed",), set()),
        (("pedal",), {"vehicle"}),
        (("gap", "range_rate", "gnss_speed"), {"sensing"}),
        (("speed",), {"vehicle"}),
        (None, {"sensing", "vehicle"}),
    ],
)
def test_what_is_not_measured_is_unseen_and_the_rest_goes_on(clean, gone, unseen) -> None:
    """From the start without these signals: a sentence that names them, and no alarm."""
    without = {of for role in gone or () for of in (role, f"{role}_reported")}
    left = [
        s._replace(signals={} if gone is None else {k: v for k, v in s.signals.items() if k not in without})
        for s in clean
    ]
    reported = run(left)
    assert alarms(reported) == []
    assert {b for b, of in reported[-1].blocks.items() if of.state is BlockStatus.UNSEEN} == unseen
    for block in unseen:
        assert reported[-1].blocks[block].says.startswith("needs ")


def test_signals_that_vanish_become_unseen_within_a_minute(clean) -> None:
    nothing = [s._replace(output=math.nan, inputs=(math.nan,) * 2, learn=False, signals={}) for s in clean]
    reported = run([s if s.t < 150.0 else nothing[k] for k, s in enumerate(clean)])
    late = [s for s in reported if s.t > 210.0]
    assert late
    assert {of.state for s in late for of in s.blocks.values()} == {BlockStatus.UNSEEN}
    assert alarms(reported) == []


def test_absurd_numbers_neither_break_it_nor_stay_in_memory(clean) -> None:
    """NaN, infinite and absurd values anywhere for half a minute: no exception, no warning; later all blocks fit again."""
    rng = np.random.default_rng(5)
    absurd = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e160, 0.0]

    def hit(x: float) -> float:
        return float(rng.choice(absurd)) if rng.uniform() < 0.3 else x

    bad = [
        s._replace(output=hit(s.output), inputs=tuple(map(hit, s.inputs)), signals={k: hit(v) for k, v in s.signals.items()})
        if 130.0 < s.t < 160.0
        else s
        for s in clean
    ]  # fmt: skip
    reported = run(bad)
    assert {of.state for of in reported[-1].blocks.values()} == {BlockStatus.FITS}
    for s in reported:
        assert all(math.isfinite(of.evidence) for of in s.blocks.values())


def test_constant_signals_are_no_misfit(clean) -> None:
    """A drive with everything constant gives statuses, not a singular matrix."""
    first = clean[100]
    still = [s._replace(output=12.0, inputs=first.inputs, learn=True, signals=first.signals) for s in clean]
    reported = run(still)
    assert reported[-1].blocks["vehicle"].state is not BlockStatus.MISFIT
    # an output that never moved has always been constant: there is no change
    assert reported[-1].blocks["sensing"].state is not BlockStatus.MISFIT


# --- a restart -----------------------------------------------------------------------------------


@pytest.mark.slow("monitors long drives")
def test_its_state_survives_saving_to_the_last_bit() -> None:
    """Saved at any time, before and during an alarm: the same reports afterwards."""
    changed = planted("range rate with the wrong sign", "one", 810)
    every = list(samples(measurement.trace(changed.drive)))
    monitor, plain = change_monitor.make(NAMES), codec(change_monitor.State)
    state, states, reported = monitor.init(), [], []
    for sample in every:
        state, now = monitor.step(state, sample)
        states.append(state)
        reported.append(now)
    rng = np.random.default_rng(2)
    after = int(np.searchsorted([s.t for s in every], changed.at + 20.0))
    for k in (0, 3, 700, after, *rng.integers(800, len(every) - 200, 3).tolist()):
        back = plain.decode(plain.encode(states[k]))
        assert exact(back) == exact(states[k])
        for i in range(k + 1, min(k + 200, len(every))):
            back, now = monitor.step(back, every[i])
            assert exact(now) == exact(reported[i])
    assert any(s is not None and not s.fits for s in reported)


@pytest.mark.slow("monitors long drives")
def test_after_a_restart_the_alarm_continues_with_its_start_before_it() -> None:
    """A new session's clock begins at 0; what began before it has a negative time."""
    changed = planted("range rate with the wrong sign", "two", 811)
    vehicle = measurement.lean()
    running = pipeline.build(vehicle)
    every = measurement.frames(changed.drive, vehicle)
    state, begin = running.init(), changed.at + 25.0
    for chunk in chunks([frame for frame in every if frame.t < begin], 1000):
        state, _ = running.step(state, chunk)
    known = pipeline.known(state)
    assert known is not None
    saving = saver(vehicle, running)
    again, event = resume(running, saving, saving.save(known, 1e9), 1e9 + 60.0)
    assert event.what == "state_restored"
    reported = []
    for chunk in chunks([frame for frame in every if begin <= frame.t < begin + 12.0], 100):
        again, out = running.step(again, chunk._replace(t=(chunk.t - begin).round(9)))
        reported += [x for _, x in out if isinstance(x, MonitorReport)]
    assert reported
    assert reported[0].block == "sensing"
    assert reported[0].t < 12.0
    assert reported[0].since == pytest.approx(-25.0, abs=10.0)


# --- its parts -----------------------------------------------------------------------------------


def test_evidence_is_an_e_value_whatever_the_noise() -> None:
    """Its expectation is at most 1 for a model that is off by no more than allowed, for all symmetric noise.

    Symmetric noise is a mixture of ±a, so ±a is all there is to check; variance is a mere scale and may be wrong.
    """
    for a in np.geomspace(0.01, 30.0, 13):
        for allowed in (0.0, 0.1, 1.0, 4.0):
            for off in np.linspace(-allowed, allowed, 5):
                for z in (0.05, -0.7, 5.0):
                    won = [
                        np.exp(
                            evalue_cusum.step(
                                evalue_cusum.init(1),
                                0.0,
                                np.array([sign * a + off * np.sign(z)]),
                                np.array([[z]]),
                                1.0,
                                np.array([[allowed]]),
                                1e9,
                            ).level
                        )
                        for sign in (-1.0, 1.0)
                    ]
                    assert (0.5 * (won[0] + won[1])).max() <= 1.0 + 1e-12


def test_the_model_is_least_squares_with_exponential_weights() -> None:
    """Batch by batch as the closed form does at once, up to the ridge."""
    rng = np.random.default_rng(8)
    batches = [
        np.column_stack([rng.standard_normal((int(n), 2)), np.ones(int(n))]) for n in rng.integers(1, 10, 40)
    ]
    outcomes = [x @ [2.0, -1.0, 0.5] + rng.standard_normal(len(x)) for x in batches]
    memory, state = 60.0, arx_model.init(3)
    for x, y in zip(batches, outcomes, strict=True):
        state = arx_model.learn(state, x, y, np.arange(3), memory)
    behind = np.cumsum([len(x) for x in batches][::-1])[::-1] - [len(x) for x in batches]
    weights = np.concatenate(
        [np.full(len(x), (1 - 1 / memory) ** b) for x, b in zip(batches, behind, strict=True)]
    )
    root = np.sqrt(weights)
    X, y = np.concatenate(batches), np.concatenate(outcomes)
    theta = np.linalg.lstsq(root[:, None] * X, root * y, rcond=None)[0]
    np.testing.assert_allclose(state.theta, theta, atol=1e-5)
    assert state.rows == pytest.approx(weights.sum())
    predicted = np.cov(X @ theta, aweights=weights, ddof=0)
    assert state.predicted_variance == pytest.approx(predicted, rel=1e-4)


def test_a_foot_that_often_rests_is_no_stuck_output() -> None:
    """Usual rests are learnt: rests of some seconds for minutes, then one of 15 s; a constant minute is detected."""

    def rests(rng: np.random.Generator) -> Iterator[float]:
        while True:
            x = float(rng.uniform(5.0, 20.0))
            yield from [x] * int(rng.integers(5, 50))

    pedal = rests(np.random.default_rng(4))
    state, most = stuck_output.State(), 0.0
    rows = [next(pedal) for _ in range(1500)]
    for k, x in enumerate([*rows, *[7.0] * 75]):
        state = stuck_output.step(state, 0.2 * k, x, 14.0)
        most = max(most, state.level)
    assert most < 14.0
    for k in range(1575, 2600):
        state = stuck_output.step(state, 0.2 * k, 7.0 if k % 90 else math.nan, 14.0)
    assert state.level > 14.0
    assert state.since == pytest.approx(300.0, abs=2.0)


# --- the view ------------------------------------------------------------------------------------


def test_the_live_view_says_since_when_which_block() -> None:
    """One line below the estimators, and again when the model fits again."""

    def drawn(view: View) -> str:
        return plain(render(view, 130, 30))

    assert "monitor" not in drawn(View("test"))
    wrong = MonitorReport(
        330.0, False, 302.0, "vehicle", "the vehicle responds less strongly to the pedal than learnt", {}
    )
    view = update(View("test"), wrong)
    assert "since 5:02.0 the model does not fit; vehicle suspected: the vehicle responds less" in drawn(view)
    again = drawn(update(view, MonitorReport(500.0, True, 490.0, "", "fits: vehicle", {})))
    assert "since 8:10.0 the model fits again; fits: vehicle" in again
    assert "5:02" not in again


@pytest.mark.slow("monitors long drives")
def test_replay_reports_it_on_the_terminal_and_as_json(tmp_path, capsys) -> None:
    """The log alone, through the command: one line with time, block and reason, and the same as JSON."""
    how = {"seed": 912, "minutes": 4.0, "noise": "ar1", "profile": "mixed"}
    changed = BY_NAME["range rate with the wrong sign"].make(Scene(plant_two.plant, how, 180.0))
    measurement.write(changed.drive, tmp_path / "drive.blf")
    lines = tmp_path / "drive.jsonl"
    assert (
        main(
            ["replay", str(tmp_path / "drive.blf"), "--vehicle", str(measurement.LEAN), "--json", str(lines)]
        )
        == 0
    )
    shown = [line for line in capsys.readouterr().out.splitlines() if " monitor " in line]
    assert "misfit" in shown[0]
    assert "the model does not fit; sensing suspected: the gap" in shown[0]
    written = [json.loads(line) for line in lines.read_text().splitlines()]
    screens = [line["screen"] for line in written if "screen" in line]
    first = screens[0]
    assert (first["fits"], first["block"]) == (False, "sensing")
    assert abs(first["since"] - 180.0) < 15.0
    assert set(first) == {"fits", "since", "block", "says", "blocks"}
    assert set(first["blocks"]) == {"driver", "vehicle", "sensing"}
    assert set(first["blocks"]["driver"]) == {"state", "since", "says", "evidence", "needed"}
    assert all("estimator" in line for line in written if not {"screen", "signals"} & set(line))
