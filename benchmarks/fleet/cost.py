"""Cost and scale of `canid fleet`: workers, Dask against local processes, 10,000 logs, a long log among short ones.

    python -m benchmarks fleet_cost [--quick] [--only workers dask scale long] [--keep DIR] [--into docs/evidence/fleet.md]

Ratios are of runs in alternation. From the measured numbers follows what a fleet of 100,000 h takes, and what limits it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.fleet import cost_logs, page, short_logs
from benchmarks.fleet.fleet_runs import Ran, cluster, machine, rows, run
from benchmarks.fleet.large_fleet import Measured, on_paper

# what issue 19 asks for
MIN_SPEEDUP, MAX_OVERHEAD, MAX_CLIENT_BYTES = 1.8, 0.05, 1e9


class Sizes(NamedTuple):
    """How much is run."""

    drives: int  # of 3 min, for workers and Dask
    rounds: int
    short: tuple[int, ...]  # logs of 20 to 30 s
    analysed: int  # of these
    long_min: float  # min, of the long log
    minute_logs: int  # of 1 min, next to it


FULL = Sizes(12, 3, (2_500, 5_000, 10_000), 200, 120.0, 60)
QUICK = Sizes(6, 1, (50, 100, 200), 20, 12.0, 8)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks fleet_cost",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run")
    parser.add_argument("--only", nargs="+", choices=tuple(PARTS), help="parts; default: all")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="keep logs and figures there; logs are not made again"
    )
    parser.add_argument("--nice", type=int, default=0)
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the table of this page")
    args = parser.parse_args(argv)
    sizes = QUICK if args.quick else FULL
    with tempfile.TemporaryDirectory() as temporary:
        home = args.keep or Path(temporary)
        home.mkdir(parents=True, exist_ok=True)
        figures = home / ("figures_quick.json" if args.quick else "figures.json")
        known: dict[str, list[str]] = {}
        measured: dict[str, float] = {}
        if figures.exists():
            stored = json.loads(figures.read_text(encoding="utf-8"))
            known, measured = stored["lines"], stored["measured"]
        for part in args.only or PARTS:
            print(f"{part} ...", file=sys.stderr, flush=True)
            lines, numbers = PARTS[part](sizes, home, args.nice)
            known[part] = [*lines, f"| · machine | {machine()} | |"]
            measured |= numbers
            print("\n".join(known[part]), file=sys.stderr, flush=True)
            figures.write_text(json.dumps({"lines": known, "measured": measured}, indent=1), encoding="utf-8")
    text = "\n".join(
        [
            "| what | measured | asked |",
            "|---|---|---|",
            *itertools.chain.from_iterable(known[part] for part in PARTS if part in known),
        ]
    )
    if measured.keys() >= set(Measured._fields):
        text += "\n\n" + "\n".join(on_paper(Measured(**{name: measured[name] for name in Measured._fields})))
    print(text)
    if args.into is not None:
        page.replace(args.into, "fleet cost", text)
    return 0


def workers(sizes: Sizes, home: Path, nice: int) -> tuple[list[str], dict[str, float]]:
    """Drives per minute on 1 and 2 workers, in alternation."""
    logs = cost_logs.drives(sizes.drives, home / "drives")

    def once(number: int) -> Ran:
        return _fresh([logs.folder, "--vehicle", logs.vehicle, "--workers", str(number)], home, nice)

    runs: dict[int, list[Ran]] = {1: [], 2: []}
    for k in range(sizes.rounds):
        for number in (1, 2) if k % 2 == 0 else (2, 1):
            runs[number].append(once(number))
    folder = home / "results"
    per_min = {n: [60.0 * sizes.drives / one.wall_s for one in each] for n, each in runs.items()}
    ratios = [one.wall_s / two.wall_s for one, two in zip(runs[1], runs[2], strict=True)]
    of = rows(folder, "SELECT sum(cpu_s) c, sum(wall_s) w, sum(duration) d, max(peak_bytes) m FROM {drives}")[
        0
    ]
    stored = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    log_bytes = sum(path.stat().st_size for path in logs.folder.rglob("*.blf"))
    hours = of["d"] / 3600.0
    lines = [
        f"| drives of 3 min per minute, with diagnosis: 1 worker, 2 workers | {_median(per_min[1]):.1f}, "
        f"{_median(per_min[2]):.1f} | |",
        f"| · ratio, of {sizes.rounds} pairs | {_spread(ratios)} | ≥ {MIN_SPEEDUP} |",
        f"| · CPU per drive; per hour driven | {of['c'] / sizes.drives:.1f} s; {of['c'] / hours / 60.0:.1f} min | |",
        f"| · peak memory: client, analysis | {runs[2][-1].client_bytes / 1e6:.0f}, {of['m'] / 1e6:.0f} MB | |",
        f"| · results per hour driven | {stored / hours / 1e6:.1f} MB | |",
    ]
    return lines, {
        "cpu_s_per_hour": of["c"] / hours,
        "result_bytes_per_hour": stored / hours,
        "log_bytes_per_hour": log_bytes / hours,
        "analysis_bytes": of["m"],
    }


def dask(sizes: Sizes, home: Path, nice: int) -> tuple[list[str], dict[str, float]]:
    """Dask distributed with two workers against two local processes, in alternation."""
    # three times as many drives as for the workers: the last ones, for which a core waits, are not the cost of a log
    drives = 3 * sizes.drives
    logs = cost_logs.drives(drives, home / "drives of dask")
    words: list[str | Path] = [logs.folder, "--vehicle", logs.vehicle]
    pairs = {}
    settings: tuple[tuple[str, list[str]], ...] = (
        ("without diagnosis", ["--no-diagnosis"]),
        ("with diagnosis", []),
    )
    for name, more in settings:
        ratios, extra = [], []
        with cluster(2, home) as address:
            # both ways once before anything counts: files are in the cache, the workers have imported
            for way in (["--workers", "2"], ["--scheduler", address]):
                _fresh([*words, *more, *way], home, nice)
            for k in range(sizes.rounds):
                ways = {"local": ["--workers", "2"], "dask": ["--scheduler", address]}
                order = ("local", "dask") if k % 2 == 0 else ("dask", "local")
                walls = {way: _fresh([*words, *more, *ways[way]], home, nice).wall_s for way in order}
                ratios.append(walls["dask"] / walls["local"] - 1.0)
                extra.append((walls["dask"] - walls["local"]) / drives)
        pairs[name] = ratios, extra
    lines = [
        f"| Dask over local processes, {drives} drives of 3 min, {name}: wall time; per log | "
        f"{_spread([100.0 * x for x in ratios])} %; {1000.0 * _median(extra):.0f} ms | ≤ {100 * MAX_OVERHEAD:.0f} % |"
        for name, (ratios, extra) in pairs.items()
    ]
    return lines, {"dask_overhead": _median(pairs["with diagnosis"][0])}


def scale(sizes: Sizes, home: Path, nice: int) -> tuple[list[str], dict[str, float]]:
    """Thousands of short logs: planning and result handling of the client, and a second run that has nothing to do.

    The client's work is what `canid fleet` does, with the outcome of one real analysis for every log; the analysis itself
    is measured on the first of them.
    """
    folder = home / "short"
    folder.mkdir(exist_ok=True)
    vehicle = short_logs.write(sizes.short[-1], folder, seed=7)
    analysed = folder / f"first {sizes.analysed}.txt"
    _listed(analysed, sizes.analysed)
    real = _fresh([f"@{analysed}", "--vehicle", vehicle, "--workers", "2", "--no-diagnosis"], home, nice)
    cpu = rows(home / "results", "SELECT median(cpu_s) c FROM {drives}")[0]["c"]
    lines = [
        f"| {sizes.analysed} logs of 20 to 30 s, without diagnosis, 2 workers: wall; CPU of the analysis of one | "
        f"{real.wall_s:.0f} s; {cpu:.2f} s | |"
    ]
    walls, peaks, again = [], [], []
    for number in sizes.short:
        names = folder / f"first {number}.txt"
        _listed(names, number)
        results = home / "short results"
        shutil.rmtree(results, ignore_errors=True)
        words = [str(results), f"@{names}", str(vehicle), str(folder / "logs" / short_logs.name(0))]
        first, second = _handled(words), _handled(words)
        if (first["analysed"], second["analysed"], second["logs"]) != (number, 0, number):
            raise RuntimeError(f"{number} logs: {first}, then {second}")
        walls.append(first["wall_s"])
        again.append(second["wall_s"])
        peaks.append(max(first["peak_bytes"], second["peak_bytes"]))
        lines.append(
            f"| {number:,} logs, planning and results alone: wall, of it planning; CPU per log; client's peak | "
            f"{first['wall_s']:.1f} s, {first['planning_s']:.2f} s; {1000 * first['cpu_s'] / number:.2f} ms; "
            f"{first['peak_bytes'] / 1e6:.0f} MB | ≤ {MAX_CLIENT_BYTES / 1e6:.0f} MB |"
        )
        lines.append(
            f"| · a second run, which has nothing to do: wall; per log | {second['wall_s']:.1f} s; "
            f"{1000 * second['wall_s'] / number:.2f} ms | |"
        )
    factor = math.log(sizes.short[-1] / sizes.short[0])
    exponents = [math.log(x[-1] / x[0]) / factor for x in (walls, again)]
    lines.append(
        f"| · growth with the number of logs, as an exponent: first run, second run | {exponents[0]:.2f}, "
        f"{exponents[1]:.2f} | ≤ 1: linear |"
    )
    return lines, {
        "client_s_per_log": walls[-1] / sizes.short[-1],
        "plan_s_per_log": again[-1] / sizes.short[-1],
        "client_bytes_per_log": (peaks[-1] - peaks[0]) / (sizes.short[-1] - sizes.short[0]),
        "client_bytes": float(peaks[0]),
    }


def _listed(names: Path, number: int) -> None:
    names.write_text("".join(f"logs/{short_logs.name(k)}\n" for k in range(number)), encoding="utf-8")


def _handled(words: Sequence[str]) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.fleet.result_handling", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    out: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return out


def long(sizes: Sizes, home: Path, nice: int) -> tuple[list[str], dict[str, float]]:
    """One long log among many of one minute."""
    logs = cost_logs.long_and_short(sizes.long_min, sizes.minute_logs, home / "long")
    ran = _fresh([logs.folder, "--vehicle", logs.vehicle, "--workers", "2", "--no-diagnosis"], home, nice)
    of = rows(home / "results", "SELECT duration, wall_s, cpu_s, peak_bytes FROM {drives} ORDER BY duration")
    total, longest = sum(one["wall_s"] for one in of), max(one["wall_s"] for one in of)
    ideal = max(total / 2.0, longest)
    return [
        f"| a log of {sizes.long_min:.0f} min and {sizes.minute_logs} of 1 min, without diagnosis, 2 workers: "
        f"wall; least possible | {ran.wall_s:.0f} s; {ideal:.0f} s | |",
        f"| · peak memory of the analysis: the long log, the largest of the others; client | "
        f"{of[-1]['peak_bytes'] / 1e6:.0f}, {max(one['peak_bytes'] for one in of[:-1]) / 1e6:.0f} MB; "
        f"{ran.client_bytes / 1e6:.0f} MB | bounded |",
        f"| · wall time of the analysis: the long log, the median of the others | {of[-1]['wall_s']:.1f} s, "
        f"{statistics.median(one['wall_s'] for one in of[:-1]):.1f} s | |",
    ], {}


Part = Callable[[Sizes, Path, int], tuple[list[str], dict[str, float]]]
PARTS: dict[str, Part] = {"workers": workers, "dask": dask, "scale": scale, "long": long}


def _fresh(words: Sequence[str | Path], home: Path, nice: int) -> Ran:
    """Run into an empty folder. Raises RuntimeError where the run has not analysed all logs itself."""
    folder = home / "results"
    if folder.exists():
        shutil.rmtree(folder)
    begin = time.time()
    ran = run([*words, "-o", folder], nice=nice)
    of = rows(folder, "SELECT count(*) n, sum(wall_s) w FROM {drives}")[0]
    plan = rows(folder, "SELECT count(*) n FROM {logs}")[0]["n"]
    # two analyses at a time: less wall time than half of theirs is a run that took results from elsewhere
    if of["n"] != plan or of["w"] > 2.2 * ran.wall_s:
        raise RuntimeError(f"{of} of {plan} logs in {ran.wall_s:.1f} s from {begin:.0f} on:\n{ran.output}")
    return ran


def _median(x: Sequence[float]) -> float:
    return float(statistics.median(x))


def _spread(x: Sequence[float]) -> str:
    return f"{_median(x):.2f} [{min(x):.2f}, {max(x):.2f}]"


if __name__ == "__main__":
    sys.exit(main())
