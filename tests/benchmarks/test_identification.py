"""The identification benchmark runs, and what it measures against is right by a second route."""

from __future__ import annotations

import doctest
import importlib
import math
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import toeplitz

import benchmarks.identification
from benchmarks.identification import bounds, bus, loop_a, loop_b, noise_models, open_loop, peers
from benchmarks.identification.peers.estimators import BATCH, ONLINE
from benchmarks.identification.peers.rows import Rows
from benchmarks.identification.table import Settings, markdown
from benchmarks.identification.tables import (
    TABLES,
    anytime,
    constancy,
    coverage,
    cuts,
    drift,
    filters,
    floor,
    gain_steps,
    log_score,
    peers_following,
    progress,
    residuals,
    steering,
    tracking,
    urban,
    verdict,
    windup,
)
from canid.values.types import Driver
from tests import seeds
from tests.plants.first_order_lag import answer

ROOT = Path(__file__).parents[2]
MODULES = sorted(
    m.name for m in pkgutil.walk_packages(benchmarks.identification.__path__, "benchmarks.identification.")
)


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Minutes instead of hours of simulated driving."""
    monkeypatch.setattr(tracking, "STEP_AT", 80.0)
    monkeypatch.setattr(tracking, "END", 100.0)
    monkeypatch.setattr(tracking, "DRIFT", 20.0)
    monkeypatch.setattr(tracking, "SINGLE", (0.99,))
    monkeypatch.setattr(windup, "DRIVING", 60.0)
    monkeypatch.setattr(windup, "CRUISE", 60.0)
    monkeypatch.setattr(anytime, "MINUTES", 0.5)
    monkeypatch.setattr(progress, "MINUTES", 3.0)
    monkeypatch.setattr(filters, "MINUTES", (2.0,))
    monkeypatch.setattr(cuts, "MINUTES", (2.0,))
    monkeypatch.setattr(cuts, "DATA", Path("nowhere"))
    monkeypatch.setattr(coverage, "CUTS", (0.2,))
    monkeypatch.setattr(peers_following, "SECONDS", 60.0)
    monkeypatch.setattr(peers_following, "ASKED", (60.0,))
    monkeypatch.setattr(peers_following, "WORLDS", peers_following.WORLDS[2:])
    monkeypatch.setattr(residuals, "SECONDS", 90.0)
    monkeypatch.setattr(residuals, "WORLDS", (residuals.WORLDS[0], residuals.WORLDS[3]))
    monkeypatch.setattr(floor, "SECONDS", 40.0)
    monkeypatch.setattr(steering, "MINUTES", ((1.0, 1), (2.0, 2)))
    monkeypatch.setattr(urban, "MINUTES", 2.0)
    monkeypatch.setattr(drift, "MINUTES", (2.0,))
    monkeypatch.setattr(log_score, "DRIVES", log_score.DRIVES[:1])
    monkeypatch.setattr(verdict, "LEADS", verdict.LEADS[1:2])
    monkeypatch.setattr(gain_steps, "STEP_WORLDS", gain_steps.STEP_WORLDS[::6])
    monkeypatch.setattr(gain_steps, "CLEAN_WORLDS", gain_steps.CLEAN_WORLDS[::10])
    monkeypatch.setattr(gain_steps, "CLEAN_S", 300.0)
    monkeypatch.setattr(constancy, "WORLDS", constancy.WORLDS[::2])
    monkeypatch.setattr(constancy, "SHARES", (0.0, 0.2))
    monkeypatch.setattr(constancy, "DRIVE_S", 400.0)


def drawn() -> list[Any]:
    """A third of the tables in each run, all of them with CANID_ALL_CASES=1."""
    return seeds.in_turn(TABLES, 3, "tables of identification")


@pytest.mark.parametrize(
    ("name", "table"), drawn(), ids=lambda given: given if isinstance(given, str) else ""
)
def test_every_table_prints_numbers(name: str, table) -> None:  # type: ignore[no-untyped-def]
    """Each table says something finite of canid, in every part, without any peer."""
    parts = table(Settings(runs=2, first_seed=7, peers=False))
    filled = [part for part in parts if part.rows]
    assert filled
    for part in filled:
        cells = [cell for row in part.rows for cell in row[1:]]
        finite = [c for c in cells if isinstance(c, int | float | np.floating) and math.isfinite(c)]
        # a share, or a bias and its error, in one cell
        composed = [c for c in cells if isinstance(c, str) and re.match(r"[-+]?\d+(\.\d+)? ", c)]
        assert finite or composed, part.title
        assert markdown(part).count("|") > len(part.columns)


def test_the_command_prints_one_table_and_knows_no_other() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "identification")]
    done = subprocess.run(
        [*command, "--only", "armax", "--runs", "2", "--no-peers"], capture_output=True, text=True, check=True
    )
    assert "canid, batch" in done.stdout
    assert "seeds 50000 to 50001" in done.stdout
    assert subprocess.run([*command, "--only", "nothing"], capture_output=True).returncode == 2


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_the_benchmark_are_true(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_the_bound_of_table_1_is_that_of_the_reference() -> None:
    """Fisher's information of Chen & Ulsoy's driver, as an independent script had it (10 and 20 dB)."""
    # 5 %: both average over 20 runs, whose inputs differ
    np.testing.assert_allclose(bounds.table1(0, 600, 10.0), [0.0271, 0.0261, 0.165, 0.162, 0.0431], rtol=0.05)
    np.testing.assert_allclose(
        bounds.table1(0, 600, 20.0), [0.0089, 0.0088, 0.0539, 0.0537, 0.0365], rtol=0.05
    )


@pytest.mark.parametrize("noise", noise_models.NOISE_MODELS, ids=lambda c: c.name)
def test_whitening_is_the_inverse_of_the_covariance(noise: noise_models.NoiseModel) -> None:
    """The bound by the Kalman filter equals the bound by the dense covariance of the same noise."""
    dt, n = 0.1, 150
    F, P, h = noise_models.model(noise, dt)
    power, acf = np.eye(len(h)), []
    for _ in range(n):
        acf.append(float(h @ power @ P @ h))
        power = power @ F
    S = toeplitz(acf) + noise.white * np.eye(n)
    X = np.random.default_rng(0).standard_normal((n, 3)).cumsum(axis=0)
    W = noise_models.whiten(X, noise, dt)
    np.testing.assert_allclose(W.T @ W, X.T @ np.linalg.solve(S, X), rtol=1e-6)


def test_the_driver_answers_as_his_differential_equation_says() -> None:
    """The sampled answer is that of tau x' + x = u(t - theta), integrated in small steps."""
    dt, tau, theta, fine = 0.1, 0.4, 0.237, 1000
    u = np.random.default_rng(0).standard_normal(60).cumsum()
    t = np.arange(len(u)) * dt
    step = dt / fine
    at = np.arange((len(u) - 1) * fine + 1) * step
    late = np.interp(at - theta, t, u)
    x = np.empty_like(late)
    x[0] = u[0]
    for k in range(1, len(late)):
        x[k] = x[k - 1] + step / tau * (0.5 * (late[k] + late[k - 1]) - x[k - 1])
    np.testing.assert_allclose(answer(u, dt, tau, theta), x[::fine], atol=2e-3)


