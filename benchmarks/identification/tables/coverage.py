"""Do 95 % intervals hold the truth in 95 % of the runs, whatever the noise and the input."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import canid_side, open_loop, peers
from benchmarks.identification.noise_models import NOISE_MODELS, NoiseModel
from benchmarks.identification.open_loop import Case
from benchmarks.identification.table import Settings, Table, each, held

CUTS = (0.05, 0.1, 0.2, 0.5)  # Hz
TARGET = 0.90  # least share of every case
PEER_NOISES = (NOISE_MODELS[0], NOISE_MODELS[3])  # without and with autocorrelation
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
        cases: list[tuple[float, tuple[object, ...]]] = []
        for noise in NOISE_MODELS:
            for cut in CUTS:
                done = each(some, _canid, noise, cut, seconds, every)
                cells = [(_share(done, i), _reported(done, i)) for i in range(len(FIELDS))]
                # a share of a few intervals says nothing of a limit
                enough = [share for share, number in cells if number >= 0.25 * some.runs]
                counted += enough
                cases.append((min(enough, default=1.0), (title, noise.name, cut, *_cells(done))))
        lowest = min(least for least, _ in cases)
        rows += [row for least, row in cases if least < PRINTED or least == lowest]
        low, of = sum(least < TARGET for least, _ in cases), len(cases)
        notes.append(
            f"{title}: {low} of {of} cases have a share below {TARGET:.2f}; of {len(counted)} shares the least is "
            f"{min(counted, default=np.nan):.3f}, the mean {np.mean(counted) if counted else np.nan:.3f}."
        )
    notes.append(
        f"{settings.runs} runs a case; shares of what was reported, in at least a quarter of the runs. "
        f"Printed: cases with a share below {PRINTED:.2f}, or the lowest."
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
        )
    ]


def _peers(settings: Settings) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for peer in peers.INTERVALS:
        for noise in PEER_NOISES:
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
