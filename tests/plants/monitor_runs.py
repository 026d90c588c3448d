"""The change monitor along planted drives, sample by sample."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

from canid.models.monitor import change_monitor
from canid.values.types import MonitorReport, Sample, Trace
from tests.plants import plant_one, plant_two
from tests.plants.planted_drive import NOISES, PROFILES, Plant

PLANTS: tuple[Plant, ...] = (plant_one.plant, plant_two.plant)


class Alarm(NamedTuple):
    """A block begins to be suspected."""

    t: float  # s
    since: float  # s
    block: str
    says: str


def samples(drive: Trace) -> Iterator[Sample]:
    """Row by row, with all signals."""
    signals = {role: x.tolist() for role, x in drive.signals.items()}
    rows = zip(drive.t.tolist(), drive.output.tolist(), drive.inputs.tolist(), strict=True)
    for k, (t, y, u) in enumerate(rows):
        at = {role: x[k] for role, x in signals.items()}
        yield Sample(t, y, tuple(u), drive.gate[k], bool(drive.learn[k]), int(drive.segment[k]), at)


def reports(drive: Trace) -> list[MonitorReport]:
    """All reports of the monitor along a drive."""
    monitor = change_monitor.make(drive.input_names)
    state, reported = monitor.init(), []
    for sample in samples(drive):
        state, now = monitor.step(state, sample)
        reported += [now] if now is not None else []
    return reported


def alarms(reported: list[MonitorReport]) -> list[Alarm]:
    """The reports in which a block begins to be suspected."""
    out, before = [], ""
    for now in reported:
        if now.block not in ("", before):
            out.append(Alarm(now.t, now.since, now.block, now.says))
        before = now.block
    return out


def kinds(first: int) -> Iterator[tuple[Plant, dict[str, Any]]]:
    """Drives without end, always another seed: 12 have each simulator and noise, 36 each profile with them."""
    for k in itertools.count():
        noise, plant = k // 2 % len(NOISES), k % 2
        profile = PROFILES[(noise + plant + k // 12) % len(PROFILES)]
        yield PLANTS[plant], {"seed": first + k, "noise": NOISES[noise], "profile": profile}
