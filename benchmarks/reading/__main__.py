"""Frames per CPU-second of reading and decoding logs, against other readers of the same file.

    python -m benchmarks.reading [--frames 1000000] [--rounds 5] [--data ../shared/data] [--mf4 100000]
    python -m benchmarks.reading --identify [--minutes 60] [--rounds 5]
    python -m benchmarks.reading --memory [--memory-frames 10000000]

The first form takes some three minutes; peers that are not installed are left out (`pip install canid[bench]`).
--identify: CPU and memory of `canid identify` on a drive of an hour with 2,000 frames/s, the best of some processes;
then its stages one by one, reading first.
--memory: the largest memory of a process that reads all columns of a log, and of `canid identify` on it.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from itertools import islice
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
if importlib.util.find_spec("asammdf"):
    import asammdf  # noqa: F401  (before python-can, which otherwise is loaded without it)

import canid
from benchmarks.reading import drives, peers, synthetic
from benchmarks.reading.cost import child, cpu
from canid.io.logs import open_log
from canid.signals.vehicle import Vehicle, read_vehicle

# what is asked for: times python-can + cantools, and times inflating alone by Python's zlib
WANTED = {".blf": 15.0, ".asc": 20.0}
OVER_INFLATE = 1.3


def row(name: str, frames: int, seconds: float, base: float | None, note: str = "") -> None:
    rate = frames / seconds
    times = "" if base is None else f"{rate / base:.2f}"
    print(f"| {name} | {rate:,.0f} | {times} | {note} |", flush=True)


def table(path: Path, vehicle: Vehicle, wanted: peers.Wanted, rounds: int) -> float:
    """One file's table; returns the frames per CPU-second of python-can with cantools."""
    print(f"\n{path.name}, {path.stat().st_size / 1e6:.1f} MB\n")
    print("| what | frames per CPU-s | × python-can + cantools | |\n|---|---|---|---|")
    seconds, (frames, decoded) = cpu(peers.python_can_and_cantools(path, wanted), min(rounds, 3))
    base = frames / seconds
    row("python-can + cantools", frames, seconds, None, f"{decoded:,} frames decoded")
    seconds, _ = cpu(peers.python_can_and_cantools(path, {}), min(rounds, 3))
    row("python-can alone", frames, seconds, base)
    columns, n = cpu(lambda: sum(len(chunk.t) for chunk in open_log(path).columns()), rounds)
    assert n == frames
    row("canid, columns", frames, columns, base)
    signals, found = cpu(lambda: canid.read_signals(path, vehicle), rounds)
    values = sum(len(signal.value) for signal in found.values())
    asked = "" if "dec" in path.name else f"asked: {WANTED[path.suffix]:g}"
    row("**canid, columns and signals**", frames, signals, base, f"{values:,} values; {asked}")
    seconds, n = cpu(lambda: sum(1 for _ in open_log(path)), min(rounds, 3))
    row("canid, frame by frame", n, seconds, base)
    if path.suffix == ".blf":
        for by, asked in (("zlib", f"; asked: {OVER_INFLATE}"), ("libdeflate", ", which inflates for canid")):
            seconds, _ = cpu(peers.inflate_alone(path, by), rounds)
            times = f"canid's columns take {columns / seconds:.2f} × as long, with signals {signals / seconds:.2f} ×"
            row(f"{by} inflate alone", frames, seconds, base, times + asked)
    return base


def optional(name: str, frames: int, base: float, make: Callable[[], Callable[[], int]], note: str) -> None:
    try:
        seconds, n = cpu(make(), 2)
    except ImportError:
        print(f"| {name} | not installed | | |")
        return
    row(name, frames, seconds, base, f"{note}; {n:,} values")


def reading(args: argparse.Namespace, folder: Path) -> None:
    seconds = max(args.frames // synthetic.FRAMES_PER_SECOND, 1)
    dbc = synthetic.HERE / "drive.dbc"
    wanted = peers.cantools_messages([(dbc, None)], {"ENGINE", "MOTION", "RADAR", "POSITION"})
    base = 1.0
    for name, write in (
        ("synthetic.blf", synthetic.write),
        ("synthetic.asc", synthetic.write),
        ("synthetic, base dec.asc", synthetic.write_decimal),
    ):
        write(folder / name, synthetic.frames(seconds))
        rate = table(folder / name, synthetic.vehicle(), wanted, args.rounds)
        base = rate if name.endswith(".blf") else base
    few = min(args.mf4, seconds * synthetic.FRAMES_PER_SECOND)
    if few:
        frames = list(islice(synthetic.frames(seconds), few))
        print(f"\nOthers, on {few:,} of these frames; × is that of the .blf\n")
        print("| what | frames per CPU-s | × python-can + cantools | |\n|---|---|---|---|")
        mf4 = folder / "synthetic.mf4"
        if importlib.util.find_spec("asammdf"):
            synthetic.write(mf4, iter(frames))
        optional(
            "asammdf, .mf4", few, base, lambda: peers.asammdf(mf4, dbc), "the signals of the four messages"
        )
        decode = "decoding alone, from a pandas table that is there already"
        optional("can_decoder", few, base, lambda: peers.can_decoder(frames, dbc), decode)
    rav4 = args.data / "rav4"
    if not rav4.exists():
        print(f"\nno {rav4}: the measured log is left out")
        return
    vehicle = read_vehicle("toyota_rav4_2017")
    names = {message.name for message in vehicle.messages}
    wanted = peers.cantools_messages([(rav4 / "toyota_pt.dbc", 0), (rav4 / "toyota_radar.dbc", 1)], names)
    table(rav4 / "rav4_highway.blf", vehicle, wanted, args.rounds)


def identifying(args: argparse.Namespace, folder: Path) -> None:
    drive, busy = folder / "drive.blf", folder / "busy.blf"
    child("canid", "simulate", drive, "--vehicle", "generic", "--minutes", f"{args.minutes:g}", "--seed", "3")
    frames = drives.busy(busy, drive)
    every = [child("canid", "identify", busy, "--vehicle", "generic") for _ in range(args.rounds)]
    print(
        f"canid identify, {frames:,} frames in {args.minutes:g} min: "
        f"{min(used.cpu for used in every):.1f} s of CPU, {max(used.peak for used in every):.0f} MB"
    )
    # stage by stage: without the agreement of the estimators, and without text
    print(child("benchmarks.reading.stages", busy, "generic").out, end="")


def remembering(args: argparse.Namespace, folder: Path) -> None:
    path = folder / "long.blf"
    synthetic.write(path, synthetic.frames(args.memory_frames // synthetic.FRAMES_PER_SECOND))
    used = child("benchmarks.reading.walk", path)
    print(
        f"columns of {path.stat().st_size / 1e6:.0f} MB, {used.out.strip()}: {used.cpu:.1f} s, {used.peak:.0f} MB"
    )
    used = child("canid", "identify", path, "--vehicle", synthetic.HERE / "drive.toml")
    print(f"canid identify on it: {used.cpu:.1f} s of CPU, {used.peak:.0f} MB")


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="benchmarks/reading", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5, help="the best of so many counts")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), metavar="FOLDER")
    parser.add_argument("--mf4", type=int, default=100_000, metavar="N", help="frames for the peers; 0: none")
    parser.add_argument("--identify", action="store_true")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--memory-frames", type=int, default=10_000_000, metavar="N")
    args = parser.parse_args()
    # asammdf and can_decoder warn about their own future
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        if args.identify:
            identifying(args, Path(folder))
        if args.memory:
            remembering(args, Path(folder))
        if not (args.identify or args.memory):
            reading(args, Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
