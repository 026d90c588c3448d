"""CPU seconds of one pass of `canid look` over a log with its DBC, against the two ways of reading it by hand.

    python -m benchmarks.look [--log LOG --dbc FILE...] [--rounds 3]

python-can: all frames, counted by id. python-can + cantools: all signals of all frames, decoded, nothing kept.
`canid look` also finds rates, changes, counters and checksums, and keeps ranges and courses. Without --log: a simulated
drive of four minutes.
"""

from __future__ import annotations

import argparse
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

from benchmarks.reading.cost import cpu
from canid.contents import survey
from canid.contents.binding import DbcFile
from canid.logs import open_log, write_log
from canid.parsing import Parser
from canid.simulation import START_UTC, frames, simulate
from canid.vehicle import read_vehicle
from canid.vehicle.database import load
from canid.vehicle.vehicle_file import shipped

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--log", type=Path)
    parser.add_argument("--dbc", type=Path, nargs="+", default=[shipped() / "generic.dbc"])
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
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
    print(f"{log.name}: {n:,} frames, {signals} signals came\n\n| what | s | × canid look |\n|---|---|---|")
    print(f"| canid look, the pass (CPU) | {took:.2f} | 1 |")
    print(f"| python-can, frames counted (CPU) | {count:.2f} | {count / took:.1f} |")
    print(f"| python-can + cantools, {values:,} values decoded (CPU) | {decode:.2f} | {decode / took:.1f} |")
    print(f"| the command, from its start (wall) | {min(walls):.2f} | |")


if __name__ == "__main__":
    main()
