"""ARMAX on grids of 0.02 to 0.2 s: does its coverage depend on the step."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import canid_side, loop_a
from benchmarks.identification.noise_models import NOISE_MODELS
from benchmarks.identification.table import Settings, Table, each, held
from canid.mathematics.estimators import armax_whole_drive
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.values.types import TASK_INPUTS, Channel, Identifiable, LearnGate, Status, Trace

STEPS = (0.02, 0.05, 0.1, 0.2)  # s
SECONDS = 120.0
NAMES = TASK_INPUTS["car_following"]


def table(settings: Settings) -> list[Table]:
    """Share of intervals that hold the truth."""
    rows: list[tuple[object, ...]] = []
    done = each(settings, _one)
    for i, step in enumerate(STEPS):
        cells = [[run[i][j][k] for run in done] for j in range(2) for k in range(3)]
        known = [[x for x in cell if x is not None] for cell in cells]
        shares = [held(float(np.mean(x)) if x else np.nan, len(x), len(done)) for x in known]
        rows.append((f"{step:g} s", *shares))
    return [
        Table(
            f"ARMAX in closed loop A, {SECONDS:.0f} s, by the step of the grid: coverage of the reported intervals",
            (
                "step",
                *(f"{who}: {x}" for who in ("drive", "live") for x in ("K1", "K2", "τ2+θ2")),
            ),
            rows,
            (f"{len(done)} drives, five noise models in turn; inputs without sensor. Live: at the end.",),
        )
    ]


def _one(seed: int) -> list[tuple[tuple[object, ...], tuple[object, ...]]]:
    drive = loop_a.drive(seed, SECONDS, noise_model=NOISE_MODELS[seed % len(NOISE_MODELS)])
    out = []
    for step in STEPS:
        every = round(step / drive.dt)
        y, u = drive.pedal[::every], np.column_stack(drive.inputs)[::every]
        found = armax_whole_drive.identify(_trace(y, u, step), Orders())
        whole = {} if found is None else found.channels
        last = None
        for last in canid_side.live("armax", NAMES, y, u, step, SECONDS - 1.0):  # noqa: B007  (the last one is wanted)
            pass
        live = last.channels if last is not None and last.status is Status.OK else {}
        out.append((_inside(whole, drive), _inside(live, drive)))
    return out


def _inside(channels: dict[str, Channel], drive: object) -> tuple[object, ...]:
    one, two = drive.channels  # type: ignore[attr-defined]
    c1, c2 = (channels.get(name, Channel()) for name in NAMES)
    quotable = c2.status in (Identifiable.OK, Identifiable.SUM_ONLY)
    return (
        canid_side.inside(c1, "K", one.K),
        canid_side.inside(c2, "K", two.K),
        canid_side.inside(c2, "tau_plus_dead_time", two.tau + two.dead_time) if quotable else None,
    )


def _trace(y: np.ndarray, u: np.ndarray, step: float) -> Trace:
    n = len(y)
    return Trace(
        step,
        step * np.arange(n),
        y,
        u,
        NAMES,
        (LearnGate.OPEN,) * n,
        np.full(n, True),
        np.zeros(n, np.int64),
        {},
    )
