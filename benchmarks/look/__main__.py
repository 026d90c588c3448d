"""CPU seconds of one pass of `canid look` over a log with its DBC, against the two ways of reading it by hand.

    python -m benchmarks.look [--log LOG --dbc FILE...] [--rounds 3] [--page MINUTES]

python-can: all frames, counted by id. python-can + cantools: all signals of all frames, decoded, nothing kept.
`canid look` also finds rates, changes, counters and checksums, and keeps ranges and courses. Without --log: a simulated
drive of four minutes. With --page alone the page on so many minutes of 2,000 frames/s.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import can
import cantools

from benchmarks.reading import synthetic
from benchmarks.reading.cost import cpu
from canid.analysis.contents import survey
from canid.analysis.contents.binding import DbcFile
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.contents.signal_lines import lines_of_log
from canid.io.logs import open_log, write_log
from canid.models.simulation import START_UTC, frames, simulate
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import read_vehicle
from canid.signals.vehicle.database import load
from canid.ui.views.signal_page.signal_page import SignalPage
from canid.ui.web.signal_server import answers
from canid.values.shipped_files import shipped

# s that a first look may take, start included, on the log of the RAV4: 135,000 frames, 175 ids
WANTED_S = 1.0


def counted(path: Path) -> int:
    """All frames by python-can."""
    with can.LogReader(path) as reader:
        return sum(Counter((m.channel, m.arbitration_id) for m in reader).values())


def decoded(path: Path, dbc: list[Path]) -> int:
    """All signals by python-can and cantools, of the file that knows the id."""
    known = {m.frame_id: m for file in dbc for m in cantools.database.load_file(file, strict=False).messages}
    n = 0
    with can.LogReader(path) as reader:
        for message in reader:
            of = known.get(message.arbitration_id)
            if of is None or len(message.data) != of.length:
                continue
            # two buses may use one id for two messages
            with suppress(cantools.database.DecodeError):
                n += len(of.decode(bytes(message.data), decode_choices=False))
    return n


def surveyed(path: Path, dbc: list[Path]) -> int:
    """The pass of `canid look`, the DBC files read."""
    with Parser() as parser:
        files = [
            DbcFile(file.name, None, tuple(load(file, None, parser)[0].messages.values())) for file in dbc
        ]
    return len(survey(open_log(path), files).signals)


def on_page(path: Path, dbc: list[Path]) -> tuple[float, float]:
    """CPU s until `look --web` can answer, and for its first lines and then three others over the whole log."""
    began = time.process_time()
    with Parser() as parser:
        files = [
            DbcFile(file.name, None, tuple(load(file, None, parser)[0].messages.values())) for file in dbc
        ]
    log = open_log(path)
    lines = lines_of_log(log, files, Wanted())
    answer = answers(SignalPage(path.name, 0.0, 1e9, lines))
    ready = time.process_time()
    shown = json.loads(answer('{"id": 1, "do": "listing"}') or "")["answer"]["shown"]
    others = list(range(min(3, len(lines))))
    for ks in (shown, others):
        answer(json.dumps({"id": 2, "do": "pieces", "lines": ks, "begin": 0.0, "end": 1e9, "points": 2000}))
    return ready - began, time.process_time() - ready


def paged(minutes: int) -> None:
    """Print what the page takes on a logger's drive."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "drive.blf"
        write_log(log, synthetic.frames(60 * minutes), synthetic.START)
        ready, drawn = on_page(log, [synthetic.HERE / "drive.dbc"])
    print(f"{minutes} min of {synthetic.FRAMES_PER_SECOND:,} frames/s, CPU:")
    print(
        f"read, every signal ready {ready:.2f} s; its first lines, then three others over the whole log {drawn:.2f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--log", type=Path)
    parser.add_argument("--dbc", type=Path, nargs="+", default=[shipped() / "generic.dbc"])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--page", type=int, metavar="MINUTES")
    args = parser.parse_args()
    if args.page is not None:
        paged(args.page)
        return
    with tempfile.TemporaryDirectory() as folder:
        log = args.log
        if log is None:
            log = Path(folder) / "drive.blf"
            write_log(log, frames(simulate(4.0, seed=1), read_vehicle("generic")), START_UTC)
        took, signals = cpu(lambda: surveyed(log, args.dbc), args.rounds)
        count, n = cpu(lambda: counted(log), args.rounds)
        decode, values = cpu(lambda: decoded(log, args.dbc), 1)
        command = [sys.executable, "-m", "canid", "look", str(log), "--dbc", *map(str, args.dbc)]
        walls = []
        for _ in range(args.rounds):
            began = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            walls.append(time.perf_counter() - began)
        ready, drawn = on_page(log, args.dbc)
    print(f"{log.name}: {n:,} frames, {signals} signals came\n\n| what | s | × canid look |\n|---|---|---|")
    print(f"| canid look, the pass (CPU) | {took:.2f} | 1 |")
    print(f"| python-can, frames counted (CPU) | {count:.2f} | {count / took:.1f} |")
    print(f"| python-can + cantools, {values:,} values decoded (CPU) | {decode:.2f} | {decode / took:.1f} |")
    print(f"| `look --web`: read, every signal ready (CPU) | {ready:.2f} | {ready / took:.1f} |")
    print(f"| `look --web`: its first lines, then three others (CPU) | {drawn:.2f} | {drawn / took:.1f} |")
    print(f"| the command, from its start (wall) | {min(walls):.2f} | |")


if __name__ == "__main__":
    main()
