"""The screen beside the estimators is silent on clean drives, and tells since when which block does not fit."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator

import numpy as np
import pytest
from rich.console import Console

from benchmarks.hidden_effects import plant_one, plant_two, sensed
from benchmarks.midway import CHANGES, Changed, Scene
from benchmarks.screen import Alarm, alarms, kinds, samples, screened
from canid import pipeline
from canid.cli import main
from canid.saving.knowledge import go_on, keeping
from canid.saving.plain import form
from canid.screening import evidence, held, reference, watch
from canid.simulation import frames, simulate
from canid.types import Sample, Screened, Watch
from canid.vehicle import read_vehicle
from canid.views.screen import View, render, update

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


def told(changed: Changed) -> list[Alarm]:
    """What the screen says of it, in time since the change."""
    said = alarms(screened(sensed.trace(changed.drive)))
    return [a._replace(t=a.t - changed.at, since=a.since - changed.at) for a in said]


def test_clean_drives_are_silent_and_seen() -> None:
    """Twelve drives of both simulators and all noises: no word, and each block fits in the end."""
    every = kinds(4100)
    for _ in range(12):
        plant, how = next(every)
        said = screened(sensed.trace(plant({}, minutes=6.0, **how)))
        assert alarms(said) == [], how
        assert {of.state for of in said[-1].blocks.values()} == {Watch.FITS}, how
        assert said[-1].fits
        assert math.isnan(said[-1].since)


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
def test_a_sensor_that_fails_is_told_within_half_a_minute(name: str, simulator: str) -> None:
    """Sensing is suspected, nobody before; since when is right within some seconds."""
    said = told(planted(name, simulator, 510 + len(name)))
    assert said[0].block == "sensing"
    assert 0.0 < said[0].t < 30.0
    assert abs(said[0].since) < 15.0


@pytest.mark.parametrize(
    ("name", "block", "seeds"),
    [
        ("gains fall by 60 %", "driver", range(620, 624)),
        ("engine pulls 40 % less", "vehicle", range(622, 624)),
    ],
)
def test_another_driver_or_car_is_told_and_not_taken_for_the_other(name, block, seeds) -> None:
    """Three of four drives at least: slow noise can hide a driver's change for minutes, a level road a car's.

    Never is another block suspected first, nor anything before the change.
    """
    every = [told(planted(name, simulator, seed)) for simulator in PLANTS for seed in seeds]
    first = [said[0] for said in every if said]
    assert len(first) >= 0.75 * len(every)
    assert {a.block for a in first} == {block}
    assert min(a.t for a in first) > 0.0
    # in a closed loop the inputs move together: how it does not fit is a hint, and mostly right
    right = ["less strongly than learnt" in a.says or "worse" in a.says for a in first]
    assert np.mean(right) >= 0.75
    assert abs(np.median([a.since for a in first])) < 30.0


def test_a_pedal_that_stands_still_is_the_sensors_fault() -> None:
    """Held to the last bit while the car moves otherwise: not the driver, not the car, and known to the second."""
    changed = planted("pedal stands still", "two", 701)
    said = told(changed)
    assert said[0].t > 0.0
    last = said[-1]
    assert last.says == "the driver's output stands still, and the car moves otherwise"
    assert last.block == "sensing"
    assert abs(last.since) < 2.0


def test_after_a_change_the_model_learns_and_fits_again() -> None:
    """Nothing is wrong for ever: what the drive has become is learnt."""
    changed = planted("gains fall by 60 %", "one", 622)
    said = screened(sensed.trace(changed.drive))
    suspected = [s for s in said if not s.fits]
    assert {s.block for s in suspected} == {"driver"}
    # as long as something is suspected it is repeated, at least every 10 s
    assert np.diff([s.t for s in suspected]).max() < 10.5
    assert said[-1].fits
    assert said[-1].since > suspected[0].t


def test_lane_keeping_is_watched_too() -> None:
    vehicle = read_vehicle("generic_lane")
    drive = simulate(minutes=4, seed=3, profile="lane", noise="ar1")
    running = pipeline.build(vehicle)
    said = [x for _, x in pipeline.run(running, frames(drive, vehicle)) if isinstance(x, Screened)]
    assert said[-1].blocks["driver"].state is Watch.FITS
    assert alarms(said) == []


# --- weak data -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clean() -> list[Sample]:
    """Five minutes of following."""
    drive = plant_one.plant({}, seed=33, minutes=5.0, noise="ar1", profile="urban")
    return list(samples(sensed.trace(drive)))


def run(of: list[Sample], names: tuple[str, ...] = NAMES) -> list[Screened]:
    screen = watch.make(names)
    state, said = screen.init(), []
    for sample in of:
        state, now = screen.step(state, sample)
        said += [now] if now is not None else []
    return said


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
    """From the start without these signals: a sentence that names them, and no suspicion."""
    left = [
        s._replace(signals={} if gone is None else {k: v for k, v in s.signals.items() if k not in gone})
        for s in clean
    ]
    said = run(left)
    assert alarms(said) == []
    assert {b for b, of in said[-1].blocks.items() if of.state is Watch.UNSEEN} == unseen
    for block in unseen:
        assert said[-1].blocks[block].says.startswith("needs ")


def test_signals_that_vanish_become_unseen_within_a_minute(clean) -> None:
    nothing = [s._replace(output=math.nan, inputs=(math.nan,) * 2, learn=False, signals={}) for s in clean]
    said = run([s if s.t < 150.0 else nothing[k] for k, s in enumerate(clean)])
    late = [s for s in said if s.t > 210.0]
    assert late
    assert {of.state for s in late for of in s.blocks.values()} == {Watch.UNSEEN}
    assert alarms(said) == []


def test_no_number_breaks_it_and_none_stays_in_memory(clean) -> None:
    """NaN, infinite and absurd values anywhere for half a minute: no exception, no warning; later it sees again."""
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
    said = run(bad)
    assert {of.state for of in said[-1].blocks.values()} == {Watch.FITS}
    for s in said:
        assert all(math.isfinite(of.evidence) for of in s.blocks.values())


def test_constant_signals_are_no_news(clean) -> None:
    """A car that is driven by nobody with everything at rest gives statuses, not a singular matrix."""
    first = clean[100]
    still = [s._replace(output=12.0, inputs=first.inputs, learn=True, signals=first.signals) for s in clean]
    said = run(still)
    assert said[-1].blocks["vehicle"].state is not Watch.MISFIT
    # an output that never moved was never another one: nothing was learnt that could have ended
    assert said[-1].blocks["sensing"].state is not Watch.MISFIT


# --- a restart -----------------------------------------------------------------------------------


def test_its_state_survives_as_plain_values_to_the_last_bit() -> None:
    """Saved at any moment, before and while something is suspected: the same words afterwards."""
    changed = planted("range rate with the wrong sign", "one", 810)
    every = list(samples(sensed.trace(changed.drive)))
    screen, plain = watch.make(NAMES), form(watch.State)
    state, states, said = screen.init(), [], []
    for sample in every:
        state, now = screen.step(state, sample)
        states.append(state)
        said.append(now)
    rng = np.random.default_rng(2)
    after = int(np.searchsorted([s.t for s in every], changed.at + 20.0))
    for k in (0, 3, 700, after, *rng.integers(800, len(every) - 200, 3).tolist()):
        back = plain.decode(json.loads(json.dumps(plain.encode(states[k]))))
        assert repr(back) == repr(states[k])
        for i in range(k + 1, min(k + 200, len(every))):
            back, now = screen.step(back, every[i])
            assert repr(now) == repr(said[i])
    assert any(s is not None and not s.fits for s in said)


def test_after_a_restart_it_still_suspects_and_says_since_before() -> None:
    """A new session's clock begins at 0; what began before it has a time below 0."""
    changed = planted("range rate with the wrong sign", "two", 811)
    vehicle = sensed.lean()
    running = pipeline.build(vehicle)
    every = sensed.frames(changed.drive, vehicle)
    state, begin = running.init(), changed.at + 25.0
    for frame in every:
        if frame.t >= begin:
            break
        state, _ = running.step(state, frame)
    known = pipeline.known(state)
    assert known is not None
    keep = keeping(vehicle, running)
    again, event = go_on(running, keep, keep.save(known, 1e9), 1e9 + 60.0)
    assert event.what == "state_restored"
    said = []
    for frame in every:
        if begin <= frame.t < begin + 12.0:
            again, out = running.step(again, frame._replace(t=round(frame.t - begin, 9)))
            said += [x for x in out if isinstance(x, Screened)]
    assert said
    assert said[0].block == "sensing"
    assert said[0].t < 12.0
    assert said[0].since == pytest.approx(-25.0, abs=10.0)


