"""The same drive, cut by some tenths of a second at either end: by how much do the numbers move?"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import canid
from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT
from benchmarks.identification.noise_models import REMNANT
from benchmarks.identification.table import Settings, Table, each
from benchmarks.identification.tables.filters import CASES, MINUTES, given
from canid.values.types import Channel, Identifiable, Interval, OutputFilter, Trace

DATA = Path(__file__).resolve().parents[3] / "../shared/data"
VEHICLES = Path(__file__).resolve().parents[3] / "dbc"
CUTS = tuple(range(1, 8))  # samples of 0.1 s, at the end and at the beginning


class Moved(NamedTuple):
    """By how much the numbers of one drive move, in half widths of the interval of the whole drive."""

    most: dict[str, float]
    disjoint: int  # pairs of intervals without a common point


def table(settings: Settings) -> list[Table]:
    """Simulated accelerations, and measured drives where they are."""
    rows: list[tuple[object, ...]] = [
        (f"simulated, filter {declared}", *_summary(each(settings, _simulated, declared)))
        for declared in ("stated", "unknown", "nothing")
    ]
    for folder, vehicle in (
        ("openacc", VEHICLES / "openacc.toml"),
        ("asta", VEHICLES / "openacc_asta.toml"),
        ("openlka", DATA / "openlka" / "openlka.toml"),
    ):
        logs = sorted((DATA / folder).glob("*.blf"))
        # drives without any estimate have nothing that could move
        found = [_measured(log, vehicle) for log in logs]
        if any(one.most for one in found):
            rows.append((folder, *_summary(found)))
    return [
        Table(
            "Drives cut by 0.1 to 0.7 s at either end: movement of K and tau + dead time, in half widths",
            ("drives", "with an estimate", "numbers", "95 % of them below", "most", "disjoint intervals"),
            rows,
            (
                "Measured logs are read from ../shared/data next to the checkout and left out where they are not.",
            ),
        )
    ]


def _summary(found: list[Moved]) -> tuple[object, ...]:
    moves = [x for one in found for x in one.most.values()]
    known = sum(bool(one.most) for one in found)
    if not moves:
        return known, 0, np.nan, np.nan, 0
    return known, len(moves), float(np.quantile(moves, 0.95)), max(moves), sum(one.disjoint for one in found)


def _simulated(seed: int, declared: str) -> Moved:
    drive = acceleration.drive(seed, MINUTES[seed % len(MINUTES)], REMNANT)
    how = CASES[1 + seed % (len(CASES) - 1)]
    of = given(how)[declared]
    y = acceleration.published(drive, how, seed)
    return moved(
        [
            canid_side.process(y[part], drive.inputs[part], DT, output_filter=of).channels
            for part in _parts(len(y))
        ]
    )


def _measured(log: Path, vehicle: Path) -> Moved:
    car = canid.read_vehicle(vehicle)
    trace = canid.read_trace(log, car)
    return moved([_fit(trace, part, car.driver.output_filter) for part in _parts(len(trace.t))])


def _fit(trace: Trace, part: slice, of: OutputFilter | None) -> tuple[Channel, ...]:
    return canid_side.process(
        trace.output[part], trace.inputs[part], trace.dt, trace.learn[part], trace.segment[part], of
    ).channels


def _parts(n: int) -> list[slice]:
    """The whole, and what is left of it."""
    return [slice(0, n), *(slice(0, n - k) for k in CUTS), *(slice(k, n) for k in CUTS)]


def moved(found: list[tuple[Channel, ...]]) -> Moved:
    """Compare the first with the others: what has a gain there."""
    most, disjoint = {}, 0
    for i, whole in enumerate(found[0]):
        if whole.status is Identifiable.NOT:
            continue
        for name in ("K", "tau_plus_dead_time"):
            one: Interval = getattr(whole, name)
            others = [getattr(cut[i], name) for cut in found[1:]]
            half = 0.5 * (one.high - one.low)
            most[f"{name} {i}"] = max(abs(other.value - one.value) / half for other in others)
            disjoint += sum(not (other.low <= one.high and one.low <= other.high) for other in others)
    return Moved(most, disjoint)
