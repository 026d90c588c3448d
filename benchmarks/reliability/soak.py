"""Hours of traffic between processes: what is dropped, how memory grows, what it costs.

The sender plays the generic vehicle's frames with others that are not mapped in between; `canid live` records, runs both
estimators, and draws its screen on a pseudo-terminal. CPU and memory are those of both of its processes. The bus is
udp_multicast, or a channel of SocketCAN that has no wire.
"""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.reliability.recording import ROOT, until
from tests.fixtures.traffic import BUS, WORDS

MEMORY, CPU = 5e6, 0.25  # bytes of growth, share of a core at up to 4,000 frames/s: what is promised
CPU_RATE = 4000.0  # frames/s
# the drive that is played over and over, minutes
DRIVE_MIN = 10.0
# s after which memory, descriptors and threads are compared; a third of the run where that is shorter
SETTLED_S = 600.0
INTERVAL_S = 5.0  # s between two samples
_PAGE = os.sysconf("SC_PAGE_SIZE")
_TICK = os.sysconf("SC_CLK_TCK")


def run(hours: float, rate: float, channel: str = "") -> int:
    """Print what came out; returns the exit code. `channel`: of SocketCAN, such as vcan0."""
    with tempfile.TemporaryDirectory() as name:
        rows, sent, wrong = _soak(Path(name), hours * 3600.0, rate, channel)
    for row in rows:
        print(row)
    for each in wrong:
        print(f"wrong: {each}")
    print(f"{sent:,} frames in {hours * 60:.1f} min")
    return int(bool(wrong))


def _soak(folder: Path, seconds: float, rate: float, channel: str) -> tuple[list[str], int, list[str]]:
    log, reported = folder / "soak.blf", folder / "soak.jsonl"
    bus = {"interface": "socketcan", "channel": channel} if channel else BUS
    where = ["-i", "socketcan", "-c", channel] if channel else WORDS
    words = ["live", *where, "--vehicle", "generic", "--record", str(log), "--json", str(reported)]
    environment = os.environ | {
        "TERM": "xterm-256color",
        "COLUMNS": "110",
        "LINES": "40",
        "PYTHONPATH": str(ROOT),
    }
    terminal, inside = pty.openpty()
    live = subprocess.Popen(
        [sys.executable, "-m", "canid", *words],
        stdin=subprocess.DEVNULL,
        stdout=inside,
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    os.close(inside)
    drawn = _Drawn(terminal)
    assert live.stderr is not None
    said: list[bytes] = []
    hearing = threading.Thread(target=lambda: said.extend(live.stderr or ()), daemon=True)
    hearing.start()
    until(lambda: any(b"listen-only" in text for text in said))
    sender = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.reliability.soak", json.dumps(bus), str(rate), str(seconds)],
        stdout=subprocess.PIPE,
    )
    samples: list[Usage] = []
    began = time.monotonic()
    while sender.poll() is None:
        samples.append(Usage(time.monotonic() - began, *_used(live.pid)))
        time.sleep(min(INTERVAL_S, seconds / 20))
    assert sender.stdout is not None
    sent = int(sender.stdout.read())
    time.sleep(1.0)
    samples.append(Usage(time.monotonic() - began, *_used(live.pid)))
    live.send_signal(signal.SIGTERM)
    code = live.wait(120.0)
    drawn.join()
    hearing.join(5.0)
    live.stderr.close()
    sender.stdout.close()
    return _judged(samples, drawn.text, code, sent, log, reported, rate)