# --- its parts -----------------------------------------------------------------------------------


def test_evidence_is_a_fair_bet_whatever_the_noise() -> None:
    """On average nobody wins against a model that is off by no more than allowed, for all two-sided noise.

    Symmetric noise is a mixture of ±a, so ±a is all there is to check; variance is a mere scale and may be wrong.
    """
    for a in np.geomspace(0.01, 30.0, 13):
        for allowed in (0.0, 0.1, 1.0, 4.0):
            for off in np.linspace(-allowed, allowed, 5):
                for z in (0.05, -0.7, 5.0):
                    won = [
                        np.exp(
                            evidence.step(
                                evidence.init(1),
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


def test_what_is_learnt_is_least_squares_with_exponential_weights() -> None:
    """Look by look as the textbook does at once, up to the ridge."""
    rng = np.random.default_rng(8)
    looks = [
        np.column_stack([rng.standard_normal((int(n), 2)), np.ones(int(n))]) for n in rng.integers(1, 10, 40)
    ]
    outcomes = [x @ [2.0, -1.0, 0.5] + rng.standard_normal(len(x)) for x in looks]
    memory, state = 60.0, reference.init(3)
    for x, y in zip(looks, outcomes, strict=True):
        state = reference.learn(state, x, y, np.arange(3), memory)
    behind = np.cumsum([len(x) for x in looks][::-1])[::-1] - [len(x) for x in looks]
    weights = np.concatenate(
        [np.full(len(x), (1 - 1 / memory) ** b) for x, b in zip(looks, behind, strict=True)]
    )
    root = np.sqrt(weights)
    X, y = np.concatenate(looks), np.concatenate(outcomes)
    theta = np.linalg.lstsq(root[:, None] * X, root * y, rcond=None)[0]
    np.testing.assert_allclose(state.theta, theta, atol=1e-5)
    assert state.rows == pytest.approx(weights.sum())
    foretold = np.cov(X @ theta, aweights=weights, ddof=0)
    assert state.foretold == pytest.approx(foretold, rel=1e-4)


def test_who_often_rests_his_foot_is_not_told() -> None:
    """What is usual is learnt: rests of some seconds for minutes, then one of 15 s; held for a minute it is told."""

    def rests(rng: np.random.Generator) -> Iterator[float]:
        while True:
            x = float(rng.uniform(5.0, 20.0))
            yield from [x] * int(rng.integers(5, 50))

    foot = rests(np.random.default_rng(4))
    state, most = held.State(), 0.0
    rows = [next(foot) for _ in range(1500)]
    for k, x in enumerate([*rows, *[7.0] * 75]):
        state = held.step(state, 0.2 * k, x, 14.0)
        most = max(most, state.level)
    assert most < 14.0
    for k in range(1575, 2600):
        state = held.step(state, 0.2 * k, 7.0 if k % 90 else math.nan, 14.0)
    assert state.level > 14.0
    assert state.since == pytest.approx(300.0, abs=2.0)


# --- the view ------------------------------------------------------------------------------------


def test_the_live_view_says_since_when_which_block() -> None:
    """One line below the estimators, told again when nothing is amiss any more."""

    def drawn(view: View) -> str:
        out = io.StringIO()
        Console(file=out, width=110).print(render(view))
        return out.getvalue()

    assert "screen" not in drawn(View("test"))
    wrong = Screened(330.0, False, 302.0, "vehicle", "it answers the pedal less strongly than learnt", {})
    view = update(View("test"), wrong)
    assert "since 5:02.0 the model does not fit; vehicle suspected: it answers the pedal less" in drawn(view)
    again = drawn(update(view, Screened(500.0, True, 490.0, "", "fits what was learnt: vehicle", {})))
    assert "since 8:10.0 nothing is amiss any more; fits what was learnt: vehicle" in again
    assert "5:02" not in again


def test_replay_says_it_on_the_terminal_and_as_json(tmp_path, capsys) -> None:
    """The log alone, through the command: one line with time, block and reason, and the same as JSON."""
    how = {"seed": 912, "minutes": 4.0, "noise": "ar1", "profile": "mixed"}
    changed = BY_NAME["range rate with the wrong sign"].make(Scene(plant_two.plant, how, 180.0))
    sensed.write(changed.drive, tmp_path / "drive.blf")
    lines = tmp_path / "drive.jsonl"
    assert (
        main(["replay", str(tmp_path / "drive.blf"), "--vehicle", str(sensed.LEAN), "--json", str(lines)])
        == 0
    )
    shown = [line for line in capsys.readouterr().out.splitlines() if "screen" in line]
    assert "misfit" in shown[0]
    assert "the model does not fit; sensing suspected: the gap" in shown[0]
    told = [json.loads(line) for line in lines.read_text().splitlines()]
    screens = [line["screen"] for line in told if "screen" in line]
    first = screens[0]
    assert (first["fits"], first["block"]) == (False, "sensing")
    assert abs(first["since"] - 180.0) < 15.0
    assert set(first) == {"fits", "since", "block", "says", "blocks"}
    assert set(first["blocks"]) == {"driver", "vehicle", "sensing"}
    assert set(first["blocks"]["driver"]) == {"state", "since", "says", "evidence", "needed"}
    assert all("estimator" in line for line in told if "screen" not in line)
