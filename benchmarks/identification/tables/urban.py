"""Town traffic: the pedal stands at its floor or the driver brakes, for a third of the time."""

from __future__ import annotations

import numpy as np

from benchmarks.identification import bus, canid_side, loop_b
from benchmarks.identification.loops import Lead
from benchmarks.identification.table import Settings, Table, each
from canid.values.types import Driver

MINUTES = 20.0
LEAD = Lead("town", 2.0, 0.05)
MIDDLE = 12.0  # m/s
# % of ascent, drawn: how often the floor is reached
SHIFT = (0.0, 4.0)
FIELDS = (("K1", 0, "K"), ("K2", 1, "K"), ("tau2 + dead time 2", 1, "tau_plus_dead_time"))


def table(settings: Settings) -> list[Table]:
    """Errors in standard deviations of the interval, masked and as bounds."""
    fewer = settings.few(5)
    done = each(fewer, _run)
    rows = []
    for name in ("masked", "bounds (canid)"):
        z = np.array([one[name] for one in done])
        held = np.mean(np.abs(z) <= 1.96, axis=0)
        rows.append((name, *(f"{m:+.2f} ± {s:.2f}" for m, s in zip(z.mean(0), z.std(0), strict=True)), *held))
    hidden = np.mean([one["hidden"] for one in done])
    return [
        Table(
            f"Loop B in town, {MINUTES:.0f} min: error in standard deviations of the interval, and intervals that hold",
            ("floor and brake", *(f[0] for f in FIELDS), *(f"{f[0]} held" for f in FIELDS)),
            rows,
            (f"{fewer.runs} drives; {100 * hidden:.0f} % of the samples at the floor or under the brake.",),
        )
    ]


def _run(seed: int) -> dict[str, object]:
    shift = float(np.random.default_rng([seed, 8]).uniform(*SHIFT))
    drive = loop_b.drive(seed, 60.0 * MINUTES, lead=LEAD, middle=MIDDLE, shift=shift)
    seen = bus.through_canid(bus.sensed(drive, seed), Driver(headway_desired=drive.headway_desired))
    out: dict[str, object] = {"hidden": float(np.isfinite(seen.bound).mean())}
    for name, bound in (("masked", None), ("bounds (canid)", seen.bound)):
        fit = canid_side.process(seen.output, seen.inputs, bus.GRID, seen.usable, seen.segment, bound=bound)
        z = []
        for _, i, field in FIELDS:
            lag, interval = drive.channels[i], getattr(fit.channels[i], field)
            truth = lag.tau + lag.dead_time if field == "tau_plus_dead_time" else lag.K
            z.append(3.92 * (interval.value - truth) / (interval.high - interval.low))
        out[name] = z
    return out
