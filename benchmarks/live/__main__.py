"""Frame-to-estimate latency, CPU share and start-up, on python-can's udp_multicast between processes.

    python -m benchmarks live [--seconds 30]

Runs itself in a network namespace that has loopback alone, so that no packet leaves the machine. A sender process
plays the generic vehicle's frames at 50 frames/s, and with frames that nobody maps in between at 4,000 and 8,000.
Latency: from the kernel's receive stamp of the frame that completed a sample, until the estimate is in the process that
shows it: queue, recorder, pipe, estimator's process, and back. CPU: recorder and estimator together, of one core.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
BUS = {"interface": "udp_multicast", "channel": "239.74.163.2"}
LOOPBACK = "ip link set lo up multicast on; ip route add 224.0.0.0/4 dev lo; exec"


def send(rate: float, seconds: float) -> None:
    """The sender process: mapped frames of a simulated drive, filled up or thinned out to `rate` frames/s."""
    from canid.io.buses.send import onto
    from canid.models.simulation import frames, simulate
    from canid.signals.vehicle import read_vehicle
    from canid.values.types import Frame

    mapped = frames(
        simulate(minutes=(seconds + 5) / 60 + 0.1, seed=3, profile="urban"), read_vehicle("generic")
    )
    span = mapped[-1].t
    # drawn frames, not every k-th: the messages take turns
    keep = min(int(rate * span), len(mapped))
    mapped = sorted(random.Random(0).sample(mapped, keep), key=lambda f: f.t)
    wanted = int(rate * span) - keep
    filler = [Frame((k + 0.5) * span / wanted, 0, 0x600 + k % 64, bytes(8)) for k in range(wanted)]
    every = sorted([*mapped, *filler], key=lambda f: f.t)
    print("ready", flush=True)
    onto(BUS, every, speed=1.0)


def start_sender(rate: float, seconds: float) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, __file__, "--send", str(rate), "--seconds", str(seconds)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    return process


def load(rate: float, seconds: float, folder: str) -> None:
    from canid.analysis.session.session import Result, SessionSettings, World, session
    from canid.io.buses.bus_opener import open_buses
    from canid.values.types import Estimate

    sender = start_sender(rate, seconds)
    # the estimator needs a while to start: what waited for it is not counted
    warm = 8.0
    before, earlier = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.monotonic()
    latencies, last = [], None
    settings = SessionSettings("generic", f"{folder}/{int(rate)}.blf", seconds)
    for item in session(open_buses([{**BUS, "hop_limit": 0}]), settings):
        if isinstance(item, World):
            last = item
        elif isinstance(item, Result) and isinstance(item.item, Estimate) and last is not None:
            start_ns = last.recorder.start_ns
            if start_ns is not None and time.monotonic() - began > warm and item.item.t > warm:
                latencies.append(time.time() - start_ns * 1e-9 - item.frame_t)
    elapsed = time.monotonic() - began
    # the estimator's process has ended and is counted; the sender, which has not, is no part of canid
    own, child = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    used = own.ru_utime + own.ru_stime - before.ru_utime - before.ru_stime
    estimating = child.ru_utime + child.ru_stime - earlier.ru_utime - earlier.ru_stime
    sender.kill()
    sender.wait()
    print_row(rate, latencies, last, used / elapsed, estimating / elapsed)


def print_row(rate, latencies, last, used, estimating) -> None:  # type: ignore[no-untyped-def]
    latencies.sort()
    p50, p99 = (
        latencies[int(q * (len(latencies) - 1))] * 1e3 if latencies else float("nan") for q in (0.5, 0.99)
    )
    stats, counts = last.recorder, last.estimator
    print(
        f"{rate:6.0f} frames/s offered: {stats.frames:,} received, {stats.written:,} recorded, "
        f"{counts.dropped} not estimated; latency p50 {p50:.1f} ms, p99 {p99:.1f} ms ({len(latencies)} estimates); "
        f"of a core: reader and recorder {100 * used:.0f} %, estimators {100 * estimating:.0f} %",
        flush=True,
    )


def startup(folder: str) -> None:
    def wall(*args: str) -> float:
        best = float("inf")
        for _ in range(5):
            t = time.perf_counter()
            subprocess.run([sys.executable, "-m", "canid", *args], check=True, capture_output=True)
            best = min(best, time.perf_counter() - t)
        return best

    bare = float("inf")
    for _ in range(5):
        t = time.perf_counter()
        subprocess.run([sys.executable, "-c", ""], check=True)
        bare = min(bare, time.perf_counter() - t)
    version, usage = 1e3 * wall("--version"), 1e3 * wall("--help")
    print(f"canid --version {version:.0f} ms, canid --help {usage:.0f} ms (python alone {1e3 * bare:.0f} ms)")
    sender = start_sender(1000, 40)
    out, lines = f"{folder}/first.blf", f"{folder}/first.jsonl"
    arguments = [
        "-i",
        BUS["interface"],
        "-c",
        BUS["channel"],
        "--vehicle",
        "generic",
        "--record",
        out,
        "--json",
        lines,
    ]
    began = time.time()
    canid = subprocess.Popen(
        [sys.executable, "-m", "canid", "live", *arguments, "--duration", "30"], stdout=subprocess.DEVNULL
    )
    first = float("nan")
    while canid.poll() is None and first != first:
        if Path(lines).exists() and Path(lines).stat().st_size:
            first = time.time() - began
        time.sleep(0.01)
    canid.wait()
    sender.kill()
    sender.wait()
    from canid.io.logs import open_log

    estimate = json.loads(Path(lines).read_text().splitlines()[0])
    print(
        f"canid live: first recorded frame {open_log(out).start_utc - began:.2f} s after the start of the process"
    )
    print(f'canid live: first estimate line ("{estimate["status"]}") after {first:.2f} s')


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks live", description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--send", type=float)
    parser.add_argument("--inside", action="store_true")
    args = parser.parse_args()
    if args.send:
        send(args.send, args.seconds)
    elif not args.inside:
        command = [sys.executable, __file__, "--inside", "--seconds", str(args.seconds)]
        inside = ["unshare", "-n", "bash", "-c", f'{LOOPBACK} "$@"', "bash", *command]
        sys.exit(subprocess.run(inside, check=False).returncode)
    else:
        with tempfile.TemporaryDirectory() as folder:
            startup(folder)
            for rate in (50.0, 4000.0, 8000.0):
                load(rate, args.seconds, folder)


if __name__ == "__main__":
    main()
