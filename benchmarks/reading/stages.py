"""CPU seconds of each stage of `canid identify`, one after the other in one process, and its largest memory.

python -m benchmarks.reading.stages LOG VEHICLE
"""

from __future__ import annotations

import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from canid.analysis.drive import drive_parameters, drive_reader
from canid.mathematics.estimators import ESTIMATORS, pooling, whole_drive, windows
from canid.mathematics.identification.armax import order_selection
from canid.signals import vehicle


def main() -> None:
    def lap(stage: str) -> None:
        nonlocal last
        now = time.process_time()
        print(f"{stage}: {now - last:.2f} s", flush=True)
        last = now

    last = 0.0
    lap("imports")
    trace = drive_reader.read_trace(sys.argv[1], vehicle.read_vehicle(sys.argv[2]))
    lap("reading, decoding, lead, grid and gate")
    with open("/proc/self/status") as status:
        high = next(line for line in status if line.startswith("VmHWM"))
    print(f"memory after reading: {int(high.split()[1]) / 1024:.0f} MB")
    for each in ESTIMATORS:
        made = each.make(trace.input_names, trace.dt, whole_drive.settings_of(each, trace, {}))
        windows.reported_estimates([made], drive_parameters.samples(trace))
        lap(f"windows, {each.name}")
    for each in ESTIMATORS:
        if each.identify is not None:
            each.identify(trace, whole_drive.settings_of(each, trace, {}))
            lap(f"whole drive, {each.name}")
    rows = pooling.pooled(trace)
    ready = rows.learn & np.isfinite(rows.output) & np.isfinite(rows.inputs).all(axis=1)
    order_selection.compare(rows.output, rows.inputs, ready, segment=rows.segment, dt=rows.dt)
    lap("orders")


if __name__ == "__main__":
    main()