@pytest.mark.parametrize("loop", [loop_a, loop_b], ids=["A", "B"])
def test_the_drivers_of_the_loops_answer_by_their_stated_truth(loop) -> None:  # type: ignore[no-untyped-def]
    """Without a remnant, the pedal is the stated K, tau and dead time on the inputs of the same drive."""
    drive = loop.drive(3, 60.0, remnant=0.0)
    parts = [
        c.K * answer(u, drive.dt, c.tau, c.dead_time)
        for u, c in zip(drive.inputs, drive.channels, strict=True)
    ]
    skip = round(10.0 / drive.dt)
    rest = (drive.pedal - sum(parts))[skip:][drive.exact[skip:]]
    # an 8-bit pedal of 0.4 % is in loop B: half a step
    assert np.abs(rest - np.median(rest)).max() < 0.25


def test_a_clean_drive_arrives_the_same_by_lines_and_through_canid() -> None:
    """Both ways to 10 Hz see the same drive at the same times."""
    drive = loop_a.drive(5, 30.0)
    driver = Driver(headway_desired=drive.headway_desired)
    streams = bus.sensed(drive, 5, noisy=False)
    plain, ours = bus.by_lines(streams, driver), bus.through_canid(streams, driver)
    n = min(len(plain.output), len(ours.output)) - 20
    lags = range(-5, 6)
    # canid begins its grid where every role has begun: find the whole number of samples between the two
    best = min(lags, key=lambda k: float(np.nansum((plain.output[10 + k : n + k] - ours.output[10:n]) ** 2)))
    np.testing.assert_allclose(plain.output[10 + best : n + best], ours.output[10:n], atol=1e-9)
    np.testing.assert_allclose(plain.inputs[10 + best : n + best], ours.inputs[10:n], atol=0.1)


