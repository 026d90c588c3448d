"""Do 95 % intervals hold the truth in 95 % of the runs, whatever the noise and the input."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import canid_side, loop_a, open_loop, peers
from benchmarks.identification.bus import GRID, exactly
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT, NoiseModel
from benchmarks.identification.open_loop import Case
from benchmarks.identification.table import Settings, Table, each, held

CUTS = (0.05, 0.1, 0.2, 0.5)  # Hz
TARGET = 0.90  # least share of every case
PRINTED = 0.88  # a case with a lower share gets a row
FIELDS = ("K", "tau", "dead_time", "tau_plus_dead_time")


def table(settings: Settings) -> list[Table]:
    """Print how often each interval holds the truth, and how often it was reported."""
    rows: list[tuple[object, ...]] = []
    notes = []
    for title, seconds, every, share in (
        ("20 s at 100 Hz", 20.0, 1, 1),
        ("60 s at 10 Hz", 60.0, 10, 1),
    ):
        some = settings.few(share) if share > 1 else settings
        counted: list[float] = []
        low = 0
        for noise in NOISE_MODELS:
            for cut in CUTS:
                done = each(some, _canid, noise, cut, seconds, every)
                cells = [(_share(done, i), _reported(done, i)) for i in range(len(FIELDS))]
                # a share of a few intervals says nothing of a limit
                enough = [share for share, number in cells if number >= 0.25 * some.runs]
                counted += enough
                low += min(enough, default=1.0) < TARGET
                if min(enough, default=1.0) < PRINTED:
                    rows.append((title, noise.name, cut, *_cells(done)))
        of = len(NOISE_MODELS) * len(CUTS)
        notes.append(
            f"{title}: {of} cases of noise and input, {some.runs} runs each; of {len(counted)} shares that were reported "
            f"in at least a quarter of the runs the least is {min(counted, default=np.nan):.3f}, "
            f"the mean {np.mean(counted) if counted else np.nan:.3f}; {low} cases have one below {TARGET:.2f}, "
            f"printed are those below {PRINTED:.2f}."
        )
    if settings.peers:
        rows += _peers(settings)
        notes.append(f"Peers: {settings.few(4).runs} runs.")
    return [
        Table(
            "Coverage of 95 % intervals, 20 dB",
            ("data", "noise", "input Hz", "K", "tau", "dead time", "tau + dead time"),
            rows,
            tuple(notes),
        ),
        _closed(settings),
    ]


def _closed(settings: Settings) -> Table:
    rows: list[tuple[object, ...]] = []
    for noise in (*NOISE_MODELS, REMNANT):
        done = each(settings.few(2), _loop, noise)
        rows.append((noise.name, *_cells(done)))
    return Table(
        "Coverage of canid's 95 % intervals, closed loop A by the remnant's noise model, 60 s, inputs without sensor",
        ("remnant", "K1", "K2", "tau2", "dead time 2", "tau2 + dead time 2"),
        rows,
        (f"{settings.few(2).runs} runs a row, share of reported intervals that hold the true value.",),
    )


def _loop(seed: int, noise: NoiseModel) -> list[bool | None]:
    drive = loop_a.drive(seed, 60.0 + open_loop.HISTORY, noise_model=noise)
    seen = exactly(drive)
    one, two = drive.channels
    first, second = canid_side.process(seen.output, seen.inputs, GRID).channels
    truth = (two.K, two.tau, two.dead_time, two.tau + two.dead_time)
    return [
        canid_side.inside(first, "K", one.K),
        *(canid_side.inside(second, field, x) for field, x in zip(FIELDS, truth, strict=True)),
    ]


def _peers(settings: Settings) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for peer in peers.INTERVALS:
        for noise in NOISE_MODELS:
            if why := peers.missing(peer):
                rows.append((peer.name, noise.name, why))
                continue
            done = each(settings.few(4), _peer, peer, noise)
            rows.append((peer.name, noise.name, Case(noise).cut, *_cells(done)[:3], "–"))
    return rows


def _reported(done: list[list[bool | None]], i: int) -> int:
    return sum(run[i] is not None for run in done)


def _share(done: list[list[bool | None]], i: int) -> float:
    known = [bool(run[i]) for run in done if run[i] is not None]
    return float(np.mean(known)) if known else np.nan


def _cells(done: list[list[bool | None]]) -> list[str]:
    return [held(_share(done, i), _reported(done, i), len(done)) for i in range(len(done[0]))]


def _canid(seed: int, noise: NoiseModel, cut: float, seconds: float, every: int) -> list[bool | None]:
    run = open_loop.process(seed, Case(noise, cut, seconds=seconds), every=every)
    channel = canid_side.process(run.y, run.u[:, None], run.dt).channels[0]
    truth = (run.K, run.tau, run.dead_time, run.tau + run.dead_time)
    return [canid_side.inside(channel, field, x) for field, x in zip(FIELDS, truth, strict=True)]


def _peer(seed: int, peer: peers.Peer, noise: NoiseModel) -> list[bool | None]:
    run = open_loop.process(seed, Case(noise))
    value, sd = peers.call(peer, run.y, run.u, run.dt, run.settle)
    error = np.abs(np.asarray(value) - (run.K, run.tau, run.dead_time))
    return [bool(e <= 1.96 * s) if np.isfinite(s) else None for e, s in zip(error, sd, strict=True)]
