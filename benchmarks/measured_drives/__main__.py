"""Diagnosis of measured drives, whole and in halves: docs/measured.md.

    python -m benchmarks measured_drives [--data ../shared/data] [--minimum 60] [--only diagnosis|rivals|halves]

For each log: the verdict, the evidence for the two causes that a plot of the residual suggests (a drift of the desired
headway, an answer to the lead's acceleration), and the answer to range rate in each half: the same driver should have
the same in both. The table of rivals has canid's model and published car-following models fitted to one half and
simulated in closed loop on the other, both ways. That of halves has the closed-loop gap error on the half that did not
fit, by forms of the baseline (`halves`).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from benchmarks.measured_drives import halves
from benchmarks.other_drive import BASELINE, CHOSEN, Errors, carried, chosen, prepared, summary
from canid import read_trace
from canid.diagnosis.diagnose import diagnose, ready
from canid.diagnosis.driver.driver_model import pedal
from canid.diagnosis.rivals.rival_models import MODELS
from canid.findings import ClosedLoopError, Report
from canid.types import Interval, Trace

CANDIDATES = ("headway_drift", "lead_acceleration")
# people who follow for more than twenty minutes: for the table of rivals, with those below
LONG = tuple(
    (f"asta/asta_{name}.blf", "openacc_asta")
    for name in ("p3_f2_Tesla_Model3", "p3_f4_Audi_A6", "p10_f2_Audi_A6", "p10_f4_Mercedes_AClass")
)
# file -> shipped vehicle
LOGS = (
    ("openacc/human_h22_v3.blf", "openacc"),
    ("openacc/human_h22_v5.blf", "openacc"),
    ("openacc/human_h22_v6.blf", "openacc"),
    ("openacc/acc_short_h2_v4.blf", "openacc"),
    ("openacc/acc_long_h10_v5.blf", "openacc"),
    ("rav4/rav4_highway.blf", "toyota_rav4_2017"),
)
ASTA = tuple(
    (f"asta/asta_{name}.blf", "openacc_asta")
    for name in ("p3_f2_Tesla_Model3", "p3_f4_Audi_A6", "p10_f2_Audi_A6", "p10_f4_Mercedes_AClass")
)


def part(trace: Trace, start: float, stop: float) -> Trace:
    """Cut a stretch out of a drive, from `start` to `stop` of its length (0 to 1)."""
    n = trace.t.size
    at = slice(round(start * n), round(stop * n))
    return trace._replace(
        t=trace.t[at],
        output=trace.output[at],
        inputs=trace.inputs[at],
        gate=trace.gate[at],
        learn=trace.learn[at],
        segment=trace.segment[at],
        signals={role: x[at] for role, x in trace.signals.items()},
    )


def interval_text(interval: Interval | None, digits: int = 2) -> str:
    """An interval in a table's cell."""
    if interval is None or math.isnan(interval.value):
        return "–"
    return f"{interval.value:.{digits}f} [{interval.low:.{digits}f}, {interval.high:.{digits}f}]"


def row(name: str, report: Report) -> str:
    """One line of the table."""
    names = (f.effect + (" (surrogate)" if f.surrogate else "") for f in report.findings)
    highest = {}
    for one in report.tried:
        if one.effect in CANDIDATES and not math.isnan(one.evidence):
            highest[one.effect] = max(highest.get(one.effect, -math.inf), one.evidence)
    evidence = " | ".join(f"{highest[e]:.1f}" if e in highest else "–" for e in CANDIDATES)
    answer = report.extended.channels.get("range_rate") if report.extended.channels else None
    K, late = (interval_text(answer.K), interval_text(answer.tau_plus_dead_time)) if answer else ("–", "–")
    gain = interval_text(report.gain)
    fit = f"{report.baseline.fit_percent:.0f}" if report.baseline.channels else "–"
    masked = sum(m.stop - m.start for m in report.masked)
    return (
        f"| {name} | {report.verdict.value} | {', '.join(names) or '–'} | {evidence} | {fit} | {gain} | {K} | {late} "
        f"| {masked:.0f} |"
    )


