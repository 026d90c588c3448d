"""Exported drivers in SUMO: each drives behind the recorded leads, and its distributions are compared with the log's.

    python -m benchmarks.sumo.exported_drivers [--first-seed S] [--out FILE.json] [--page FILE.html]
        [--into docs/evidence/sumo.md]

Drives: SUMO's own IDM and EIDM with drawn settings (what was planted has to come back), canid's simulator with a pedal, and
the measured drives of --data (skipped with a message where they are missing). SUMO's default vehicle type is driven as
well. Needs `pip install 'canid[bench]'`.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

import canid
from benchmarks.sumo.compared_distributions import (
    compared,
    measured_columns,
    measured_runs,
    simulated_columns,
)
from benchmarks.sumo.exported_table import page, table
from canid.analysis.sumo.driver_model import DriverModel, NoModel, fit, to_json
from canid.analysis.sumo.following import following
from canid.analysis.sumo.pooled_driver import Drive, pooled
from canid.analysis.sumo.vehicle_types import element, vehicle_type
from canid.io.logs import write_log
from canid.models.simulation import LEADS, START_UTC, frames, simulate
from canid.models.simulation.leads import speed_profile
from canid.signals.vehicle import read_vehicle
from canid.values.types import Trace

# the table of a page stands between these lines
BEGIN, END = "<!-- exported: begin -->", "<!-- exported: end -->"
# file below --data, vehicle
MEASURED = (
    *((f"asta/asta_{name}.blf", "openacc_asta") for name in (
        "p3_f2_Tesla_Model3", "p3_f4_Audi_A6", "p10_f2_Audi_A6", "p10_f4_Mercedes_AClass")),
    *((f"openacc/{name}.blf", "openacc") for name in (
        "human_h22_v3", "human_h22_v5", "human_h22_v6", "acc_short_h2_v4", "acc_long_h10_v5")),
)  # fmt: skip
# SUMO's parameter of each of IDM's and EIDM's
PLANTED = {"maxSpeed": "v0", "tau": "T", "minGap": "s0", "accel": "a", "decel": "b"}
DEFAULT = '<vType id="default"/>'


class Case(NamedTuple):
    """A drive."""

    name: str
    trace: Trace
    output: str
    truth: dict[str, float]  # {}: nobody knows


def main(argv: Sequence[str] | None = None) -> int:
    """Run all drives and print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sumo.exported_drivers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--first-seed", type=int, help="default: drawn")
    parser.add_argument("--minutes", type=float, default=10.0, help="of a simulated drive")
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder of the measured drives"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.json")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the table of this page")
    parser.add_argument("--page", type=Path, metavar="FILE.html", help="a page of its own")
    args = parser.parse_args(argv)
    if find_spec("libsumo") is None:
        print("libsumo is not installed: pip install 'canid[bench]'", file=sys.stderr)
        return 2
    seed = secrets.randbelow(10**6) if args.first_seed is None else args.first_seed
    print(f"first seed {seed}", file=sys.stderr)
    rows = []
    for case in (*simulated(seed, args.minutes), *measured(args.data)):
        rows.append(row(case, seed))
        print(rows[-1]["drive"], rows[-1].get("model", rows[-1].get("reason")), file=sys.stderr, flush=True)
    made = {"seed": seed, "drives": rows}
    text = table(rows, seed)
    print(text)
    if args.out is not None:
        args.out.write_text(json.dumps(made, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if args.page is not None:
        args.page.write_text(page(rows, seed), encoding="utf-8")
    if args.into is not None:
        before, _, rest = args.into.read_text(encoding="utf-8").partition(BEGIN)
        _, _, after = rest.partition(END)
        args.into.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    return 0


def row(case: Case, seed: int) -> dict[str, Any]:
    """Fit, export, drive, compare."""
    begin = time.process_time()
    found = fit(case.trace, case.output)
    cpu = time.process_time() - begin
    minutes = float(case.trace.t[-1] - case.trace.t[0]) / 60
    if isinstance(found, NoModel):
        return {"drive": case.name, "minutes": minutes, "reason": found.reason}
    columns = following(case.trace)
    assert columns is not None
    runs = measured_runs(columns)
    log = measured_columns(runs)
    of = vehicle_type("driver", pooled(case.name, [Drive(case.name, found)]))
    got = simulated_columns(runs, "\n".join(element(of)), of.id, seed)
    default = simulated_columns(runs, DEFAULT, "default", seed)
    return {
        "drive": case.name,
        "minutes": minutes,
        "cpu_s": cpu,
        "model": found.model,
        "why": found.why,
        "nrmse": found.chosen.error._asdict(),
        "exported": _plain(compared(log, got)),
        "default": _plain(compared(log, default)),
        "second_half": _second_half(case, seed),
        "collisions": int(sum(np.sum(x <= 0.0) for x in got["gap"])),
        "percentiles": {
            name: {
                "measured": np.percentile(np.concatenate(log[name]), range(1, 100)).round(3).tolist(),
                "exported": np.percentile(np.concatenate(got[name]), range(1, 100)).round(3).tolist(),
            }
            for name in log
        },
        "planted": _planted(found, case.truth),
        "fit": to_json(found),
    }


def _second_half(case: Case, seed: int) -> dict[str, Any] | None:
    """The model of the first half behind the leads of the second one; None: too little of the drive."""
    middle = case.trace.t.size // 2
    first, second = _part(case.trace, slice(0, middle)), following(_part(case.trace, slice(middle, None)))
    found = fit(first, case.output)
    runs = [] if second is None else measured_runs(second)
    if isinstance(found, NoModel) or not runs:
        return None
    of = vehicle_type("driver", pooled(case.name, [Drive(case.name, found)]))
    got = simulated_columns(runs, "\n".join(element(of)), of.id, seed)
    return _plain(compared(measured_columns(runs), got))


def _part(of: Trace, rows: slice) -> Trace:
    return of._replace(
        t=of.t[rows], output=of.output[rows], inputs=of.inputs[rows], gate=of.gate[rows], learn=of.learn[rows],
        segment=of.segment[rows], signals={name: x[rows] for name, x in of.signals.items()},
        bound=None, variance=None,
    )  # fmt: skip


def _plain(of: dict[str, Any]) -> dict[str, Any]:
    return {
        name: {key: x._asdict() if hasattr(x, "_asdict") else x for key, x in one._asdict().items()}
        for name, one in of.items()
    }


def _planted(found: DriverModel, truth: dict[str, float]) -> dict[str, list[float]]:
    """Of the planted model's own calibration: truth, value, low, high."""
    model = {1.0: "IDM", 2.0: "EIDM"}.get(truth.get("model", 0.0))
    out = {}
    for one in found.candidates:
        if one.model != model:
            continue
        for key, x in one.parameters.items():
            out[key] = [truth[key], *x]
        if "sd" in truth:
            out["sd"], out["time"] = [truth["sd"], *one.noise.sd], [truth["time"], *one.noise.time]
    return out


def simulated(seed: int, minutes: float) -> Iterator[Case]:
    """Drives of SUMO's IDM and EIDM through radar noise and .blf, and of canid's simulator."""
    from benchmarks.sumo.outcomes import VEHICLE, recorded
    from benchmarks.sumo.sumo_drive import STEP_S, drive
    from benchmarks.sumo.sumo_drivers import SumoDriver

    vehicle = read_vehicle(VEHICLE)
    n = round(60 * minutes / STEP_S)
    for k, (model, profile) in enumerate((m, p) for m in ("IDM", "EIDM") for p in LEADS):
        rng = np.random.default_rng([seed, k])
        settings = {
            "tau": rng.uniform(0.9, 1.8), "accel": rng.uniform(1.0, 2.0), "decel": rng.uniform(1.5, 3.0),
            "minGap": rng.uniform(1.5, 4.0), "maxSpeed": rng.uniform(36.0, 45.0),
        }  # fmt: skip
        truth = {PLANTED[key]: float(x) for key, x in settings.items()} | {
            "model": 1.0 if model == "IDM" else 2.0
        }
        if model == "EIDM":
            sd, persists = float(rng.uniform(0.1, 0.3)), float(rng.uniform(1.0, 4.0))
            settings |= {
                "sigmaerror": sd / settings["accel"], "tPersDrive": persists,
                "sigmagap": 0, "sigmaleader": 0, "treaction": 0, "ccoolness": 0, "jerkmax": 100,
            }  # fmt: skip
            truth |= {"sd": sd, "time": persists}
        lead = speed_profile(LEADS[profile], n, STEP_S, rng)
        driven = drive(SumoDriver(model, settings, STEP_S, seed + k), lead)
        yield Case(f"SUMO {model}, {profile}", recorded(driven, vehicle), "accel", truth)
    for profile in LEADS:
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder, "drive.blf")
            made = simulate(minutes, seed=seed, profile=profile)
            write_log(log, frames(made, read_vehicle("generic")), START_UTC)
            yield Case(f"canid, pedal, {profile}", canid.read_trace(log, "generic"), "pedal", {})


def measured(data: Path) -> Iterator[Case]:
    """The measured drives."""
    for log, vehicle in MEASURED:
        if not (data / log).exists():
            print(f"{log}: skipped, it is not in {data}", file=sys.stderr)
            continue
        yield Case(Path(log).stem, canid.read_trace(data / log, vehicle), "accel", {})


if __name__ == "__main__":
    sys.exit(main())
