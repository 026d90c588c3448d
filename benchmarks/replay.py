"""`canid replay --speed max` as a multiple of real time, and what each stage costs.

    python benchmarks/replay.py [LOG VEHICLE ...]

The whole command in a process of its own, imports included; then the stages in this one, in CPU time per second of log.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

from canid import logs
from canid.drive import samples
from canid.estimators import ESTIMATORS
from canid.frames import open_log
from canid.vehicle import decoder, read_vehicle

LOGS = ["replay_logs/following_urban.blf", "generic", "replay_logs/following_motorway.asc", "generic"]


def main() -> None:
    given = sys.argv[1:] or LOGS
    for path, name in zip(given[::2], given[1::2], strict=True):
        wall = float("inf")
        for _ in range(3):
            began = time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "canid", "replay", path, "--vehicle", name],
                check=True,
                capture_output=True,
            )
            wall = min(wall, time.perf_counter() - began)
        vehicle = read_vehicle(name)
        duration, count, last = 0.0, 0, time.process_time()
        for frame in open_log(path):
            duration, count = frame.t, count + 1
        spent = {"read": time.process_time() - last}
        init, step = decoder(vehicle)
        state, last = init(), time.process_time()
        for frame in open_log(path):
            state, _ = step(state, frame)
        spent["decode"] = time.process_time() - last - spent["read"]
        last = time.process_time()
        drive = logs.read_drive(path, vehicle, estimating=False)
        spent["the desk's columns, from the file to the gate"] = time.process_time() - last
        for which, make in ESTIMATORS:
            estimator = make(drive.trace.input_names, drive.trace.dt, getattr(vehicle, which))
            rows = list(samples(drive.trace))
            state, last, said = estimator.init(), time.process_time(), 0
            for row in rows:
                state, estimate = estimator.step(state, row)
                said += estimate is not None
            spent[which] = time.process_time() - last
            print(
                f"{which}: {1e6 * spent[which] / len(rows):.0f} µs per sample, "
                f"{1e3 * spent[which] / max(said, 1):.1f} ms per estimate ({said} estimates)"
            )
        print(
            f"{path}: {duration:.0f} s, {count:,} frames; canid replay {wall:.1f} s = {duration / wall:.0f} × real time"
        )
        print(
            "  CPU ms per s of log: "
            + ", ".join(f"{what} {1e3 * s / duration:.1f}" for what, s in spent.items())
        )


if __name__ == "__main__":
    main()
