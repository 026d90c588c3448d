"""Several drives of one car: its sensors and the car are diagnosed on all of them together, each driver on the own drive.

What was found in the car is then held against each drive by a fit to the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis import corrections
from canid.models.diagnosis.corrections import Context
from canid.models.diagnosis.several_drives.joined_drives import JoinedDrives
from canid.models.diagnosis.several_drives.shared_causes import gains_by_the_others, left_out
from canid.models.diagnosis.vehicle import vehicle_data, vehicle_search
from canid.models.effects.effect import Effect
from canid.values.findings import DriveShare, Finding, Masked
from canid.values.types import Trace


class SharedCar(NamedTuple):
    """What all drives say of the car."""

    contexts: tuple[Context, ...]  # of each drive, its findings those of all
    drives: tuple[DriveShare, ...]


def diagnose_car(
    joined: JoinedDrives, traces: Sequence[Trace], names: Sequence[str], catalogue: tuple[Effect, ...]
) -> SharedCar:
    """Diagnose sensors and car on all drives together.

    Args:
        joined: the drives on one trace.
        traces: the same, each by itself.
        names: of the drives.
        catalogue: the effects that may be named.
    """
    context = corrections.diagnose_context(joined.trace, catalogue)
    contexts = [_part(context, trace, span) for trace, span in zip(traces, joined.spans, strict=True)]
    return SharedCar(tuple(contexts), _shares(context, joined.spans, names))


def _shares(
    context: Context, spans: Sequence[tuple[float, float]], names: Sequence[str]
) -> tuple[DriveShare, ...]:
    """Gain of each finding in the car on each drive, by a fit to the others."""
    cars, data = context.vehicle.cars, vehicle_data.prepare(context.trace, context.usable)
    if cars is None or isinstance(data, str):
        return ()
    _, solved = cars
    without = left_out(data, solved, [finding.effect for finding in context.vehicle.findings])
    if not without:
        return ()
    out = []
    for name, (begin, end) in zip(names, spans, strict=True):
        here = solved.rows & (data.seen.t >= begin) & (data.seen.t < end)
        gains = gains_by_the_others(data, solved, without, here, vehicle_search.again)
        out.append(DriveShare(name, float(here.sum()) * data.output.dt, gains, {}))
    return tuple(out)


def _part(context: Context, trace: Trace, span: tuple[float, float]) -> Context:
    """The context of one drive, on its own clock."""
    dt, n = trace.dt, trace.t.size
    first = round(span[0] / dt)
    rows = slice(first, first + n)
    by = float(trace.t[0]) - span[0] if n else 0.0
    corrected = trace._replace(
        signals={
            role: x[rows]
            for role, x in context.trace.signals.items()
            if role in trace.signals or np.isfinite(x[rows]).any()
        },
        inputs=context.trace.inputs[rows],
    )
    masked = [
        Masked(stretch.effect, max(stretch.start, span[0]) + by, min(stretch.stop, span[1]) + by)
        for stretch in context.masked
        if stretch.stop > span[0] and stretch.start < span[1]
    ]
    vehicle, sensing = context.vehicle, context.sensing
    return context._replace(
        trace=corrected,
        usable=context.usable[rows],
        masked=tuple(masked),
        sensing=sensing._replace(findings=_on_its_clock(sensing.findings, span, by)),
        vehicle=vehicle._replace(
            findings=_on_its_clock(vehicle.findings, span, by),
            slope=vehicle.slope[rows],
            gear=vehicle.gear[rows],
            left=vehicle.left[rows],
        ),
    )


def _on_its_clock(findings: Sequence[Finding], span: tuple[float, float], by: float) -> tuple[Finding, ...]:
    """Findings with the episodes of one drive."""
    return tuple(
        finding._replace(
            episodes=tuple(
                (max(start, span[0]) + by, min(stop, span[1]) + by)
                for start, stop in finding.episodes
                if stop > span[0] and start < span[1]
            )
        )
        for finding in findings
    )
