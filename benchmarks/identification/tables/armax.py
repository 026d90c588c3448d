"""ARMAX(2,2,1) of Chen & Ulsoy 2001 on a minute: batch, and online at the last sample."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bounds, canid_side, open_loop, peers
from benchmarks.identification.table import Settings, Table, each, rmse, timed

N = 600
NAMES = ("a1", "a2", "b1", "b2", "c1")
# standard deviations beyond which an estimate is no estimate of the same thing
GROSS = 5.0
# relative difference of all ratios below which two implementations are of one method
SAME = 0.01


def table(settings: Settings) -> list[Table]:
    """Print the worst RMSE over the Cramér-Rao bound; implementations with the same numbers share a row."""
    rows: list[tuple[object, ...]] = []
    methods: list[tuple[str, object]] = [
        ("canid, batch", "batch"),
        ("canid, online at sample 600, nothing forgotten", 1.0),
        ("canid, online at sample 600, live settings", None),
    ]
    methods += [(peer.name, peer) for peer in peers.ARMAX] if settings.peers else []
    levels = (10.0, 20.0)
    limits = {decibel: bounds.table1(settings.first_seed, N, decibel) for decibel in levels}
    printed: dict[str, list[np.ndarray]] = {}
    same: dict[str, list[str]] = {}
    for name, method in methods:
        why = peers.missing(method) if isinstance(method, peers.Peer) else ""
        done = {} if why else {decibel: each(settings, _run, method, decibel) for decibel in levels}
        why = why or next(filter(None, map(peers.broken, done.values())), "")
        if why:
            rows.append((name, why))
            continue
        ratios = [_ratio(done[decibel], limits[decibel]) for decibel in levels]
        first = next((x for x, of in printed.items() if _same(of, ratios)), None)
        if first is not None and first.split(",")[0] != "canid":
            same.setdefault(first, []).append(name)
            continue
        printed[name] = ratios
        cells = [(float(np.nanmax(ratios[k])), _off(done[x], limits[x])) for k, x in enumerate(levels)]
        ms = max(1e3 * float(np.nanmedian([seconds for _, seconds, _ in done[x]])) for x in levels)
        rows.append((name, *cells[0], *cells[1], ms))
    title = f"ARMAX(2,2,1), Chen & Ulsoy 2001 table 1, N = {N} at 10 Hz: RMSE / Cramér-Rao bound"
    return [
        Table(
            title,
            (
                "method",
                *(
                    x
                    for decibel in levels
                    for x in (f"{decibel:.0f} dB: worst", f"off by > {GROSS:.0f} bounds")
                ),
                "ms per fit",
            ),
            rows,
            (
                f"Worst of {', '.join(NAMES)}.",
                *(
                    f"The same within {100 * SAME:.0f} % as {x}: {'; '.join(names)}."
                    for x, names in same.items()
                ),
                "canid estimates an offset besides, the bound is without it. Online: 15 s batch start, then every sample; "
                "its time is per update.",
            ),
        )
    ]


def _errors(done: list[tuple[np.ndarray, float, str]]) -> np.ndarray:
    return np.asarray(np.array([theta for theta, *_ in done], float) - open_loop.TABLE1)


def _ratio(done: list[tuple[np.ndarray, float, str]], bound: np.ndarray) -> np.ndarray:
    return np.asarray(rmse(_errors(done)) / bound)


def _same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return all(np.allclose(a, b, rtol=SAME, equal_nan=True) for a, b in zip(one, other, strict=True))


def _off(done: list[tuple[np.ndarray, float, str]], bound: np.ndarray) -> str:
    error = _errors(done)
    off = np.abs(error) > GROSS * bound
    # parameters that a method does not have are no failure of it; a run without any answer is
    gross = int((off.any(axis=1) | ~np.isfinite(error).any(axis=1)).sum())
    return f"{gross} of {len(error)}"


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
