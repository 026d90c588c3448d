"""Recording against python-can's own logger: CPU per frame, frames lost, and what a kill leaves.

    python -m benchmarks.recording [--seconds 20]

Runs itself in a network namespace that has loopback alone. `canid record` and `python -m can.logger` listen to the same
udp_multicast group at the same time, each in a process of its own, and write a .blf each: at 2,000 and 8,000 frames/s,
and a burst of 60,000 frames as fast as the sender goes. CPU is user and system time of the whole process, less what
it takes without a frame. In the last run both get SIGKILL in the middle of 4,000 frames/s.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from benchmarks.network_namespace import enter

BURST = 60_000  # frames
DRAINED = 3.0  # s after the last frame, for what was not read yet


class Used(NamedTuple):
    """What one recorder made of a run."""

    cpu: float  # s
    frames: int  # in the file, as far as python-can reads it


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recording", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seconds", type=float, default=20.0, help="of each rate")
    args = parser.parse_args()
    enter("benchmarks.recording")
    print("| | sent | recorded by canid, can.logger | CPU per frame (µs) | ratio |")
    print("|---|---|---|---|---|")
    idle = _run(0.0, 0, signal.SIGINT)[1]
    for rate in (2000.0, 8000.0):
        sent, used = _run(rate, int(rate * args.seconds), signal.SIGINT)
        _row(f"{rate:,.0f} frames/s", sent, used, idle)
    sent, used = _run(float("inf"), BURST, signal.SIGINT)
    _row(f"a burst of {BURST:,}", sent, used, idle)
    sent, used = _run(4000.0, 4000 * 5, signal.SIGKILL)
    print(f"| SIGKILL after {sent:,} | {sent:,} | {', '.join(f'{u.frames:,}' for u in used)} | | |")
    return 0


def _row(name: str, sent: int, used: list[Used], idle: list[Used]) -> None:
    costs = [1e6 * (u.cpu - i.cpu) / sent for u, i in zip(used, idle, strict=True)]
    got = ", ".join(f"{u.frames:,}" for u in used)
    print(
        f"| {name} | {sent:,} | {got} | {', '.join(f'{c:.1f}' for c in costs)} | {costs[1] / costs[0]:.2f} × |",
        flush=True,
    )


def _run(rate: float, total: int, end: int) -> tuple[int, list[Used]]:
    """Frames sent, and what canid and python-can's logger made of them."""
    from tests.fixtures.readers import by_python_can
    from tests.fixtures.traffic import WORDS, Traffic

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with _listening(folder, WORDS) as processes:
            traffic = Traffic(rate, total).start()
            if end == signal.SIGKILL:
                traffic.wait(total / rate * 0.9)
            else:
                traffic.join()
                time.sleep(DRAINED)
            sent = len(traffic.sent)
            for process in processes:
                process.send_signal(end)
            spent = [os.wait4(process.pid, 0)[2] for process in processes]
            for process in processes:
                process.returncode = 0  # waited for already
            traffic.stop()
        return sent, [
            Used(one.ru_utime + one.ru_stime, len(by_python_can(folder / f"{k}.blf").frames))
            for k, one in enumerate(spent)
        ]


@contextmanager
def _listening(folder: Path, words: tuple[str, ...]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Both recorders, once they listen."""
    from benchmarks.reliability.recording import BEGIN, until

    modules = (
        ("canid", ["record", *words, "-o", "0.blf"], "listen-only"),
        ("can.logger", [*words, "-f", "1.blf"], "Connected"),
    )
    processes = []
    for module, rest, _ in modules:
        with (folder / module).open("wb") as output:
            code = f"{BEGIN}import runpy; runpy.run_module({module!r}, run_name='__main__')"
            process = subprocess.Popen(
                [sys.executable, "-u", "-c", code, *rest], cwd=folder, stdout=output, stderr=output
            )
        processes.append(process)
    for module, _, word in modules:
        until(lambda module=module, word=word: word in (folder / module).read_text())
    try:
        yield processes
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.wait()


if __name__ == "__main__":
    sys.exit(main())
