"""CPU time of `canid check` and `canid identify` on five minutes of a radar with 64 tracks, against python-can + cantools.

    python -m benchmarks own_car_speed [--dbc FOLDER] [--car FILE] [--radar NAME]

The log is a car's of `benchmarks.own_car`, some 500,000 frames on two buses, in the form of `candump -L`. The peer reads the
same file and decodes every frame that its DBC files know, and nothing else: no lead, no samples, no estimate.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import can
import cantools

from benchmarks.init.__main__ import DEFAULT, HALVES
from benchmarks.init.__main__ import HERE as TRUTHS
from benchmarks.own_car.__main__ import encode, run


def children_s() -> float:
    """CPU time of all child processes so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def decode(log: str, *files: str) -> int:
    """What the peer does: messages that it decoded."""
    by_bus = [cantools.database.load_file(file, strict=False) for file in files]
    known = [{message.frame_id: message for message in database.messages} for database in by_bus]
    n = 0
    for frame in can.LogReader(log):
        bus = int(str(frame.channel)[-1])
        message = known[bus].get(frame.arbitration_id) if bus < len(known) else None
        if message is not None:
            message.decode(bytes(frame.data), decode_choices=False, allow_truncated=True)
            n += 1
    return n


def main() -> None:
    """Print the CPU time of each, and the ratios."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks own_car_speed", description=__doc__)
    parser.add_argument("--dbc", type=Path, default=DEFAULT, metavar="FOLDER")
    parser.add_argument("--car", default="ford_cgea1_2_ptcan_2011.dbc", metavar="FILE")
    parser.add_argument("--radar", default="Delphi ESR", metavar="NAME")
    parser.add_argument("--peer", nargs="+", metavar="FILE", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.peer:
        print(decode(*args.peer))
        return
    truths = {}
    for half in HALVES.values():
        truths |= tomllib.loads((TRUTHS / half).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        names = encode(args.dbc / args.car, truths[args.car], args.radar, folder, 0)
        run(folder, "init", *names, "--log", "drive.log", "--yes", "-o", "car.toml")
        lines = (folder / "drive.log").read_bytes().count(b"\n")
        print(f"{lines:,} frames of {args.car} and {args.radar}; CPU s")
        taken = {}
        for verb in ("check", "identify"):
            before = children_s()
            code = run(folder, verb, "drive.log", "--vehicle", "car.toml").returncode
            taken[verb] = children_s() - before
            print(f"canid {verb}: {taken[verb]:.1f} (exit code {code})", flush=True)
        before = children_s()
        files = [str(folder / name) for name in ("drive.log", *names)]
        peer = [sys.executable, "-m", "benchmarks.own_car.speed", "--peer", *files]
        decoded = subprocess.run(peer, capture_output=True, text=True, check=True).stdout.strip()
        theirs = children_s() - before
        ratios = ", ".join(f"{verb} {seconds / theirs:.2f}" for verb, seconds in taken.items())
        print(
            f"python-can + cantools, decoding {decoded} of them: {theirs:.1f}; canid's time over it: {ratios}"
        )


if __name__ == "__main__":
    main()
