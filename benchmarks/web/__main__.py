"""Start-up, latency and CPU of the live page, on python-can's udp_multicast between processes.

    python -m benchmarks web [--seconds 30] [--rate 4000]

Runs itself in a network namespace that has loopback alone. The frames are those of `python -m benchmarks live`.

Start-up: from the start of `canid live --web` until its page answers. Latency: from the kernel's receive stamp of the
frame that completed an estimate until the estimate is at a websocket client, which is a process of its own. CPU: of the
server's process, of one core. With 20 clients, one that never reads and one that floods, the same again.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from itertools import pairwise
from typing import Any

from benchmarks import network_namespace
from benchmarks.live.__main__ import BUS, start_sender

TOKEN = "a-token-of-the-benchmark"
STARTS = 5
# s until the estimators have started, and what waited for them is done
WARM_S = 8.0


def free_port() -> int:
    """A port that was free just now."""
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def startup() -> float:
    """S from the start of `canid live --web` until the page answers."""
    port = free_port()
    words = ["-i", BUS["interface"], "-c", BUS["channel"], "--vehicle", "generic", "--duration", "3"]
    web = ["--web", f"127.0.0.1:{port}", "--web-token", TOKEN]
    began = time.monotonic()
    command = [sys.executable, "-m", "canid", "live", *words, *web]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while True:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/") as answer:
                answer.read()
            break
        except OSError:
            time.sleep(0.005)
    took = time.monotonic() - began
    process.terminate()
    process.wait()
    return took


def cpu(pid: int) -> float:
    """S of a core that a process has used."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def load(rate: float, seconds: float, folder: str, **kinds: int) -> str:
    """One row: a session at `rate` frames/s with these clients."""
    from canid.analysis.session.session import Result, SessionSettings, World, session
    from canid.io.buses.bus_opener import open_buses
    from canid.io.recording.controls import Controls
    from canid.ui.cli.health_lines import health_lines
    from canid.ui.cli.live_session import recorded
    from canid.ui.web import address
    from canid.ui.web.access import Access
    from canid.ui.web.live_page import LivePage
    from canid.ui.web.requests import OF_SESSION
    from canid.values.text import json_values
    from canid.values.types import Estimate

    sock, where = address.listening(address.Address("127.0.0.1", free_port()))
    controls = Controls()
    start = {"mode": "live", "title": "benchmark", "vehicle": "generic"}
    page = LivePage(sock, Access(where.host, where.port, TOKEN), start, controls, OF_SESSION, print)
    words = [word for kind, n in kinds.items() for word in (f"--{kind}", str(n))]
    clients = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.web.clients", page.url, *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    sender = start_sender(rate, seconds)
    frame_times: dict[tuple[str, float], float] = {}
    last: Any = None
    used: list[tuple[float, float]] = []
    began = time.monotonic()
    record = f"{folder}/{sum(kinds.values())}.blf"
    settings = SessionSettings("generic", record, seconds)
    for item in session(open_buses([{**BUS, "hop_limit": 0}]), settings, controls=controls):
        if isinstance(item, World):
            last = item
            for event in item.events:
                page.put(event)
            page.lines(health_lines(item), item.output)
            page.status(json_values.plain(recorded(item)))
            if time.monotonic() - began > WARM_S and not item.stopping:
                used.append((time.monotonic(), cpu(page.pid)))
        elif isinstance(item, Result):
            page.put(item.item)
            if isinstance(item.item, Estimate) and item.item.t > WARM_S:
                frame_times[item.item.estimator, round(item.item.t, 6)] = item.frame_t
    page.close()
    sender.kill()
    sender.wait()
    out, _ = clients.communicate("")
    start_s = last.recorder.start_ns * 1e-9
    latencies = []
    for line in out.splitlines():
        name, t, at = line.split()
        frame_t = frame_times.get((name, float(t)))
        if frame_t is not None:
            latencies.append(float(at) - start_s - frame_t)
    latencies.sort()
    p50, p99 = (
        (1e3 * latencies[int(q * (len(latencies) - 1))] for q in (0.5, 0.99)) if latencies else (0.0, 0.0)
    )
    share = (used[-1][1] - used[0][1]) / (used[-1][0] - used[0][0])
    worst = max((b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(used[::20])) if len(used) > 40 else share
    stats = last.recorder
    who = ", ".join(f"{n} {kind}" for kind, n in kinds.items())
    return (
        f"| {who} | {stats.frames:,} | {stats.drops_bus + stats.drops_disk} | {p50:.0f} ms | {p99:.0f} ms "
        f"({len(latencies)}) | {100 * share:.1f} % (worst 5 s: {100 * worst:.1f} %) |"
    )


def main() -> None:
    """Print the table of docs/web.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks web", description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--rate", type=float, default=4000.0)
    args = parser.parse_args()
    network_namespace.enter("benchmarks.web")
    times = sorted(startup() for _ in range(STARTS))
    print(
        f"start-up until the page answers: {times[len(times) // 2]:.2f} s (of {STARTS}, worst {times[-1]:.2f} s)"
    )
    print(f"\n{args.rate:,.0f} frames/s, {args.seconds:.0f} s:\n")
    print("| clients | frames recorded | dropped | latency p50 | p99 | server, of a core |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        print(load(args.rate, args.seconds, folder, prompt=1), flush=True)
        print(load(args.rate, args.seconds, folder, prompt=18, stalled=1, flooding=1), flush=True)


if __name__ == "__main__":
    main()
