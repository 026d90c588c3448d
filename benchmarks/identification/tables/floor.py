"""The real pedal: at 0 % it is released, and then the driver brakes. Does masking bias the estimates."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bus, canid_side, loop_b
from benchmarks.identification.bus import Seen
from benchmarks.identification.loops import Drive, Lead
from benchmarks.identification.table import Settings, Table, each
from canid.values.types import Driver

SECONDS = 125.0
# how far the pedal stands above what level road needs, and the lead: more often at the floor from row to row
WORLDS = (
    ("pedal always free", 14.0, Lead("normal", 1.5, 0.05)),
    ("0 % floor and brake", 1.0, Lead("normal", 1.8, 0.05)),
)
FIELDS = (("K1", 0, "K"), ("K2", 1, "K"), ("tau2", 1, "tau"), ("dead time 2", 1, "dead_time"))


def table(settings: Settings) -> list[Table]:
    """Print the bias in half-widths of the interval."""
    rows = []
    for name, shift, lead in WORLDS:
        for way, how in (("canid", "canid"), ("not masked", "blind")):
            done = each(settings.few(2), _run, shift, lead, how)
            errors = np.array([d[0] for d in done])
            halves = np.array([d[1] for d in done])
            shares = np.array([d[2] for d in done])
            bias = errors.mean(axis=0)
            half = np.array(
                [np.median(h[np.isfinite(h)]) if np.isfinite(h).any() else np.nan for h in halves.T]
            )
            held = [
                float(np.mean(np.abs(e[k]) <= h[k])) if (k := np.isfinite(h)).any() else np.nan
                for e, h in zip(errors.T, halves.T, strict=True)
            ]
            rows.append(
                (
                    name,
                    way,
                    f"{100 * shares[:, 0].mean():.0f} % / {100 * shares[:, 1].mean():.0f} %",
                    *(
                        f"{b:+.3f} ({b / h:+.2f})" if np.isfinite(h) else f"{b:+.3f}"
                        for b, h in zip(bias, half, strict=True)
                    ),
                    *map(float, held[:2]),
                )
            )
    return [
        Table(
            f"Loop B, {SECONDS - 5:.0f} s: mean error (in half-widths of the 95 % interval)",
            ("world", "method", "floor / brake", *(f[0] for f in FIELDS), "K1 held", "K2 held"),
            rows,
            (f"{settings.few(2).runs} runs. In brackets: in median half-widths, where reported.",),
        )
    ]


def _run(
    seed: int, shift: float, lead: Lead, how: str
) -> tuple[list[float], list[float], tuple[float, float]]:
    drive: Drive = loop_b.drive(seed, SECONDS, lead=lead, shift=shift)
    driver = Driver(headway_desired=drive.headway_desired)
    seen: Seen = bus.through_canid(bus.sensed(drive, seed), driver)
    usable = (
        seen.usable if how == "canid" else np.isfinite(seen.output) & np.isfinite(seen.inputs).all(axis=1)
    )
    fit = canid_side.process(seen.output, seen.inputs, bus.GRID, usable, seen.segment)
    errors, halves = [], []
    for _, i, field in FIELDS:
        errors.append(float(getattr(fit.point, field)[i]) - getattr(drive.channels[i], field))
        interval = getattr(fit.channels[i], field)
        halves.append(0.5 * (interval.high - interval.low))
    return errors, halves, (float((~drive.exact).mean()), float(drive.brake.mean()))
