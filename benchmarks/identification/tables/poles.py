"""ARMAX over a whole drive with separate poles per input and noise: coverage on pedals and on accelerations."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import acceleration, canid_side, loop_a
from benchmarks.identification.loops import Drive
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT
from benchmarks.identification.table import Settings, Table, each, held
from benchmarks.identification.tables import filters
from canid.mathematics.estimators import armax_whole_drive
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.values.types import TASK_INPUTS, Channel, Identifiable, LearnGate, OutputFilter, Trace

NAMES = TASK_INPUTS["car_following"]
SECONDS = 180.0
COLUMNS = (
    "K1",
    "K2",
    "τ2+θ2",
    "range rate quotable",
    "width K2",
    "width τ2+θ2",
)


def table(settings: Settings) -> list[Table]:
    """Share of intervals that hold the truth."""
    rows: list[tuple[object, ...]] = []
    pedals = each(settings, _pedal)
    rows += [
        ("pedal", what, *_row([run[k] for run in pedals])) for k, what in enumerate(("separate", "shared"))
    ]
    for how in filters.CASES[:3:2]:
        given = filters.given(how)
        for declared in filters.distinct(how):
            done = each(settings.few(4), _acceleration, how, given[declared])
            rows.append((how.name, f"separate, filter {declared}", *_row(done)))
    return [
        Table(
            f"ARMAX over a whole drive in closed loop: pedals {SECONDS:.0f} s, accelerations 3 and 10 min",
            ("output", "poles", *COLUMNS),
            rows,
            (
                f"Pedals: {len(pedals)} runs of loop A, five noise models in turn, inputs without sensor. Shared: (2,2,1). "
                f"Accelerations: {settings.few(4).runs} runs a row. Widths: medians; of gains over the gain.",
            ),
        )
    ]


def _row(done: list[tuple[object, ...]]) -> list[object]:
    out: list[object] = []
    for k in range(3):
        known = [run[k] for run in done if run[k] is not None]
        out.append(held(float(np.mean(known)) if known else np.nan, len(known), len(done)))
    out.append(float(np.mean([run[3] for run in done])))
    return out + [float(np.nanmedian([run[k] for run in done])) for k in range(4, 6)]


def _pedal(seed: int) -> tuple[tuple[object, ...], tuple[object, ...]]:
    drive = loop_a.drive(seed, SECONDS, noise_model=NOISE_MODELS[seed % len(NOISE_MODELS)])
    every = round(0.1 / drive.dt)
    y, u = drive.pedal[::every], np.column_stack(drive.inputs)[::every]
    found = armax_whole_drive.identify(_trace(y, u, None), Orders())
    shared = dict(zip(NAMES, canid_side.armax_channels(y, u, 0.1), strict=True))
    return _inside({} if found is None else found.channels, drive), _inside(shared, drive)


def _acceleration(seed: int, how: acceleration.Measured, of: OutputFilter | None) -> tuple[object, ...]:
    drive = acceleration.drive(seed, filters.MINUTES[seed % len(filters.MINUTES)], REMNANT)
    found = armax_whole_drive.identify(
        _trace(acceleration.published(drive, how, seed), drive.inputs, of), Orders()
    )
    return _inside({} if found is None else found.channels, drive)


def _inside(channels: dict[str, Channel], drive: Drive | acceleration.Drive) -> tuple[object, ...]:
    one, two = drive.channels
    c1, c2 = (channels.get(name, Channel()) for name in NAMES)
    total = c2.tau_plus_dead_time
    return (
        canid_side.inside(c1, "K", one.K),
        canid_side.inside(c2, "K", two.K),
        canid_side.inside(c2, "tau_plus_dead_time", two.tau + two.dead_time),
        c2.status is not Identifiable.NOT,
        (c2.K.high - c2.K.low) / two.K,
        total.high - total.low,
    )


def _trace(y: np.ndarray, u: np.ndarray, of: OutputFilter | None) -> Trace:
    n = len(y)
    gate, t = (LearnGate.OPEN,) * n, 0.1 * np.arange(n)
    return Trace(0.1, t, y, u, NAMES, gate, np.full(n, True), np.zeros(n, np.int64), {}, of)
