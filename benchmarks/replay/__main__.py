"""`canid replay --speed max` as a multiple of real time, and what each stage costs.

    python -m benchmarks replay [LOG VEHICLE ...] [--seek MINUTES]

The whole command in a process of its own, imports included; then the stages in this one, in CPU time per second of log.
With --seek alone the time of seeks in a simulated log of so many minutes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.replay.seeking import seeks
from canid.analysis.drive import drive_reader
from canid.analysis.drive.drive_parameters import samples
from canid.analysis.session.estimator_process import CHUNK_S
from canid.io.logs import open_log, write_log
from canid.models.pipeline import pipeline
from canid.models.simulation import START_UTC, frames, simulate
from canid.signals.samples.sampler import sampler
from canid.signals.vehicle import Vehicle, decoder, read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Frame

LOGS = ["replay_logs/following_urban.blf", "generic", "replay_logs/following_motorway.asc", "generic"]


def live_chunks(path: str, vehicle: Vehicle) -> dict[str, float]:
    """Frames to samples in chunks of 50 ms, as live."""
    parts: dict[int, list[Frame]] = {}
    for frame in open_log(path):
        parts.setdefault(int(frame.t / CHUNK_S), []).append(frame)
    chunks = [columns_of(part) for part in parts.values()]
    running = sampler(vehicle, pipeline.DT)
    state, last = running.init(), time.process_time()
    for chunk in chunks:
        state, _ = running.step(state, chunk)
    spent = time.process_time() - last
    print(f"{1e3 * spent / len(chunks):.2f} ms per chunk of {1e3 * CHUNK_S:.0f} ms, without the estimators")
    return {"frames to samples in chunks of 50 ms": spent}


def sought(minutes: float) -> None:
    """Print the time of seeks."""
    vehicle = read_vehicle("generic")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "drive.blf"
        write_log(log, frames(simulate(minutes, seed=1), vehicle), START_UTC)
        took = sorted(seeks(log, vehicle))
    middle, longest = took[len(took) // 2], took[-1]
    print(f"{len(took)} seeks in {minutes:.0f} min: {middle:.2f} s in the middle, {longest:.2f} s at most")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks replay", description=__doc__.splitlines()[0])
    parser.add_argument("given", nargs="*", metavar="LOG VEHICLE", default=LOGS)
    parser.add_argument("--seek", type=float, metavar="MINUTES")
    args = parser.parse_args()
    if args.seek is not None:
        sought(args.seek)
        return
    given = args.given
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
        spent = {"read frames": time.process_time() - last}
        init, step = decoder(vehicle)
        state, last = init(), time.process_time()
        for chunk in open_log(path).columns():
            state, _ = step(state, chunk)
        spent["read and decode columns"] = time.process_time() - last
        last = time.process_time()
        drive = drive_reader.read_drive(path, vehicle, estimating=False)
        spent["from the file to the samples"] = time.process_time() - last
        spent |= live_chunks(path, vehicle)
        for estimator in pipeline.estimators(vehicle, drive.trace.dt):
            which = estimator.name
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
