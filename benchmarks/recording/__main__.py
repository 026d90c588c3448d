"""Recording against python-can's own logger and candump: CPU per frame, frames lost, and what a kill leaves.

    python -m benchmarks.recording [--seconds 20] [--rates 2000 8000 20000] [--channel vcan0] [--buses 4]

Runs itself in a network namespace that has loopback alone. `canid record` and `python -m can.logger` listen to the same
udp_multicast group at the same time, each in a process of its own, and write a .blf each; on a channel of SocketCAN
`candump -L` writes a .log as well, with the receive buffer that canid asks for. At each rate, and in a burst of
200,000 frames as fast as the sender goes. CPU is user and system time of the whole process, less what it takes without a
frame. In the last run all get SIGKILL in the middle of 4,000 frames/s.

With `--buses` canid alone records so many groups at 8,000 frames/s each for `--seconds`.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from benchmarks.network_namespace import ROOT, enter

BURST = 200_000  # frames
KILL_RATE = 4000.0  # frames/s
BUS_RATE = 8000.0  # frames/s of each of several buses: a full 1 Mbit/s bus
DRAINED = 3.0  # s after the last frame, for what was not read yet


class Used(NamedTuple):
    """What one recorder made of a run."""

    name: str
    cpu: float  # s
    frames: int  # in the file
    said: str


class Recorder(NamedTuple):
    """A program that records."""

    name: str
    command: list[str]
    output: str
    ready: str  # what it says once it listens; "": nothing


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recording", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seconds", type=float, default=20.0, help="of each rate")
    parser.add_argument("--rates", type=float, nargs="*", default=[2000.0, 8000.0, 20000.0])
    parser.add_argument("--burst", type=int, default=BURST, help="frames; 0: none")
    parser.add_argument("--channel", default="", help="of SocketCAN; default: a group of udp_multicast")
    parser.add_argument("--buses", type=int, default=0)
    args = parser.parse_args()
    enter("benchmarks.recording")
    if args.buses:
        return _several(args.buses, args.seconds)
    recorders = _recorders(args.channel)
    names = ", ".join(each.name for each in recorders)
    print(f"| | sent | recorded by {names} | CPU per recorded frame (µs) | canid's share of can.logger's |")
    print("|---|---|---|---|---|")
    idle = _run(recorders, args.channel, "1", 0, signal.SIGINT)[1]
    for rate in args.rates:
        sent, used = _run(recorders, args.channel, str(rate), int(rate * args.seconds), signal.SIGINT)
        _row(f"{rate:,.0f} frames/s", sent, used, idle)
    if args.burst:
        sent, used = _run(recorders, args.channel, "inf", args.burst, signal.SIGINT)
        _row(f"a burst of {args.burst:,}", sent, used, idle)
        print(f"|  | | dropped, as canid counts them: {_dropped(used[0].said)} | | |")
    sent, used = _run(recorders, args.channel, str(KILL_RATE), int(KILL_RATE) * 5, signal.SIGKILL)
    print(f"| SIGKILL after {sent:,} | {sent:,} | {', '.join(f'{u.frames:,}' for u in used)} | | |")
    return 0


def _recorders(channel: str) -> list[Recorder]:
    from benchmarks.reliability.recording import BEGIN
    from tests.fixtures.traffic import WORDS

    words = ["-i", "socketcan", "-c", channel] if channel else list(WORDS)

    def python(module: str, *rest: str) -> list[str]:
        code = f"{BEGIN}import runpy; runpy.run_module({module!r}, run_name='__main__')"
        return [sys.executable, "-u", "-c", code, *rest]

    found = [
        Recorder("canid", python("canid", "record", *words, "-o", "0.blf"), "0.blf", "listen-only"),
        Recorder("can.logger", python("can.logger", *words, "-f", "1.blf"), "1.blf", "Connected"),
    ]
    if channel and shutil.which("candump"):
        # -L prints the lines that -l would write; the buffer is the one that canid asks for
        command = ["candump", "-L", "-r", str(32 * 1024 * 1024), channel]
        found.append(Recorder("candump", command, "candump.out", ""))
    return found


def _row(name: str, sent: int, used: list[Used], idle: list[Used]) -> None:
    # of a recorder that loses frames, those that it has
    costs = [1e6 * (u.cpu - i.cpu) / max(u.frames, 1) for u, i in zip(used, idle, strict=True)]
    got = ", ".join(f"{u.frames:,}" for u in used)
    shown = ", ".join(f"{c:.1f}" for c in costs)
    print(f"| {name} | {sent:,} | {got} | {shown} | {costs[0] / costs[1]:.2f} |", flush=True)


def _dropped(said: str) -> str:
    found: list[str] = re.findall(r"([\d,]+) dropped", said)
    return found[-1] if found else "?"


def _run(recorders: list[Recorder], channel: str, rate: str, total: int, end: int) -> tuple[int, list[Used]]:
    """Frames sent, and what each recorder made of them."""
    from tests.fixtures.traffic import GROUP

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with _listening(recorders, folder) as processes:
            sender = subprocess.Popen(
                [sys.executable, "-m", "benchmarks.recording.sender", channel or GROUP, rate, str(total)],
                stdout=subprocess.PIPE,
                cwd=ROOT,
            )
            assert sender.stdout is not None
            sent = int(sender.stdout.read())
            sender.wait()
            sender.stdout.close()
            if end != signal.SIGKILL:
                time.sleep(DRAINED)
            for process in processes:
                process.send_signal(end)
            spent = [os.wait4(process.pid, 0)[2] for process in processes]
            for process in processes:
                process.returncode = 0  # waited for already
        return sent, [
            Used(
                each.name,
                one.ru_utime + one.ru_stime,
                _frames(folder / each.output),
                (folder / f"{each.name}.said").read_text(errors="replace"),
            )
            for each, one in zip(recorders, spent, strict=True)
        ]


def _frames(path: Path) -> int:
    """Frames in a log, as python-can reads it; whole lines of candump."""
    from tests.fixtures.readers import by_python_can

    if path.suffix == ".out":
        return path.read_bytes().count(b"\n")
    return len(by_python_can(path).frames)


@contextmanager
def _listening(recorders: list[Recorder], folder: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """All recorders, once they listen."""
    from benchmarks.reliability.recording import until

    processes = []
    for each in recorders:
        said = folder / f"{each.name}.said"
        output = folder / each.output if not each.ready else said
        with output.open("wb") as out, said.open("ab") as error:
            processes.append(subprocess.Popen(each.command, cwd=folder, stdout=out, stderr=error))
    for each in recorders:
        said = folder / f"{each.name}.said"
        until(lambda each=each, said=said: each.ready in said.read_text())
    time.sleep(0.5)  # candump says nothing
    try:
        yield processes
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.wait()


def _several(buses: int, seconds: float) -> int:
    """Several buses at once, canid alone: CPU, frames lost."""
    from benchmarks.reliability.recording import BEGIN
    from canid.io.logs import open_log
    from tests.fixtures.traffic import GROUP

    first = GROUP.rpartition(".")[0]
    groups = [f"{first}.{k + 1}" for k in range(buses)]
    words = [word for group in groups for word in ("-c", group)]
    command = ["record", "-i", "udp_multicast", *words, "--bus-kwargs", "hop_limit=0", "-o", "0.blf"]
    code = f"{BEGIN}import runpy; runpy.run_module('canid', run_name='__main__')"
    recorder = Recorder("canid", [sys.executable, "-u", "-c", code, *command], "0.blf", "listen-only")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with _listening([recorder], folder) as (process,):
            total = int(BUS_RATE * seconds)
            began = time.monotonic()
            sender = [sys.executable, "-m", "benchmarks.recording.sender", *groups, str(BUS_RATE), str(total)]
            sent = buses * int(subprocess.run(sender, stdout=subprocess.PIPE, cwd=ROOT, check=True).stdout)
            took = time.monotonic() - began
            time.sleep(DRAINED)
            process.send_signal(signal.SIGINT)
            used = os.wait4(process.pid, 0)[2]
            process.returncode = 0
        got = sum(len(chunk.t) for chunk in open_log(folder / "0.blf").columns())
        said = (folder / "canid.said").read_text(errors="replace")
    cpu = used.ru_utime + used.ru_stime
    print(
        f"{buses} buses, {took:.0f} s: {got:,} of {sent:,} frames recorded, {_dropped(said)} dropped;"
        f" {100 * cpu / took:.1f} % of a core, {1e6 * cpu / sent:.2f} µs per frame;"
        f" the sender took {resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime / took:.2f} cores"
    )
    return int(got != sent)


if __name__ == "__main__":
    sys.exit(main())
