"""A minute of car following in closed loop, through a noisy radar: both channels at once."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.identification import bounds, bus, canid_side, loop_a, loop_b, peers
from benchmarks.identification.bus import Seen
from benchmarks.identification.loops import Drive
from benchmarks.identification.noise_models import REMNANT
from benchmarks.identification.open_loop import HISTORY
from benchmarks.identification.table import Settings, Table, each, rmse, text
from canid.values.types import Driver

# s used, then history before it, then what the gate takes to open and the smoothing to end
WINDOW = 60.0
SECONDS = WINDOW + HISTORY + 2.5
LOOPS = {"A": loop_a.drive, "B": loop_b.drive}
NAMES = ("K1", "K2", "tau2", "dead time 2")


def table(settings: Settings) -> list[Table]:
    """Print RMSE and bias of K1, K2, tau2 and dead time 2 for each loop."""
    rows: list[tuple[object, ...]] = []
    methods: list[tuple[str, object]] = [
        ("canid", "canid"),
        ("canid, declared prior", "prior"),
        ("canid, inputs without sensor", "exact"),
        ("canid's fit, inputs joined by lines", "lines"),
    ]
    methods += [(peer.name, peer) for peer in peers.FOLLOWING] if settings.peers else []
    for name, method in methods:
        why = peers.missing(method) if isinstance(method, peers.Peer) else ""
        done = [] if why else [each(settings, _run, loop, method) for loop in LOOPS]
        why = why or next(filter(None, map(peers.broken, done)), "")
        rows.append((name, why) if why else (name, *(cell for runs in done for cell in _cells(runs))))
    for name, which in (("bound, all free", _all), ("bound, tau1 and dead time 1 known", _known)):
        rows.append((name, *(x for loop in LOOPS for x in _bound_of(settings.few(10), which, loop))))
    return [
        Table(
            f"Closed loops {' and '.join(LOOPS)}, {WINDOW:.0f} s, radar 0.25 m and 0.12 m/s at 20 Hz, remnant 1 %: "
            "RMSE (bias: median error)",
            ("method", *(f"{loop}: {x}" for loop in LOOPS for x in NAMES)),
            rows,
            (
                *(_truth(loop) for loop in LOOPS),
                "canid: its own smoothing and sampling; peers: the same readings, joined by lines at 10 Hz.",
            ),
        )
    ]


def _cells(done: list[tuple[np.ndarray, str]]) -> list[str]:
    errors = np.array([error for error, _ in done])
    both = zip(rmse(errors), _median(errors), strict=True)
    return ["–" if np.isnan(bias) else f"{text(float(error))} ({bias:+.3f})" for error, bias in both]


def _median(errors: np.ndarray) -> np.ndarray:
    return np.array([np.median(e[np.isfinite(e)]) if np.isfinite(e).any() else np.nan for e in errors.T])


def _truth(loop: str) -> str:
    one, two = LOOPS[loop](0, 1.0).channels
    return (
        f"Truth of {loop}: K1 {one.K} %/s, tau1 {one.tau} s, dead time 1 {one.dead_time} s; "
        f"K2 {two.K} %/(m/s), tau2 {two.tau} s, dead time 2 {two.dead_time} s."
    )


def seen_by_canid(drive: Drive, seed: int) -> Seen:
    """Take a drive over the bus and through canid, and keep the last WINDOW + HISTORY."""
    seen = bus.through_canid(bus.sensed(drive, seed), Driver(headway_desired=drive.headway_desired))
    keep = round((WINDOW + HISTORY) / bus.GRID)
    return Seen(*(column[-keep:] for column in seen))


def seen_by_lines(drive: Drive, seed: int) -> Seen:
    """Give the same readings to anyone else."""
    seen = bus.by_lines(bus.sensed(drive, seed), Driver(headway_desired=drive.headway_desired))
    keep = round((WINDOW + HISTORY) / bus.GRID)
    return Seen(*(column[-keep:] for column in seen))


def _run(seed: int, loop: str, method: object) -> tuple[np.ndarray, str]:
    drive = LOOPS[loop](seed, SECONDS)
    one, two = drive.channels
    truth = np.array([one.K, two.K, two.tau, two.dead_time])
    if isinstance(method, peers.Peer):
        seen = seen_by_lines(drive, seed)
        settle = round(HISTORY / bus.GRID)
        answer, _, why = peers.attempt(method, 4, seen.output, seen.inputs, bus.GRID, settle)
        return np.asarray(answer, float) - truth, why
    take = {
        "canid": seen_by_canid,
        "prior": seen_by_canid,
        "exact": lambda d, _: bus.exactly(d),
        "lines": seen_by_lines,
    }
    seen = take[str(method)](drive, seed)
    fit = canid_side.with_prior if method == "prior" else canid_side.process
    at = fit(seen.output, seen.inputs, bus.GRID, seen.usable, seen.segment).point
    return np.array([at.K[0], at.K[1], at.tau[1], at.dead_time[1]]) - truth, ""


def _bound_of(settings: Settings, which: Callable[[int, str], np.ndarray], loop: str) -> list[float]:
    """Say what the data allow, without any radar: all free, or with the headway channel's lag known."""
    return list(map(float, rmse(np.array(each(settings, which, loop)))))


def _all(seed: int, loop: str) -> np.ndarray:
    drive = LOOPS[loop](seed, SECONDS)
    one, two = _bound(drive)
    return np.array([one.K, two.K, two.tau, two.dead_time])


def _known(seed: int, loop: str) -> np.ndarray:
    drive = LOOPS[loop](seed, SECONDS)
    one, two = _bound(drive, known=True)
    return np.array([one.K, two.K, two.tau, two.dead_time])


def _bound(drive: Drive, known: bool = False) -> list[bounds.Bound]:
    make = partial(bounds.process, known=(0,)) if known else bounds.process
    every = round(bus.GRID / drive.dt)
    return make(
        drive.inputs, drive.channels, drive.dt, drive.sigma, REMNANT, round(HISTORY / drive.dt), every
    )
