"""What an update costs in ms, and what a small least-squares problem costs on the same machine."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.identification import bus, canid_side, loop_a, open_loop, peers
from benchmarks.identification.bus import Seen
from benchmarks.identification.open_loop import HISTORY
from benchmarks.identification.peers import process
from benchmarks.identification.table import Settings, Table
from benchmarks.identification.tables.following import SECONDS, seen_by_canid
from canid.mathematics.estimators import ESTIMATORS
from canid.values.types import LearnGate, Sample

NAMES = ("headway_error", "range_rate")


def unit() -> float:
    """Return the best CPU time in s of one least-squares solution of 600 rows and 8 columns."""
    rng = np.random.default_rng(0)
    X, y = rng.standard_normal((600, 8)), rng.standard_normal(600)
    return min(_cpu(lambda: np.linalg.lstsq(X, y, rcond=None)) for _ in range(200))


def table(settings: Settings) -> list[Table]:
    """Print update times of both estimators at 10 and 100 Hz."""
    one = unit()
    rows: list[tuple[object, ...]] = []
    seen = seen_by_canid(loop_a.drive(settings.first_seed, SECONDS), settings.first_seed)
    repeat = 3 + min(settings.runs, 20)
    cold = [
        _cpu(lambda: canid_side.process(seen.output, seen.inputs, bus.GRID, seen.usable))
        for _ in range(repeat)
    ]
    rows.append(("fit_process, 60 s at 10 Hz, cold", "", 1e3 * float(np.median(cold)), ""))
    for dt in (0.1, 0.01):
        shares = 0.0
        # at 100 Hz the window fills more slowly than patience does: a few runs are a quick check
        seconds = 75.0 if dt == 0.1 or settings.runs >= 20 else 25.0
        drive = loop_a.drive(settings.first_seed, seconds + 1.0)
        every = round(dt / drive.dt)
        y, u = drive.pedal[::every], np.column_stack(drive.inputs)[::every]
        for estimator in (one.make(NAMES, dt) for one in ESTIMATORS):
            state, plain, reported = estimator.init(), [], []
            late = seconds - 10.0  # the window is full by then
            for k in range(round(seconds / dt)):
                sample = Sample(k * dt, float(y[k]), tuple(u[k].tolist()), LearnGate.OPEN, True, 0, {})
                before = time.process_time()
                state, estimate = estimator.step(state, sample)
                passed = time.process_time() - before
                if sample.t >= late:
                    (plain if estimate is None else reported).append(passed)
            share = (sum(plain) + sum(reported)) / 10.0
            shares += share
            label = f"{estimator.name}, {1 / dt:.0f} Hz"
            # the mean: some samples complete a block, and pay for it
            ms = (1e3 * float(np.mean(plain) if plain else np.nan), 1e3 * float(np.median(reported)))
            rows.append((label, *ms, f"{100 * share:.2f} %"))
        rows.append((f"all estimators, {1 / dt:.0f} Hz", "", "", f"{100 * shares:.2f} %"))
    rows += _peers(settings, seen) if settings.peers else []
    return [
        Table(
            "Time of an update, two inputs, 60 s window",
            ("what", "ms per sample", "ms with an estimate", "of a core"),
            rows,
            (
                f"One numpy.linalg.lstsq of 600 x 8 takes {1e6 * one:.0f} µs here. "
                "CPU time, the last 10 s; per sample the mean, else medians.",
            ),
        )
    ]


def _peers(settings: Settings, seen: Seen) -> list[tuple[object, ...]]:
    """Time what peers offer for the same: a refit of the window, and one update of a recursion without C."""
    settle = round(HISTORY / bus.GRID)
    u = list(seen.inputs.T)
    refit = [_cpu(lambda: process.joint(seen.output, u, bus.GRID, settle)) for _ in range(5)]
    rows: list[tuple[object, ...]] = [
        ("scipy curve_fit recipe, 60 s at 10 Hz, two inputs", "", 1e3 * float(np.median(refit)), "")
    ]
    run = open_loop.table1(settings.first_seed, 600, 20.0)
    for peer in peers.TRACKING:
        if why := peers.missing(peer):
            rows.append((peer.name, why))
            continue
        seconds = min(_cpu(lambda peer=peer: list(peers.call(peer, run.y, run.u))) for _ in range(3))
        rows.append((f"{peer.name}, one input", 1e3 * float(seconds / 600), "", ""))
    return rows


def _cpu(function) -> float:  # type: ignore[no-untyped-def]
    before = time.process_time()
    function()
    return time.process_time() - before
