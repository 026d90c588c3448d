"""Diagnosis of measured drives, whole and in halves: docs/evidence/measured.md.

    python -m benchmarks measured_drives [--data ../shared/data] [--minimum 60] [--only diagnosis|rivals|halves|remnant]

For each log and its halves: the verdict, what is named in the mean law and in the remnant with its gain in one-step log
score on held-out data, the answer to range rate, and from which size on three effects would have been named; then both
halves as two drives of one driver, each judged by a fit to the other. The table of rivals has canid's model and published
car-following models fitted to one half and simulated in closed loop on the other, both ways. That of halves has the
closed-loop gap error on the half that did not fit, by forms of the baseline (`halves`); that of the remnant has the law of
each person's noise on the others' drives.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from benchmarks.measured_drives import halves, remnant
from benchmarks.other_drive import (
    BASELINE,
    CHOSEN,
    RECOMMENDED,
    Errors,
    carried,
    chosen,
    prepared,
    summary,
    with_recommended,
)
from canid import read_trace
from canid.analysis.comparison.halves import part as cut
from canid.models.diagnosis.diagnose import diagnose, diagnose_drives
from canid.models.diagnosis.driver.driver_model import pedal
from canid.models.diagnosis.prepared_drive import ready
from canid.models.diagnosis.rivals.rival_models import MODELS
from canid.values.findings import ClosedLoopError, Report
from canid.values.types import Interval, Trace
from tests.fixtures.measured_logs import LOGS, LONG_LOGS

# effects whose size at which this drive would show them stands in the table
SEEN = ("lead_acceleration", "relative_speed_dead_zone", "asymmetric_gain")


def part(trace: Trace, start: float, stop: float) -> Trace:
    """Cut a stretch out of a drive, from `start` to `stop` of its length (0 to 1)."""
    n = trace.t.size
    return cut(trace, slice(round(start * n), round(stop * n)))


def interval_text(interval: Interval | None, digits: int = 2) -> str:
    """An interval in a table's cell."""
    if interval is None or math.isnan(interval.value):
        return "–"
    return f"{interval.value:.{digits}f} [{interval.low:.{digits}f}, {interval.high:.{digits}f}]"


def row(name: str, report: Report) -> str:
    """One line of the table."""
    law = [f for f in report.findings if f.where == "remnant"]
    mean = [f.effect + (" (surrogate)" if f.surrogate else "") for f in report.findings if f not in law]
    of_law = [
        "; ".join(
            f"{f.effect} {', '.join(f'{iv.value:.2g}' for iv in f.parameters.values())}: "
            f"{interval_text(f.log_score_gain, 1)}"
            for f in law
        )
    ]
    seen = {one.effect: f"{one.strength:.2g}" for one in report.visible}
    form = report.baseline.form
    answer = report.extended.channels.get("range_rate") if report.extended.channels else None
    K, late = (interval_text(answer.K), interval_text(answer.tau_plus_dead_time)) if answer else ("–", "–")
    cells = (
        name, report.verdict.value, ", ".join(mean) or "–", interval_text(report.log_score_gain, 1), of_law[0] or "–",
        form.name.replace("_", " ") if form else "–",
        f"{report.baseline.fit_percent:.0f}" if report.baseline.channels else "–",
        K, late, *(seen.get(effect, "–") for effect in SEEN),
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def both_halves(trace: Trace, minimum: float) -> str:
    """What the halves say together, and what each gains by what the other says."""
    parts = [part(trace, 0.0, 0.5), part(trace, 0.5, 1.0)]
    report = diagnose_drives(parts, ("first", "second"), minimum=minimum)
    gains = [
        f"{one.name} {effect} {interval_text(iv, 1)}"
        for one in report.drives
        for effect, iv in one.gains.items()
    ]
    return f"{report.verdict.value}; {'; '.join([*gains, *report.differ]) or 'no cause of the mean'}"


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
        report = diagnose(this, minimum=minimum, rivals=True)
        models = {BASELINE: here.fitted, CHOSEN: chosen(here, report)}
        ways.append(with_recommended(carried(here, there, models), report))
    names = ways[0].keys() & ways[1].keys()
    return {
        name: ClosedLoopError(*np.mean([way[name] for way in ways], axis=0))
        for name in ways[0]
        if name in names
    }


def rivals(data: Path, minimum: float) -> None:
    """Print the table of rivals."""
    names = (BASELINE, CHOSEN, RECOMMENDED, *(model.name for model in MODELS))
    print(f"| log | {' | '.join(names)} |\n|{'---|' * (len(names) + 1)}")
    rows = []
    for log, vehicle in (*LONG_LOGS, *(one for one in LOGS if one[1] == "openacc")):
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
    parser.add_argument("--only", choices=("diagnosis", "rivals", "halves", "remnant"))
    args = parser.parse_args()
    if args.only in (None, "diagnosis"):
        diagnoses(args.data, args.minimum)
    if args.only in (None, "rivals"):
        print()
        rivals(args.data, args.minimum)
    if args.only in (None, "halves"):
        print()
        closed_loop_of_halves(args.data)
    if args.only in (None, "remnant"):
        print()
        people = [log for log in (*LONG_LOGS, *LOGS) if "human" in log[0] or "asta" in log[0]]
        traces = {Path(log).stem: read_trace(args.data / log, vehicle) for log, vehicle in people}
        print("\n".join(remnant.table(traces)))


def closed_loop_of_halves(data: Path) -> None:
    """Print the table of closed-loop gap errors on the other half."""
    followers = [
        log for log in (*LONG_LOGS, *LOGS) if not log[0].startswith("rav4") and (data / log[0]).exists()
    ]
    traces = {Path(log): read_trace(data / log, vehicle) for log, vehicle in followers}
    parts = {path: (part(x, 0.0, 0.5), part(x, 0.5, 1.0)) for path, x in traces.items()}
    print("\n".join(halves.table(parts)))


def diagnoses(data: Path, minimum: float) -> None:
    """Print the tables of whole drives and halves."""
    heads = (
        "log", "verdict", "named in the mean", "log score, nats/min", "in the remnant: log score, nats/min", "form",
        "fit %", "K of range rate", "τ+θ s", *(f"{effect} would show from" for effect in SEEN),
    )  # fmt: skip
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    by_halves, together = [], []
    for log, vehicle in (*LONG_LOGS, *LOGS):
        path = data / log
        if not path.exists():
            print(f"| {log} | the file is not there |{' |' * (len(heads) - 2)}")
            continue
        trace = read_trace(path, vehicle)
        for name, start, stop in (("whole", 0.0, 1.0), ("first half", 0.0, 0.5), ("second half", 0.5, 1.0)):
            report = diagnose(part(trace, start, stop), minimum=minimum)
            print(row(f"{path.stem}, {name}", report), flush=True)
        by_halves.append(f"| {path.stem} | {crossed(trace)} |")
        together.append(f"| {path.stem} | {both_halves(trace, minimum)} |")
    print(
        "\n| log | half simulated by the other half's driver, fit %: as it is / with its own offset |\n|---|---|"
    )
    print("\n".join(by_halves))
    print(
        "\n| log | halves diagnosed together: verdict; gain on each half by a fit to the other, nats/min |\n|---|---|"
    )
    print("\n".join(together))


if __name__ == "__main__":
    main()
