"""`canid fleet` on the measured drives: AstaZero, OpenACC, OpenLKA, RAV4; what it says of drivers, groups and causes.

    python -m benchmarks measured_fleet [--data ../shared/data] [--no-diagnosis] [--keep DIR] [--into docs/evidence/fleet.md]

Drives of more than two minutes are cut into up to five pieces, so that there are several drives of each driver. Skipped
where the folder is missing. At the end stands what the data's own description contradicts, if anything.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.fleet import page
from benchmarks.fleet.fleet_runs import machine, rows, run
from canid.analysis.fleet.answers.summary import summarise
from canid.io.logs import open_log, write_log
from canid.values.fleet_summary import FleetSummary
from canid.values.types import Frame, Interval

# s; what is shorter is not cut, and no piece is shorter than half of it
CUT_FROM_S = 120.0
MAX_PIECES, PIECE_S = 5, 100.0
PEOPLE, SHORT, LONG = "people", "ACC short", "ACC long"


class Source(NamedTuple):
    """One log and what its folder's description says of it."""

    log: str
    car: str
    driver: str
    group: str
    vehicle: str


SOURCES = (
    Source("asta/asta_p3_f2_Tesla_Model3.blf", "Tesla Model 3", "asta p3 f2", PEOPLE, "openacc_asta"),
    Source("asta/asta_p3_f4_Audi_A6.blf", "Audi A6", "asta p3 f4", PEOPLE, "openacc_asta"),
    Source("asta/asta_p10_f2_Audi_A6.blf", "Audi A6", "asta p10 f2", PEOPLE, "openacc_asta"),
    Source("asta/asta_p10_f4_Mercedes_AClass.blf", "Mercedes A", "asta p10 f4", PEOPLE, "openacc_asta"),
    *(Source(f"openacc/human_h22_{v}.blf", v, f"openacc {v}", PEOPLE, "openacc") for v in ("v3", "v5", "v6")),
    Source("openacc/acc_short_h2_v4.blf", "v4", "ACC of v4", SHORT, "openacc"),
    Source("openacc/acc_long_h10_v5.blf", "v5", "ACC of v5", LONG, "openacc"),
    Source("rav4/rav4_highway.blf", "RAV4", "rav4", "", "toyota_rav4_2017"),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks measured_fleet",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--no-diagnosis", action="store_true")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep pieces and results there")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the table of this page")
    args = parser.parse_args(argv)
    if not (args.data / SOURCES[0].log).exists():
        print(f"skipped: {args.data} has no measured drives", file=sys.stderr)
        return 0
    with tempfile.TemporaryDirectory() as temporary:
        home = args.keep or Path(temporary)
        map_file = lay_out(args.data, home)
        results = home / "results"
        words: list[str | Path] = [home / "logs", "-o", results, "--vehicles", map_file, "--workers", "2"]
        ran = run([*words, *["--no-diagnosis"] * args.no_diagnosis])
        found = summarise(results)
        text = "\n".join([*table(found, results), "", f"{ran.wall_s:.0f} s; machine: {machine()}."])
    print(text)
    if args.into is not None:
        page.replace(args.into, "measured fleet", text)
    return 0


def lay_out(data: Path, home: Path) -> Path:
    """Write pieces and copies into CAR/DRIVER folders, and the mapping file; returns the latter."""
    lines: list[str] = []
    for source in all_sources(data):
        folder = home / "logs" / source.car / source.driver
        if not folder.exists():
            folder.mkdir(parents=True)
            cut(data / source.log, folder)
        vehicle = data / source.vehicle
        named = vehicle.resolve() if vehicle.suffix == ".toml" else source.vehicle
        lines += ["[[drives]]", f'match = "{source.car}/{source.driver}/*.blf"', f'vehicle = "{named}"']
        lines += [f'group = "{source.group}"'] * bool(source.group) + [""]
    path = home / "map.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def all_sources(data: Path) -> Iterator[Source]:
    """Every log. Nobody knows who drove the cars of OpenLKA: each segment is a driver of its own."""
    yield from (source for source in SOURCES if (data / source.log).exists())
    for path in sorted((data / "openlka").glob("*.blf")):
        car = path.stem.partition("_")[0]
        yield Source(f"openlka/{path.name}", car, path.stem, "", "openlka/openlka.toml")


