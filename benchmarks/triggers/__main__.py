"""Triggered recording that is armed, against plain recording: CPU per frame and memory.

    python -m benchmarks.triggers [--seconds 20] [--pre 10]

Runs itself in a network namespace that has loopback alone. Three recorders listen to the same udp_multicast group at
the same time, each in a process of its own: `canid record`, the same armed by marks alone, and armed by a condition on a
signal, whose frames a child decodes. No trigger comes, so nothing is written by the last two. CPU is user and system
time of the recorder's process, and of its child. With `--pre 60 --seconds 70` the buffer is full.
"""

from __future__ import annotations

import argparse
import os
import signal
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.network_namespace import enter


class Used(NamedTuple):
    """What one recorder took so far."""

    own: float  # s
    child: float  # s
    peak: float  # bytes, of the recorder's process


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.triggers", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seconds", type=float, default=20.0, help="of each rate")
    parser.add_argument("--pre", type=float, default=10.0, help="s that the armed recorders keep")
    parser.add_argument("--rates", type=float, nargs="+", default=[2000.0, 8000.0], help="frames/s")
    args = parser.parse_args()
    enter("benchmarks.triggers")
    print("| | frames | CPU per frame (µs) | against plain | of the child (µs) | memory at most (MB) |")
    print("|---|---|---|---|---|---|")
    for rate in args.rates:
        _run(rate, args.seconds, args.pre)
    return 0


def _run(rate: float, seconds: float, pre: float) -> None:
    from benchmarks.reliability.recording import Recording, until
    from tests.fixtures.traffic import Traffic

    armed = ("--pre", pre, "--post", 1)
    cases = {
        "plain": (),
        "armed, marks": ("--trigger", "mark", *armed),
        "armed, brake > 0": ("--trigger", "brake > 0", "--vehicle", "generic", *armed),
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recordings = [
            Recording(folder / f"{k}.blf", *words, talk=folder) for k, words in enumerate(cases.values())
        ]
        until(lambda: bool(_children(recordings[2].process.pid)))
        time.sleep(6.0)  # until the child has imported
        before = [_used(each.process.pid) for each in recordings]
        traffic = Traffic(rate, int(rate * seconds)).start()
        traffic.join()
        time.sleep(1.0)
        after = [_used(each.process.pid) for each in recordings]
        for each in recordings:
            each.process.send_signal(signal.SIGTERM)
        for each in recordings:
            each.process.wait()
    sent = len(traffic.sent)
    costs = [1e6 * (b.own - a.own) / sent for a, b in zip(before, after, strict=True)]
    for case, cost, a, b in zip(cases, costs, before, after, strict=True):
        child = 1e6 * (b.child - a.child) / sent
        print(
            f"| {rate:,.0f} frames/s, {case} | {sent:,} | {cost:.1f} | {cost / costs[0]:.2f} × | {child:.1f} "
            f"| {b.peak / 1e6:.0f} |",
            flush=True,
        )


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(word) for task in tasks for word in (task / "children").read_text().split()]


def _used(pid: int) -> Used:
    status = Path(f"/proc/{pid}/status").read_text()
    peak = next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmHWM"))
    return Used(_cpu(pid), sum(map(_cpu, _children(pid))), peak)


def _cpu(pid: int) -> float:
    """User and system time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    raise SystemExit(main())