def crossed(trace: Trace) -> str:
    """How the baseline of one half simulates the other: fit in percent, as it is and with the other half's own offset.

    The offset contains the desired headway: where freeing it helps, the desired headway differs between the halves.
    """
    halves = [
        ready(one, np.ones(one.t.size, dtype=bool)) for one in (part(trace, 0.0, 0.5), part(trace, 0.5, 1.0))
    ]
    cells = []
    for here, there in (halves, halves[::-1]):
        if here is None or there is None:
            return "–"
        out = pedal(here.fitted.model, there.data, here.fitted.q)
        y, used = there.data.output.y, there.data.output.usable
        left = y[used] - out[used]
        deviation = np.linalg.norm(y[used] - y[used].mean())
        fits = [100 * (1 - np.linalg.norm(x) / deviation) for x in (left, left - left.mean())]
        cells.append(" / ".join(f"{fit:.0f}" for fit in fits))
    return ", ".join(cells)


def both_ways(trace: Trace, minimum: float) -> Errors:
    """Each half fits, the other judges: means of the two; {}: a half is too short."""
    halves = [part(trace, 0.0, 0.5), part(trace, 0.5, 1.0)]
    ways = []
    for this, other in (halves, halves[::-1]):
        here, there = prepared(this), prepared(other)
        if here is None or there is None:
            return {}
        model = chosen(here, diagnose(this, minimum=minimum))
        ways.append(carried(here, there, {BASELINE: here.fitted, CHOSEN: model}))
    names = ways[0].keys() & ways[1].keys()
    return {
        name: ClosedLoopError(*np.mean([way[name] for way in ways], axis=0))
        for name in ways[0]
        if name in names
    }


def rivals(data: Path, minimum: float) -> None:
    """Print the table of rivals."""
    names = (BASELINE, CHOSEN, *(model.name for model in MODELS))
    print(f"| log | {' | '.join(names)} |\n|{'---|' * (len(names) + 1)}")
    rows = []
    for log, vehicle in (*LONG, *(one for one in LOGS if one[1] == "openacc")):
        path = data / log
        if not path.exists():
            print(f"| {log} | the file is not there |{' |' * (len(names) - 1)}")
            continue
        errors = both_ways(read_trace(path, vehicle), minimum)
        if errors:
            rows.append(errors)
        cells = (f"{errors[name].gap:.3f} / {errors[name].speed:.3f}" if errors else "–" for name in names)
        print(f"| {path.stem} | {' | '.join(cells)} |", flush=True)
    if rows:
        print("\n" + "\n".join(summary(rows)))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks measured_drives",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--minimum", type=float, default=60.0, help="s that a part must have")
    parser.add_argument("--only", choices=("diagnosis", "rivals", "halves"))
    args = parser.parse_args()
    if args.only in (None, "diagnosis"):
        diagnoses(args.data, args.minimum)
    if args.only in (None, "rivals"):
        print()
        rivals(args.data, args.minimum)
    if args.only in (None, "halves"):
        print()
        closed_loop_of_halves(args.data)


def closed_loop_of_halves(data: Path) -> None:
    """Print the table of closed-loop gap errors on the other half."""
    followers = [log for log in (*ASTA, *LOGS) if not log[0].startswith("rav4") and (data / log[0]).exists()]
    traces = {Path(log): read_trace(data / log, vehicle) for log, vehicle in followers}
    parts = {path: (part(x, 0.0, 0.5), part(x, 0.5, 1.0)) for path, x in traces.items()}
    print("\n".join(halves.table(parts)))


def diagnoses(data: Path, minimum: float) -> None:
    """Print the tables of whole drives and halves."""
    heads = (
        "log", "verdict", "named", *CANDIDATES, "fit %", "gain held out", "K of range rate", "τ+θ s", "masked s",
    )  # fmt: skip
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    by_halves = []
    for log, vehicle in LOGS:
        path = data / log
        if not path.exists():
            print(f"| {log} | the file is not there | | | | | | | | |")
            continue
        trace = read_trace(path, vehicle)
        for name, start, stop in (("whole", 0.0, 1.0), ("first half", 0.0, 0.5), ("second half", 0.5, 1.0)):
            report = diagnose(part(trace, start, stop), minimum=minimum)
            print(row(f"{path.stem}, {name}", report), flush=True)
        by_halves.append(f"| {path.stem} | {crossed(trace)} |")
    print(
        "\n| log | half simulated by the other half's driver, fit %: as it is / with its own offset |\n|---|---|"
    )
    print("\n".join(by_halves))


if __name__ == "__main__":
    main()
