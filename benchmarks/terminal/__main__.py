"""Cost of the terminal view: of a picture, and of `canid record` with the view against without.

    python -m benchmarks terminal [--seconds 20] [--rate 4000]

A picture: CPU time of drawing a full view of 168 s of a log, by size of the terminal, and its share of a core at the
redraw rate. With against without: `canid record` on udp_multicast, in a network namespace of its own, with a
pseudo-terminal of 80x24 and of 200x60 that is read, and with a pipe; CPU of the recorder, frames received and recorded.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import pty
import resource
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
from benchmarks.live.__main__ import BUS, LOOPBACK, start_sender
from benchmarks.terminal.views import recorded

SIZES = ((40, 15), (80, 24), (120, 40), (200, 60))
AT_S = 168.0
PICTURES = 100
# s for the start of both processes
START_S = 2.0


def pictures() -> None:
    """CPU time of a picture, by size; every fifth one belongs to a new second of the trend, as at 5 per second."""
    from canid.ui.terminal.ansi import drawn
    from canid.ui.terminal.progress import REDRAW_HZ
    from canid.ui.views.terminal_view.picture import render

    view = recorded(AT_S)
    for columns, rows in SIZES:
        size = 0
        began = time.process_time()
        for k in range(PICTURES):
            now = view._replace(t=view.t + k / REDRAW_HZ)
            size += len(drawn(render(now, columns, rows), columns, color=True).encode())
        used = (time.process_time() - began) / PICTURES
        print(
            f"picture of {columns}x{rows}: {1e3 * used:.1f} ms, {size / PICTURES / 1e3:.1f} kB; "
            f"at {REDRAW_HZ:g} per second {100 * used * REDRAW_HZ:.1f} % of a core",
            flush=True,
        )


def recording(size: tuple[int, int] | None, seconds: float, rate: float, folder: Path) -> None:
    """`canid record` of a bus with so many frames/s; `size` of the terminal, None: a pipe."""
    name = f"{size[0]}x{size[1]}" if size else "none"
    path = folder / f"{name}.blf"
    sender = start_sender(rate, seconds + 2.0 * START_S)
    reader, writer = pty.openpty() if size else os.pipe()
    if size:
        fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
    read = 0

    def drain() -> None:
        nonlocal read
        try:
            while data := os.read(reader, 65536):
                read += len(data)
        except OSError:
            pass

    threading.Thread(target=drain, daemon=True).start()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = ["-i", BUS["interface"], "-c", BUS["channel"], "-o", str(path), "--duration", str(seconds)]
    process = subprocess.Popen(
        [sys.executable, "-m", "canid", "record", *words],
        stdin=writer if size else subprocess.DEVNULL,
        stdout=writer,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"TERM": "xterm-256color"},
        start_new_session=True,
    )
    process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)  # the sender has not ended yet, and is not counted
    sender.kill()
    sender.wait()
    os.close(writer)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    from canid.io.logs import open_log

    frames = sum(len(chunk.t) for chunk in open_log(path).columns())
    print(
        f"record, view {name}: {100 * used / seconds:.1f} % of a core, {frames / seconds:,.0f} frames/s recorded, "
        f"{read / seconds / 1e3:.1f} kB/s to the terminal, exit code {process.returncode}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks terminal", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=4000.0)
    parser.add_argument("--inside", action="store_true")
    args = parser.parse_args()
    if not args.inside:
        pictures()
        words = ["--inside", "--seconds", str(args.seconds), "--rate", str(args.rate)]
        command = [sys.executable, "-m", "benchmarks.terminal", *words]
        inside = ["unshare", "-n", "bash", "-c", f'{LOOPBACK} "$@"', "bash", *command]
        sys.exit(subprocess.run(inside, check=False).returncode)
    with tempfile.TemporaryDirectory() as folder:
        for k, size in enumerate((None, (80, 24), (200, 60), None)):
            (Path(folder) / str(k)).mkdir()
            recording(size, args.seconds, args.rate, Path(folder) / str(k))


if __name__ == "__main__":
    main()
