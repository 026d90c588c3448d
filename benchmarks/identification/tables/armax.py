"""ARMAX(2,2,1) of Chen & Ulsoy 2001 on a minute: batch, and online at the last sample."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bounds, canid_side, open_loop, peers
from benchmarks.identification.table import Settings, Table, each, rmse, timed

N = 600
NAMES = ("a1", "a2", "b1", "b2", "c1")
# standard deviations beyond which an estimate is no estimate of the same thing
GROSS = 5.0


def table(settings: Settings) -> list[Table]:
    """Print RMSE over the Cramér-Rao bound of every parameter."""
    rows: list[tuple[object, ...]] = []
    methods: list[tuple[str, object]] = [
        ("canid, batch", "batch"),
        ("canid, online at sample 600, nothing forgotten", 1.0),
        ("canid, online at sample 600, live settings", None),
    ]
    methods += [(peer.name, peer) for peer in peers.ARMAX] if settings.peers else []
    for decibel in (10.0, 20.0):
        bound = bounds.table1(settings.first_seed, N, decibel)
        for name, method in methods:
            why = peers.missing(method) if isinstance(method, peers.Peer) else ""
            done = [] if why else each(settings, _run, method, decibel)
            why = why or peers.broken(done)
            rows.append((name, int(decibel), why) if why else _row(name, decibel, done, bound))
    title = f"ARMAX(2,2,1), Chen & Ulsoy 2001 table 1, N = {N} at 10 Hz: RMSE / Cramér-Rao bound"
    return [
        Table(
            title,
            ("method", "dB", *NAMES, "worst", f"runs off by > {GROSS:.0f} bounds", "ms per fit"),
            rows,
            (
                "canid estimates an offset besides, the bound is without it. Online: 15 s batch start, then every sample; "
                "its time is per update.",
            ),
        )
    ]


def _row(
    name: str, decibel: float, done: list[tuple[np.ndarray, float, str]], bound: np.ndarray
) -> tuple[object, ...]:
    error = np.array([theta for theta, *_ in done], float) - open_loop.TABLE1
    ratio = rmse(error) / bound
    off = np.abs(error) > GROSS * bound
    # parameters that a method does not have are no failure of it; a run without any answer is
    gross = int((off.any(axis=1) | ~np.isfinite(error).any(axis=1)).sum())
    ms = 1e3 * float(np.nanmedian([seconds for _, seconds, _ in done]))
    return (name, int(decibel), *map(float, ratio), float(np.nanmax(ratio)), f"{gross} of {len(error)}", ms)


def _run(seed: int, method: object, decibel: float) -> tuple[np.ndarray, float, str]:
    run = open_loop.table1(seed, N, decibel)
    if isinstance(method, peers.Peer):
        return peers.attempt(method, 5, run.y, run.u)
    if method == "batch":
        return *timed(lambda: canid_side.batch(run.y, run.u)), ""
    state, seconds = timed(lambda: _last(run, method))  # type: ignore[arg-type]
    theta = np.full(5, np.nan) if state is None else canid_side.estimates(state)[0]
    return theta, seconds / (N - canid_side.START), ""


def _last(run: open_loop.Armax, forgetting: float | None) -> object:
    state = None
    for _, state in canid_side.recursion(run.y, run.u, forgetting):  # noqa: B007  (the last one is wanted)
        pass
    return state
