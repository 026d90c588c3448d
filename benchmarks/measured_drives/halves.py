"""Closed-loop gap error of the baseline on the half that did not fit it: constant headway, other forms, both criteria.

NRMSE = rms of the gap's error over the rms of the measured gap (Punzo & Montanino 2016), stretches of up to 30 s behind the
recorded lead, each from its measured state.

The closed-loop criterion adds to −2 log likelihood of the one-step predictions N log(mean square of the gap's error) on the
half that fits, N the number of stretches: the error of a stretch is one path of the driver's slow noise, so each stretch
counts as one observation with an unknown variance.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from canid.models.diagnosis import masks
from canid.models.diagnosis.driver import baseline_form, closed_loop
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import DESIRED, K1, OFFSET
from canid.models.diagnosis.fitting.uncertainty import sandwich
from canid.models.diagnosis.prepared_drive import Prepared, ready
from canid.models.effects import CATALOGUE
from canid.models.effects.wanted_gap import Form
from canid.values.types import Array, Trace

DRIVERS = tuple(effect for effect in CATALOGUE if effect.where == "driver")
# evaluations of the closed loop
EVALUATIONS = 120
VARIANTS = ("time headway", "form by evidence", "gap", "time headway, closed loop", "gap, closed loop")


class Half(NamedTuple):
    """One half, prepared."""

    prepared: Prepared
    where: tuple[closed_loop.Stretch, ...]


def half(trace: Trace) -> Half | None:
    """Prepare a half; None where it is too short."""
    usable, _ = masks.recognise(trace, CATALOGUE)
    prepared = ready(trace, usable)
    if prepared is None:
        return None
    where = closed_loop.stretches(prepared.data.output.usable, prepared.trace.dt)
    return Half(prepared, where) if where else None


def gap_error(of: Half, driver: FittedDriver) -> Array:
    """Error of the simulated gap (m,), m."""
    data = of.prepared.data
    road = closed_loop.Road(data, data.seen.speed + data.seen.range_rate, of.prepared.trace.output)
    gap, _ = closed_loop.drive(road, closed_loop.Ride((driver,), (None,), (), None), of.where)
    there = np.isfinite(gap)
    return gap[there] - data.seen.gap[there]


def nrmse(of: Half, driver: FittedDriver) -> float:
    """Normalised closed-loop gap error of a driver on a half."""
    error, data = gap_error(of, driver), of.prepared.data
    gaps = np.concatenate([data.seen.gap[one.start : one.stop] for one in of.where])
    return float(np.sqrt(np.mean(error**2) / np.mean(gaps**2)))


def in_closed_loop(of: Half, solved: FittedDriver) -> FittedDriver:
    """Move gain and wanted gap to where both criteria agree best; all other parameters follow their conditional means."""
    place = {k: i for i, k in enumerate(solved.fitted.free)}
    own = [k for k in (OFFSET, K1, DESIRED) if k in place]
    at = [place[k] for k in own]
    C = sandwich(solved.fitted, of.prepared.data.output.dt).C
    precision = np.linalg.inv(C[np.ix_(at, at)])
    follow = C[:, at] @ precision
    free = list(solved.fitted.free)

    def moved(step: Array) -> FittedDriver:
        q = solved.q.copy()
        q[free] = np.clip(q[free] + follow @ step, solved.model.low[free], solved.model.high[free])
        return solved._replace(fitted=solved.fitted._replace(q=q))

    def cost(z: Array) -> float:
        step = z * scale
        square = float(np.mean(np.minimum(gap_error(of, moved(step)) ** 2, 1e4)))
        return float(step @ precision @ step) + len(of.where) * float(np.log(square))

    scale = np.sqrt(np.diag(C)[at])
    found = minimize(
        cost, np.zeros(len(own)), method="Nelder-Mead", options={"maxfev": EVALUATIONS, "xatol": 0.05}
    )
    return moved(found.x * scale)


def variants(of: Half) -> dict[str, FittedDriver]:
    """The baselines of a half."""
    plain, data = of.prepared.fitted, of.prepared.data
    gap = baseline_form.of_form(data, plain, Form.GAP)
    chosen = baseline_form.choose(of.prepared.trace, data, plain, DRIVERS).fitted
    out = {
        "time headway": plain,
        "form by evidence": chosen,
        "time headway, closed loop": in_closed_loop(of, plain),
    }
    if gap is not None:
        out |= {"gap": gap, "gap, closed loop": in_closed_loop(of, gap)}
    return out


def table(traces: dict[Path, tuple[Trace, Trace]]) -> list[str]:
    """Lines of the table: each half fits, the other judges."""
    lines = [f"| log | fitted on | {' | '.join(VARIANTS)} |", f"|---|---|{'---|' * len(VARIANTS)}"]
    every: list[list[float]] = []
    for path, parts in traces.items():
        halves = [half(part) for part in parts]
        for name, here, there in (("first", halves[0], halves[1]), ("second", halves[1], halves[0])):
            if here is None or there is None:
                lines.append(f"| {path.stem} | {name} | too short |{' |' * (len(VARIANTS) - 1)}")
                continue
            fits = variants(here)
            row = [nrmse(there, fits[v]) if v in fits else np.nan for v in VARIANTS]
            every.append(row)
            cells = " | ".join(f"{x:.3f}" for x in row)
            lines.append(f"| {path.stem} | {name} ({fits['form by evidence'].model.form.value}) | {cells} |")
            print(lines[-1], flush=True)
    for name, of in (("median", np.nanmedian), ("mean", np.nanmean)):
        lines.append(f"| {name} | | {' | '.join(f'{x:.3f}' for x in of(np.array(every), axis=0))} |")
    better = (np.array(every) < np.array(every)[:, :1]).sum(axis=0)
    lines.append(f"| better than time headway | of {len(every)} | {' | '.join(map(str, better.tolist()))} |")
    return lines
