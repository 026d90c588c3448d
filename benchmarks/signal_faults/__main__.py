"""Signal checks: faults planted in drives, caught and named; false alarms on clean drives and on measured logs.

    python -m benchmarks signal_faults [--drives 10] [--clean 50] [--minutes 5] [--first-seed 81000]

Drives of three simulators (both planting ones and canid's own) with all noises and profiles. A fault is planted in what
the sensors say, before frames and sampling. `caught`: a finding (or a gate) begins after the onset, and withholds the
estimates where the model needs the signal; `named`: it has the right name; delay: from the onset, in s.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.signal_faults import drives
from benchmarks.signal_faults.faults import FAULTS, Fault
from canid.analysis.drive.drive_reader import read_trace
from canid.signals.samples import learning_gate
from canid.signals.signal_checks import signal_checks
from canid.values.types import Driver, Trace
from tests.plants.monitor_runs import samples

DATA = Path(__file__).parents[3] / "shared" / "data"
# logs and their vehicle files; of a folder
MEASURED = (
    ("openacc", "openacc"),
    ("asta", "openacc_asta"),
    ("openlka", str(DATA / "openlka" / "openlka.toml")),
    ("rav4", "toyota_rav4_2017"),
)
# samples of a gate from which on it has been noticed
GATE_SAMPLES = 10


class Outcome(NamedTuple):
    """One fault in one drive."""

    caught: bool
    named: bool
    delay: float  # s, until it is named, or else caught; NaN: never
    others: tuple[str, ...]  # findings with another name


def outcome(fault: Fault, of: drives.Drive, minutes: float) -> Outcome:
    """Plant a fault, and look for it."""
    at = fault.share * minutes * 60.0
    rng = np.random.default_rng([int(of.planted.truth["seed"]), 72])
    messages = fault.plant(of.messages, at, rng)
    trace = drives.trace(messages, declared=fault.declared)
    if fault.wheel_speed:
        wheels = trace.signals["speed"] / fault.wheel_speed + 0.05 * rng.standard_normal(trace.t.size)
        trace = trace._replace(signals=trace.signals | {"wheel_speed": wheels})
    if fault.gate:
        return _gated(fault, trace, at)
    found = drives.findings(trace, drives.intervals(messages))
    fresh = [one for one in found if one.raised >= at and (one.withholds or not fault.withholds)]
    right = [one for one in fresh if one.name in fault.names]
    first = min((one.raised for one in right or fresh), default=np.nan)
    others = tuple(sorted({one.name for one in found} - set(fault.names)))
    return Outcome(bool(fresh), bool(right), first - at, others)


def _gated(fault: Fault, trace: Trace, at: float) -> Outcome:
    """Whether the learning gate names it, and learns nothing more."""
    state, driver = learning_gate.init(), Driver()
    noticed: list[float] = []
    for sample in samples(trace):
        values = dict(sample.signals)
        if fault.name == "reverse gear" and sample.t >= at:
            values["gear"] = -1.0
        state, judged = learning_gate.step(state, sample.t, values, driver, trace.dt)
        if judged.gate.name in fault.names:
            noticed.append(sample.t)
    fresh = [t for t in noticed if t >= at]
    caught = len(fresh) >= GATE_SAMPLES
    early = ("FREE_DRIVING before",) if len(noticed) > len(fresh) else ()
    return Outcome(caught, caught, fresh[0] - at if fresh else np.nan, early)


def table(number: int, minutes: float, first: int) -> None:
    """Print a row per fault."""
    measured = [drives.drive(first + k, minutes) for k in range(number)]
    print(f"{len(FAULTS)} faults x {number} drives of {minutes:g} min")
    print(f"{'fault':46} {'caught':>6} {'named':>6} {'delay, median':>14} {'largest':>8}  other findings")
    total = Counter[str]()
    for fault in FAULTS:
        found = [outcome(fault, of, minutes) for of in measured]
        caught, named = sum(one.caught for one in found), sum(one.named for one in found)
        total.update(caught=caught, named=named, all=number)
        delays = [one.delay for one in found if one.delay == one.delay]
        middle, largest = (np.median(delays), max(delays)) if delays else (np.nan, np.nan)
        others = Counter(name for one in found for name in one.others)
        says = ", ".join(f"{name} {n}" for name, n in others.most_common())
        print(f"{fault.name:46} {caught:6} {named:6} {middle:12.0f} s {largest:6.0f} s  {says}", flush=True)
    print(f"{'all':46} {total['caught']:6} {total['named']:6}   of {total['all']}")


def clean(number: int, minutes: float, first: int) -> None:
    """Count false alarms, for pedal and acceleration, three radars and six noises; and measure the cost."""
    alarms, spent, many, free, ages = [], 0.0, 0, 0.0, 0
    for k in range(number):
        output = ("pedal", "accel")[k % 2]
        of = drives.drive(first + 1000 + k, minutes, radar=k // 2 % len(drives.RADARS))
        trace = drives.trace(of.messages, output)
        came = drives.intervals(of.messages)
        began = time.process_time()
        found = drives.findings(trace, came, output)
        spent += time.process_time() - began
        many += trace.t.size
        free += sum(gate.name == "FREE_DRIVING" for gate in trace.gate)
        alarms += [(of.name, output, one) for one in found]
        ages += trace.t.size > 0
    print(f"\nclean: {len(alarms)} false alarms on {number} drives, {many / 36000:.1f} h")
    for name, output, one in alarms:
        print(f"  {name}, output {output}: {one.name}, {one.since:.0f} s: {one.says}")
    print(f"free driving: {100 * free / max(many, 1):.2f} % of their time")
    print(
        f"cost: {1e6 * spent / max(many, 1):.0f} µs of processor time per sample, with its reading from a trace"
    )


def recorded() -> Iterator[tuple[Path, str]]:
    """Every measured log with its vehicle file."""
    for folder, vehicle in MEASURED:
        for path in sorted((DATA / folder).glob("*.blf")):
            yield path, vehicle


def measured_logs() -> None:
    """Print a line per measured log."""
    print("\nmeasured logs")
    for path, vehicle in recorded():
        found = read_trace(path, vehicle).findings
        says = "; ".join(f"{one.name} since {one.since:.0f} s" for one in found) or "nothing"
        print(f"  {path.parent.name}/{path.name:44} {says}", flush=True)
        for one in found:
            print(f"      {signal_checks.sentence(one)}")
    if not DATA.exists():
        print(f"  none: {DATA} is not there")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=10, help="drives per fault; default: 10")
    parser.add_argument("--clean", type=int, default=50, help="clean drives; default: 50")
    parser.add_argument("--minutes", type=float, default=5.0, help="of each drive; default: 5")
    parser.add_argument("--first-seed", type=int, default=81_000)
    args = parser.parse_args()
    if args.drives:
        table(args.drives, args.minutes, args.first_seed)
    if args.clean:
        clean(args.clean, args.minutes, args.first_seed)
    measured_logs()


if __name__ == "__main__":
    main()
