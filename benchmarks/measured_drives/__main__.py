"""Diagnosis of measured drives, whole and in halves: docs/measured.md.

    python -m benchmarks measured_drives [--data ../shared/data] [--minimum 60] [--halves]

For each log: the verdict, the evidence for the two causes that a plot of the residual suggests (a drift of the desired
headway, an answer to the lead's acceleration), and the answer to range rate in each half: the same driver should have
the same in both. With --halves: the closed-loop gap error on the half that did not fit instead (`halves`).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from benchmarks.measured_drives import halves
from canid import read_trace
from canid.diagnosis.diagnose import diagnose, ready
from canid.diagnosis.driver.driver_model import pedal
from canid.findings import Report
from canid.types import Interval, Trace

CANDIDATES = ("headway_drift", "lead_acceleration")
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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks measured_drives",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--minimum", type=float, default=60.0, help="s that a part must have")
    parser.add_argument(
        "--halves", action="store_true", help="closed-loop gap error on the half that did not fit"
    )
    args = parser.parse_args()
    if args.halves:
        followers = [
            log for log in (*ASTA, *LOGS) if not log[0].startswith("rav4") and (args.data / log[0]).exists()
        ]
        traces = {Path(log): read_trace(args.data / log, vehicle) for log, vehicle in followers}
        print(
            "\n".join(
                halves.table({path: (part(x, 0.0, 0.5), part(x, 0.5, 1.0)) for path, x in traces.items()})
            )
        )
        return
    heads = (
        "log", "verdict", "named", *CANDIDATES, "fit %", "gain held out", "K of range rate", "τ+θ s", "masked s",
    )  # fmt: skip
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    by_halves = []
    for log, vehicle in LOGS:
        path = args.data / log
        if not path.exists():
            print(f"| {log} | the file is not there | | | | | | | | |")
            continue
        trace = read_trace(path, vehicle)
        for name, start, stop in (("whole", 0.0, 1.0), ("first half", 0.0, 0.5), ("second half", 0.5, 1.0)):
            report = diagnose(part(trace, start, stop), minimum=args.minimum)
            print(row(f"{path.stem}, {name}", report), flush=True)
        by_halves.append(f"| {path.stem} | {crossed(trace)} |")
    print(
        "\n| log | half simulated by the other half's driver, fit %: as it is / with its own offset |\n|---|---|"
    )
    print("\n".join(by_halves))


if __name__ == "__main__":
    main()
