"""Twenty minutes in which nothing moves, then driving again: does the estimator still know the driver."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.identification import canid_side, open_loop, peers
from benchmarks.identification.table import Settings, Table, each
from benchmarks.identification.tables.tracking import response

DT = open_loop.TABLE1_DT
DRIVING, CRUISE, AGAIN = 300.0, 1200.0, 10.0  # s
STILL = 1e-3  # of the input's usual movement: a sensor's last bits


def table(settings: Settings) -> list[Table]:
    """Print the worst relative error of the transfer function in the first 10 s after cruise."""
    slow = settings.few(4)
    rows: list[tuple[object, ...]] = []
    methods: list[tuple[str, object]] = [
        ("canid, live settings", np.float64),
        ("canid, live settings, float32", np.float32),
    ]
    methods += [(peer.name, peer) for peer in peers.TRACKING] if settings.peers else []
    for name, method in methods:
        if isinstance(method, peers.Peer) and (why := peers.missing(method)):
            rows.append((name, why))
            continue
        done = np.array(each(slow, _run, method))
        worst = done[:, 0]
        known = (
            "–" if isinstance(method, peers.Peer) else f"{int(done[:, 2].sum())} of {int(done[:, 3].sum())}"
        )
        rows.append(
            (
                name,
                float(np.median(worst)),
                float(np.max(worst)),
                f"{int(done[:, 1].sum())} of {len(done)}",
                known,
            )
        )
    return [
        Table(
            f"{DRIVING / 60:.0f} min driving, {CRUISE / 60:.0f} min cruise, driving again: "
            f"worst relative error of G(0.2 Hz) in the first {AGAIN:.0f} s",
            ("method", "median run", "worst run", "runs with NaN", "covariance not positive definite"),
            rows,
            (
                f"{slow.runs} runs, 20 dB, learning never paused; the live estimator also stops learning while nothing "
                "moves. Covariance: checked every second.",
            ),
        )
    ]


def _run(seed: int, method: object) -> tuple[float, float, float, float]:
    t = np.arange(round((DRIVING + CRUISE + AGAIN) / DT)) * DT
    active = np.where((t < DRIVING) | (t >= DRIVING + CRUISE), 1.0, STILL)
    run = open_loop.table1(seed, len(t), 20.0, active=active)
    true = response(open_loop.TABLE1)
    worst, lost, indefinite, checks = 0.0, False, 0, 0
    with np.errstate(all="ignore"):
        for k, theta, P in _looks(method, run):
            lost |= not np.isfinite(theta).all()
            if t[k] >= DRIVING + CRUISE:
                error = abs(response(theta) / true - 1.0)
                worst = max(worst, min(error, 1e3)) if np.isfinite(error) else 1e3
            if P is not None:
                checks += 1
                indefinite += not (np.isfinite(P).all() and np.linalg.eigvalsh(_scaled(P)).min() > 0.0)
    return worst, float(lost), float(indefinite), float(checks)


def _looks(method: object, run: open_loop.Armax) -> Iterator[tuple[int, np.ndarray, np.ndarray | None]]:
    """Check once a second, and at every sample of the last ten seconds; a peer has no covariance in common with canid's."""
    last = len(run.y) - round(AGAIN / DT)
    if isinstance(method, peers.Peer):
        yield from ((k, theta, None) for k, theta in peers.call(method, run.y, run.u))
        return
    for k, state in canid_side.recursion(run.y, run.u, None, method):  # type: ignore[arg-type]
        if k % 10 == 0 or k >= last:
            yield k, *canid_side.estimates(state)


def _scaled(P: np.ndarray) -> np.ndarray:
    """Give a covariance a unit diagonal: its parameters have units, its definiteness has none."""
    sd = np.sqrt(np.abs(np.diag(P)))
    return P / np.outer(sd, sd)
