"""`canid fleet causes DIR`: drives of each driver, and of each car, diagnosed together: what each is too short to show."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.ui.cli.options import options
from canid.ui.terminal.messages import info, print_line
from canid.ui.terminal.progress import Progress
from canid.values import bounded_numbers
from canid.values.errors import DAMAGED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.analysis.fleet.job import Source

DEFAULT_TIMEOUT_S = 4 * 3600.0
# in one line
MAX_NAMES = 5


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.analysis.fleet.answers.joint_diagnosis import MAX_S

    parser.add_argument("folder", metavar="DIR", help="folder of canid fleet")
    parser.add_argument(
        "--together",
        type=bounded_numbers.span,
        default=MAX_S,
        metavar="TIME",
        help="usable driving of one driver that is diagnosed together; default: 1h; its cost grows with it",
    )
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        help="vehicle file or column map, where it is no longer where the run of canid fleet had it",
    )
    parser.add_argument("--vehicles", metavar="MAP.toml", help="mapping file, likewise")
    options.jobs_of_a_fleet(parser, "one driver", (DEFAULT_TIMEOUT_S, "4h"))


def run(args: argparse.Namespace) -> int:
    """Diagnose what is new, and write the table."""
    from canid.analysis.fleet.storage import mirror

    with mirror.working(args.folder) as at:
        return _diagnosed(args, at.folder)


def _diagnosed(args: argparse.Namespace, folder: Path) -> int:
    from canid.analysis.fleet.answers import joint_diagnosis
    from canid.analysis.fleet.job import Settings, Status
    from canid.analysis.fleet.storage import lock, summary_tables
    from canid.analysis.fleet.storage.database import opened, rows
    from canid.ui.cli.commands.fleet import runner

    settings = Settings(timeout_s=args.timeout, memory_bytes=args.memory)
    with opened(folder) as db:
        planned = joint_diagnosis.jobs(db, settings, args.together)
        known = rows(db, "SELECT * FROM joint_findings")
    if not planned:
        info(
            "no driver or car has two drives with a minute of usable driving behind a lead: nothing to diagnose together"
        )
        return DONE
    wanted = {job.log: (job, columns) for job, columns in planned}
    cause_rows = [row for row in known if row["key"] in wanted]
    new = {
        key: planned_job
        for key, planned_job in wanted.items()
        if key not in {row["key"] for row in cause_rows}
    }
    failed = 0
    with lock.held(folder):
        if new:
            sources = _sources(args, folder, {job.source for job, _ in new.values()})
            with Progress(f"{len(new):,} drivers and cars") as bar:
                bar.count(0, len(new), "")
                done = 0
                try:
                    for outcome in runner(args, sources)(job for job, _ in new.values()):
                        done += 1
                        job, columns = new[outcome.log]
                        if outcome.status is Status.FAILED:
                            failed += 1
                            info(
                                f"{columns['driver'] or columns['car']}: {outcome.failure.value}: {outcome.reason}"
                            )
                        common = {**columns, "logs": len(job.together)}
                        cause_rows += [
                            {**common, **_known(row)} for row in outcome.tables.get("joint_findings", ())
                        ]
                        bar.count(done, len(new), f"{failed:,} failed" if failed else "")
                finally:  # also where it is interrupted: what is finished stays
                    summary_tables.written(folder, {"joint_findings": cause_rows})
        else:
            summary_tables.written(folder, {"joint_findings": cause_rows})
    for line in _lines(cause_rows, len(planned), len(new)):
        print_line(line)
    return DAMAGED if failed else DONE


def _known(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


def _lines(cause_rows: list[dict[str, Any]], planned: int, new: int) -> list[str]:
    drivers: dict[tuple[str, str], int] = {}
    cars: list[tuple[str, str, str]] = []
    for row in cause_rows:
        if not row.get("effect") or row.get("surrogate"):
            continue
        car_effect = (row.get("car") or "", row["effect"])
        if row.get("subject") == "car":
            cars.append((*car_effect, f"{row['logs']} drives of all drivers"))
        else:
            drivers[car_effect] = drivers.get(car_effect, 0) + 1
    named = cars + [
        (*car_effect, f"{n:,} driver{'' if n == 1 else 's'}") for car_effect, n in drivers.items()
    ]
    lines = [f"{planned:,} drivers and cars with several drives; {new:,} diagnosed now"]
    lines += [f"  {effect} in {car}: {by}" for car, effect, by in sorted(named)] or ["  no cause is named"]
    return [*lines, *_unexplained(cause_rows)]


def _unexplained(cause_rows: list[dict[str, Any]]) -> list[str]:
    """Of whom the cause that explains most leaves a remainder, so that it is not named."""
    from canid.values.findings import Verdict

    left: dict[str, list[str]] = {}
    for row in cause_rows:
        if row.get("verdict") == Verdict.UNEXPLAINED.value:
            effects = left.setdefault(row.get("driver") or row.get("car") or "", [])
            effects += [row["effect"]] if row.get("effect") else []
    each = [
        f"{who} (nearest: {', '.join(effects)})" if effects else who for who, effects in sorted(left.items())
    ]
    more = f" and {len(each) - MAX_NAMES:,} more" if len(each) > MAX_NAMES else ""
    return [f"  unexplained: {', '.join(each[:MAX_NAMES])}{more}"] if each else []


def _sources(args: argparse.Namespace, folder: Path, wanted: set[str]) -> Mapping[str, Source]:
    """How the logs are decoded: by the files of the run that made the folder, or those that are named now."""
    from canid.analysis.fleet.planning.listing import MARK
    from canid.analysis.fleet.planning.sources import HEADINGS, read_source
    from canid.analysis.fleet.planning.vehicle_map import read_map

    vehicle, mapping = args.vehicle, args.vehicles
    if vehicle is None and mapping is None:
        vehicle, mapping = _of_the_run(folder / MARK)
    out = dict(read_map(mapping).sources) if mapping else {}
    if vehicle:
        source = read_source(vehicle)
        out[source.fingerprint] = source
    out[HEADINGS.fingerprint] = HEADINGS
    if not wanted <= set(out):
        raise ConfigError(
            "fleet causes: the vehicle files are not those of the folder's results: name them with --vehicle or --vehicles, "
            "or run canid fleet again"
        )
    return out


def _of_the_run(mark: Path) -> tuple[str | None, str | None]:
    """--vehicle and --vehicles of the command that fleet.json notes."""
    import json
    import shlex

    from canid.ui.cli import Parser
    from canid.ui.cli.commands import fleet

    try:
        words = shlex.split(json.loads(mark.read_text("utf-8"))["command"])
        parser = Parser(prog="canid fleet")
        fleet.arguments(parser)
        run = parser.parse_args(words[2:])
    except (OSError, ValueError, KeyError, TypeError, ConfigError):
        raise ConfigError("fleet causes: name the vehicle file with --vehicle, or --vehicles") from None
    for name in (run.vehicle, run.vehicles):
        if name and ("/" in name or name.endswith(".toml")) and not os.path.exists(name):
            raise ConfigError(
                f"fleet causes: {name} of the run is not here: run it in that run's folder, or name it with --vehicle"
            )
    return run.vehicle, run.vehicles