def _judged(
    samples: list[Usage], screen: str, code: int, sent: int, log: Path, reported: Path, rate: float
) -> tuple[list[str], int, list[str]]:
    from canid.io.logs import open_log

    opened = open_log(log)
    recorded = sum(1 for _ in opened)
    dropped = [int(n.replace(",", "")) for n in re.findall(r"([\d,]+) dropped", screen)]
    later = [each for each in samples if each.t >= min(SETTLED_S, samples[-1].t / 3)]
    settled, last = later[0], later[-1]
    share = (last.cpu - settled.cpu) / (last.t - settled.t)
    growth = last.memory - settled.memory
    # a file or a folder is open for a instant now and then: the usual number in each half counts
    halves = later[: len(later) // 2] or later, later[len(later) // 2 :]
    descriptors = [int(median(each.descriptors for each in half)) for half in halves]
    threads = [int(median(each.threads for each in half)) for half in halves]
    estimates = [json.loads(line) for line in reported.read_text().splitlines()]
    names = {row.get("estimator") for row in estimates if row.get("status") == "ok"}
    bus = dropped[-1] if dropped else "?"
    ok = ", ".join(sorted(str(name) for name in names if name))
    busy = os.getloadavg()[0]
    rows = [
        f"frames recorded {recorded:,} of {sent:,}; the bus line says {bus} dropped",
        f"CPU {100 * share:.1f} % of a core, from {settled.t:.0f} s on (the machine's load at the end: {busy:.1f})",
        f"memory {settled.memory / 1e6:.1f} MB at {settled.t:.0f} s, {growth / 1e6:+.1f} MB at the end",
        f"descriptors {descriptors[0]} and {descriptors[1]}, threads {threads[0]} and {threads[1]} in the two halves after",
        f"{len(estimates):,} estimates, ok were {ok}; {len(screen):,} characters drawn at the end",
    ]
    parts = [samples[len(samples) * k // 4 - 1] for k in (1, 2, 3, 4)]
    rows.append(
        "memory by quarters: " + ", ".join(f"{m / 1e6:.1f} MB" for m in (each.memory for each in parts))
    )
    wrong = []
    if recorded != sent:
        wrong.append(f"frames were lost: {sent - recorded:,}")
    if not dropped or any(dropped):
        wrong.append(f"drops are counted: {sorted(set(dropped))}")
    if opened.damage:
        wrong.append(f"the log is damaged: {opened.damage.says}")
    if "not estimated" in screen:
        wrong.append("the estimators did not get every frame")
    if growth > MEMORY:
        wrong.append(f"memory grew by {growth / 1e6:.1f} MB, {MEMORY / 1e6:.0f} MB are promised")
    if descriptors[1] > descriptors[0] or threads[1] > threads[0]:
        wrong.append(f"descriptors or threads grew: {descriptors}, {threads}")
    if share > CPU and rate <= CPU_RATE:
        wrong.append(f"{100 * share:.1f} % of a core, {100 * CPU:.0f} % are promised")
    if code != 143:
        wrong.append(f"exit code {code}")
    return rows, sent, wrong


class Usage(NamedTuple):
    """What both processes use."""

    t: float  # s
    cpu: float  # s
    memory: float  # bytes
    descriptors: int
    threads: int


class _Drawn:
    """Reads a pseudo-terminal, as a terminal would; keeps what was drawn last."""

    def __init__(self, terminal: int):
        self.text = ""
        self._terminal = terminal
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def join(self) -> None:
        self._thread.join(5.0)

    def _read(self) -> None:
        while True:
            try:
                data = os.read(self._terminal, 65536)
            except OSError:  # the other end is closed
                os.close(self._terminal)
                return
            self.text = (self.text + data.decode(errors="replace"))[-200_000:]


def _used(pid: int) -> tuple[float, float, int, int]:
    """CPU s, resident bytes, open descriptors and threads of a process and its children."""
    cpu = memory = 0.0
    descriptors = threads = 0
    for each in (pid, *_children(pid)):
        try:
            fields = Path(f"/proc/{each}/stat").read_text().rsplit(")", 1)[1].split()
            cpu += (int(fields[11]) + int(fields[12])) / _TICK
            memory += int(Path(f"/proc/{each}/statm").read_text().split()[1]) * _PAGE
            descriptors += len(os.listdir(f"/proc/{each}/fd"))
            threads += len(os.listdir(f"/proc/{each}/task"))
        except OSError:
            continue
    return cpu, memory, descriptors, threads


def _children(pid: int) -> Iterator[int]:
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            yield from map(int, (task / "children").read_text().split())
        except OSError:
            continue


def _send(bus: dict[str, Any], rate: float, seconds: float) -> int:
    """The sender process: returns how many frames it has sent."""
    from canid.io.buses.send import onto
    from canid.models.simulation import frames, simulate
    from canid.signals.vehicle import read_vehicle
    from canid.values.types import Frame

    drive = simulate(minutes=min(DRIVE_MIN, seconds / 60 + 0.2), seed=3, profile="urban")
    mapped = frames(drive, read_vehicle("generic"))
    span = mapped[-1].t + mapped[1].t - mapped[0].t
    every = span / max(rate * span - len(mapped), 1.0)  # s between two that are not mapped

    def stream() -> Iterator[Frame]:
        k, turn = 0, 0.0
        while True:
            for frame in mapped:
                t = frame.t + turn
                if t >= seconds:
                    return
                while (k + 0.5) * every < t:
                    yield Frame(
                        (k + 0.5) * every, 0, 0x600 + k % 64, (k * 2654435761 % 2**64).to_bytes(8, "big")
                    )
                    k += 1
                yield frame._replace(t=t)
            turn += span

    return int(onto(bus, stream(), speed=1.0))


if __name__ == "__main__":
    print(_send(json.loads(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])))