def test_a_peer_that_is_not_there_or_breaks_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = peers.Peer("nobody", len, "no_such_module_anywhere")
    assert peers.missing(absent) == "not installed: pip install 'canid[bench]'"
    answer, _, why = peers.attempt(peers.Peer("len", len), 3, 5)
    assert np.isnan(answer).all()
    assert why.startswith("breaks: TypeError: ")
    assert peers.broken([(answer, why), (answer, "")]) == ""


def test_a_peer_without_dependencies_recovers_the_truth() -> None:
    """The recipe's dead time is off by half a sample at most, so the peers' data and units are canid's."""
    run = open_loop.process(1, open_loop.Case(noise_models.WHITE, decibel=40.0))
    recipe = next(p for p in peers.PROCESS if "curve_fit" in p.name)
    np.testing.assert_allclose(
        peers.call(recipe, run.y, run.u, run.dt, run.settle), [4.4, 0.685, 0.3], atol=0.02
    )


def policy(seed: int, alpha: float, beta: float, headway: float) -> Rows:
    """Two minutes of a vehicle that follows by constant time headway and relative velocity, in Euler steps."""
    rng = np.random.default_rng(seed)
    n, dt, v = 1200, 0.1, 20.0
    s, lead, out = headway * v, np.empty(n), np.empty((n, 3))
    lead[:] = 20.0 + 3.0 * np.sin(0.2 * dt * np.arange(n)) + 0.05 * rng.standard_normal(n).cumsum()
    for k in range(n):
        a = alpha * (s - headway * v) + beta * (lead[k] - v) + 0.02 * rng.standard_normal()
        out[k] = a, v, s
        s, v = s + dt * (lead[k] - v), v + dt * a
    accel, speed, gap = out.T
    inputs = np.column_stack([gap / speed - headway, lead - speed])
    return Rows(dt, accel, inputs, np.full(n, True), np.zeros(n), speed, gap, 1.0, 0.02)


@pytest.mark.parametrize("method", ONLINE, ids=lambda peer: peer.name)
def test_the_online_peers_find_a_policy_that_is_their_own_model(method: peers.Peer) -> None:
    """Where constant time headway is the truth, K1 and K2 of every published filter are within a fifth of it."""
    if peers.missing(method):
        pytest.skip(peers.missing(method))
    rows = policy(0, 0.05, 0.6, 1.5)
    *_, (_, answer) = peers.call(method, rows)
    # the particle filter's cloud is as wide as its random walk
    np.testing.assert_allclose(answer.value[:2], [0.05 * rows.speed.mean(), 0.6], rtol=0.2)
    assert np.isnan(answer.value[2])


def test_a_masked_row_teaches_no_peer_anything() -> None:
    """Outputs that are not usable may be anything: no batch peer's answer moves."""
    rows = policy(1, 0.05, 0.6, 1.5)
    usable = np.arange(len(rows.output)) % 200 > 40
    spoilt = np.where(usable, rows.output, 99.0)
    for method in (BATCH[0], BATCH[2]):
        one = peers.call(method, rows._replace(usable=usable))
        other = peers.call(method, rows._replace(usable=usable, output=spoilt))
        np.testing.assert_allclose(one.value, other.value, rtol=1e-6)