def cut(log: Path, folder: Path) -> None:
    """Write a log in pieces."""
    opened = open_log(log)
    frames = list(opened)
    last = frames[-1].t
    number = 1 if last < CUT_FROM_S else max(2, min(MAX_PIECES, int(last / PIECE_S)))
    for k in range(number):
        begin, end = k * last / number, (k + 1) * last / number
        piece = [one for one in frames if begin <= one.t < end]
        start = piece[0].t
        write_log(folder / f"{log.stem} {k + 1}.blf", _from_zero(piece), opened.start_utc + start)


def _from_zero(piece: Sequence[Frame]) -> Iterator[Frame]:
    for one in piece:
        yield one._replace(t=round((one.t - piece[0].t) * 1e9) * 1e-9)


def table(found: FleetSummary, folder: Path) -> list[str]:
    """What it says, and what the description contradicts."""
    out = [found.verdict, *found.sentences, ""]
    out += ["| not in a population | drives |", "|---|---|"]
    out += [f"| {one.what}: {one.says} | {one.number} |" for one in (*found.failures, *found.excluded)]
    for population in found.populations:
        if not any(one.drives for one in population.parameters):
            continue
        out += ["", f"{population.kind.text()}", ""]
        out += ["| parameter | drivers / drives | mean | between drivers | within |", "|---|---|---|---|---|"]
        out += [
            f"| {one.name} | {one.drivers} / {one.drives} | {_text(one.mean)} {one.unit} | {_text(one.between)} | "
            f"{_text(one.within)} |"
            for one in population.parameters
            if one.drives
        ]
        out += [
            "",
            "| driver | drives | K of range rate: shrunken; own | wanted headway |",
            "|---|---|---|---|",
        ]
        for driver in population.drivers:
            shrunken, own = (of.get("range_rate.K", Interval()) for of in (driver.shrunken, driver.own))
            wanted = driver.shrunken.get("log_wanted_headway", Interval())
            out.append(
                f"| {driver.name} | {driver.drives} | {_text(shrunken)}; {_text(own)} | {_text(wanted)} |"
            )
        for asked in population.questions:
            out += ["", f"{asked.question} {asked.found} of {asked.asked}. {asked.says}"]
            out += [
                f"- {test.subject}: {test.parameter} {_text(test.effect)} {test.unit}, q {test.q:.3g}: {test.says}"
                for test in asked.tests
                if test.found
            ]
    out += ["", "| cause | in | drives | q |", "|---|---|---|---|"]
    out += [
        f"| {one.effect} | {one.car} | {one.drives} of {one.diagnosed} | {one.q:.2g} |"
        for one in found.causes
    ]
    wrong = contradictions(found, folder)
    return [*out, "", "Contradicted by the data's description: " + ("; ".join(wrong) or "nothing") + "."]


def contradictions(found: FleetSummary, folder: Path) -> list[str]:
    """What is claimed that the data's description says is not so."""
    out = []
    pooled = {driver.name for population in found.populations for driver in population.drivers}
    # gap and range rate of the GM cars contradict each other: 28 m of growth at a median of -2.4 m/s
    worst = "silverado_2024-03-12-19-11-16_1-0"
    if worst in pooled:
        out.append(f"{worst} is part of a population, though its gap and range rate contradict each other")
    if "rav4" in pooled:
        out.append("rav4 is part of a population: a person drives for 8.7 s, then cruise control")
    query = "SELECT l.log, d.headway_error_K k, d.range_rate_K k2 FROM {logs} l JOIN {drives} d USING (key)"
    out += [
        f"{Path(row['log']).name} has a gain that may be quoted"
        for row in rows(folder, query)
        if ("rav4" in row["log"] or worst in row["log"]) and (row["k"] is not None or row["k2"] is not None)
    ]
    return out


def _text(of: Interval) -> str:
    if of.value != of.value:
        return "–"
    return f"{of.value:.3g} [{of.low:.3g}, {of.high:.3g}]"


if __name__ == "__main__":
    sys.exit(main())
