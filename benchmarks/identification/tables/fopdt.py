"""First order plus dead time on 20 s at 100 Hz, dead time between two samples."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bounds, canid_side, open_loop, peers
from benchmarks.identification.noise_models import NOISE_MODELS, NoiseModel
from benchmarks.identification.open_loop import Case, Process
from benchmarks.identification.table import Settings, Table, each, rmse, timed

DEAD_TIME = 0.3137  # s, on no grid
GROSS = 5.0


def table(settings: Settings) -> list[Table]:
    """Print the worst RMSE over the Cramér-Rao bound of K, tau and dead time, by noise."""
    worst: list[tuple[object, ...]] = []
    methods: list[tuple[str, object]] = [("canid, 100 Hz", 1), ("canid, 10 Hz point samples", 10)]
    methods += [(peer.name, peer) for peer in peers.PROCESS] if settings.peers else []
    for name, method in methods:
        if isinstance(method, peers.Peer) and (why := peers.missing(method)):
            worst.append((name, why))
            continue
        done = [each(settings, _run, method, noise) for noise in NOISE_MODELS]
        if why := next(filter(None, map(peers.broken, done)), ""):
            worst.append((name, why))
            continue
        ratio, off, ms = zip(*map(_figures, done), strict=True)
        worst.append((name, *ratio, max(off), max(ms)))
    return [
        Table(
            f"K 4.4, tau 0.685 s, dead time {DEAD_TIME} s; 20 s at 100 Hz, input below 0.2 Hz, 20 dB: "
            "worst RMSE / Cramér-Rao bound of K, tau and dead time",
            (
                "method",
                *(noise.name for noise in NOISE_MODELS),
                f"off by > {GROSS:.0f} bounds, most",
                "ms per fit, most",
            ),
            worst,
            (
                "Each error is divided by the bound of its own run, at 100 Hz with the noise model known. "
                f"Off: of {settings.runs} runs of the worst noise.",
            ),
        ),
    ]


def _figures(done: list[tuple[np.ndarray, float, str]]) -> tuple[float, int, float]:
    """Return the worst ratio, how many runs are off by more than GROSS bounds, and ms per fit."""
    relative = np.array([error for error, *_ in done])
    ratio = rmse(relative)
    gross = (np.abs(relative) > GROSS).any(axis=1) | ~np.isfinite(relative).all(axis=1)
    ms = 1e3 * float(np.nanmedian([seconds for _, seconds, _ in done]))
    return float(np.max(ratio)), int(gross.sum()), ms


def _run(seed: int, method: object, noise: NoiseModel) -> tuple[np.ndarray, float, str]:
    run = open_loop.process(seed, Case(noise, dead_time=DEAD_TIME))
    bound = bounds.of(run)
    why = ""
    if isinstance(method, peers.Peer):
        answer, seconds, why = peers.attempt(method, 3, run.y, run.u, run.dt, run.settle)
    else:
        answer, seconds = timed(lambda: _canid(run, method))  # type: ignore[arg-type]
    error = np.asarray(answer, float) - (run.K, run.tau, run.dead_time)
    return error / (bound.K, bound.tau, bound.dead_time), seconds, why


def _canid(run: Process, every: int) -> np.ndarray:
    fit = canid_side.process(run.y[::every], run.u[::every, None], run.dt * every)
    return np.array([fit.point.K[0], fit.point.tau[0], fit.point.dead_time[0]])
