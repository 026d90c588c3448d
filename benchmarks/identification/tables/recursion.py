"""ARMAX live: coverage along drives of 3 to 20 min by noise model, and on accelerations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.identification import acceleration, canid_side, loop_a
from benchmarks.identification.bounds import Lag
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT
from benchmarks.identification.table import Settings, Table, each, held
from benchmarks.identification.tables import filters
from canid.values.types import TASK_INPUTS, Channel, Estimate, OutputFilter, Status

NAMES = TASK_INPUTS["car_following"]
MINUTES = (3.0, 10.0, 20.0)
WANTED = ("K1", "K2", "τ1+θ1", "τ2+θ2")
# share below which the row of a single noise model is printed
MIN_CELL = 0.8
COLUMNS = (*WANTED, "range rate quotable", "width K2", "width τ2+θ2")


def table(settings: Settings) -> list[Table]:
    """Share of stated intervals that hold the truth."""
    done = each(settings, _pedal)
    rows: list[tuple[object, ...]] = [
        ("pedal", f"{minutes:g} min", *_row([run[i] for run in done])) for i, minutes in enumerate(MINUTES)
    ]
    for j, noise in enumerate(NOISE_MODELS):
        some = [run for k, run in enumerate(done) if (settings.first_seed + k) % len(NOISE_MODELS) == j]
        for i, minutes in enumerate(MINUTES):
            at = [run[i] for run in some]
            if min((_share(at, k)[0] for k in range(len(WANTED))), default=1.0) < MIN_CELL:
                rows.append((f"pedal, {noise.name}", f"{minutes:g} min", *_row(at)))
    few = settings.few(4)
    for how in filters.CASES[:3:2]:
        given = filters.given(how)
        rows += [
            (how.name, f"filter {declared}", *_row(each(few, _acceleration, how, given[declared])))
            for declared in filters.distinct(how)
        ]
    return [
        Table(
            "ARMAX live: share of stated 95 % intervals that hold the truth",
            ("output", "", *COLUMNS),
            rows,
            (
                f"Pedal: {len(done)} drives of loop A, inputs without sensor, {len(NOISE_MODELS)} noise models in turn; of "
                f"single ones the rows with a share below {MIN_CELL}. Accelerations: {few.runs} drives a row, "
                f"{' and '.join(f'{m:g}' for m in filters.MINUTES)} min. Drivers drawn. Widths: medians; of gains over the "
                "gain.",
            ),
        )
    ]


def _row(done: Sequence[tuple[object, ...]]) -> list[object]:
    out: list[object] = [held(*_share(done, k), len(done)) for k in range(len(WANTED))]
    out.append(float(np.mean([run[4] for run in done])) if done else np.nan)
    return out + [float(np.nanmedian([run[k] for run in done])) if done else np.nan for k in range(5, 7)]


def _share(done: Sequence[tuple[object, ...]], k: int) -> tuple[float, int]:
    known = [bool(run[k]) for run in done if run[k] is not None]
    return float(np.mean(known)) if known else np.nan, len(known)


def _pedal(seed: int) -> list[tuple[object, ...]]:
    rng = np.random.default_rng([seed, 5])
    channels = tuple(
        Lag(float(rng.uniform(*K)), float(rng.uniform(0.25, 0.9)), round(float(rng.uniform(0.15, 0.5)), 2))
        for K in ((3.0, 6.0), (4.0, 8.0))
    )
    drive = loop_a.drive(
        seed,
        60.0 * MINUTES[-1],
        noise_model=NOISE_MODELS[seed % len(NOISE_MODELS)],
        channels=channels,  # type: ignore[arg-type]
    )
    every = round(0.1 / drive.dt)
    y, u = drive.pedal[::every], np.column_stack(drive.inputs)[::every]
    at = [60.0 * minutes - 1.0 for minutes in MINUTES]
    return [_inside(e, channels) for e in canid_side.live_at("armax", NAMES, y, u, 0.1, at)]


def _acceleration(seed: int, how: acceleration.Measured, of: OutputFilter | None) -> tuple[object, ...]:
    minutes = filters.MINUTES[seed % len(filters.MINUTES)]
    drive = acceleration.drive(seed, minutes, REMNANT)
    y = acceleration.published(drive, how, seed)
    (last,) = canid_side.live_at("armax", NAMES, y, drive.inputs, 0.1, [60.0 * minutes - 1.0], of)
    return _inside(last, drive.channels)


def _inside(e: Estimate | None, truth: Sequence[Lag]) -> tuple[object, ...]:
    of = e.channels if e is not None and e.status is Status.OK else {}
    one, two = (of.get(name, Channel()) for name in NAMES)
    total = two.tau_plus_dead_time
    return (
        *(canid_side.inside(c, "K", lag.K) for c, lag in zip((one, two), truth, strict=True)),
        *(
            canid_side.inside(c, "tau_plus_dead_time", lag.tau + lag.dead_time)
            for c, lag in zip((one, two), truth, strict=True)
        ),
        bool(np.isfinite(canid_side.quoted(two, "K").value)),
        (two.K.high - two.K.low) / truth[1].K,
        total.high - total.low,
    )
