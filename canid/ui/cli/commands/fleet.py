"""`canid fleet LOGS... -o DIR`: identify and diagnose many logs, on all cores or on Dask, into tables of one folder."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.io.logs import formats
from canid.ui.cli.command_line import reproducing
from canid.ui.cli.options import options, report_option
from canid.ui.cli.output import complete_files, outputs
from canid.ui.terminal.messages import info, line_printer
from canid.ui.terminal.progress import Progress, is_terminal
from canid.values.errors import DAMAGED, DONE, ConfigError, OutputError

if TYPE_CHECKING:
    from canid.analysis.fleet.job import Job, Outcome, Settings, Source
    from canid.analysis.fleet.running.run import Counts, Run

# that change the results
OPTIONS = (
    *("-o", "--vehicle", "--vehicles", "--folders", "--workers", "--scheduler", "--timeout", "--memory"),
    *("--no-diagnosis", "--no-windows", "--no-traffic"),
)
# names of drivers in the summary; the rest is counted
MAX_DRIVERS = 10
MAX_FAILURES = 5
# s after which a run without a terminal says how far it is, and then how often
FIRST_LINE_S, LINE_S = 60.0, 600.0
TABLE = "tables with named columns"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.analysis.fleet.job import Settings

    parser.epilog = "canid fleet query|report|prior|causes|export --help: what is made of the results in DIR"
    parser.add_argument(
        "logs",
        metavar="LOG",
        nargs="+",
        help="log, folder with all below it, quoted pattern such as 'logs/**/*.blf', @list.txt with a path a line, or "
        f"URL such as s3://bucket/logs: {formats.described()}, or {TABLE}",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="folder of the results (needed), or its URL such as s3://bucket/results; an earlier run is continued",
    )
    parser.add_argument(
        "--vehicle",
        metavar="V.toml",
        help="vehicle file (TOML) or column map of all logs, or of those that MAP.toml gives none",
    )
    parser.add_argument(
        "--vehicles", metavar="MAP.toml", help="which driver, car and vehicle file each log has: [[drives]]"
    )
    parser.add_argument(
        "--folders",
        metavar="PATTERN",
        help="what the names of folders are, such as '{car}/{driver}' or '{group}/*/{driver}'; "
        "default: {driver}, or {car}/{driver} where there are two",
    )
    options.jobs_of_a_fleet(parser, "one log", (Settings().timeout_s, "1h"))
    parser.add_argument(
        "--no-diagnosis", action="store_true", help="no diagnosis, which takes most of the time"
    )
    parser.add_argument(
        "--no-windows", action="store_true", help="whole drives alone, without sliding windows"
    )
    parser.add_argument("--no-traffic", action="store_true", help="no models for traffic simulators")
    parser.add_argument(
        "--retry-failed",
        action="store_true",
        help="try all logs again that failed, not only those that took too long or could not be read",
    )
    options.time_zone(parser)
    options.json_file(parser)
    report_option.add(parser, "write a page on the fleet, as canid fleet report does", default="fleet.html")


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"fleet": FleetRun}


def run(args: argparse.Namespace) -> int:
    """Plan, analyse, store."""
    from canid.analysis.fleet.planning.listing import is_url
    from canid.analysis.fleet.planning.plan import planned
    from canid.analysis.fleet.running import run as fleet_run
    from canid.analysis.fleet.storage import mirror
    from canid.analysis.fleet.storage import store as fleet_store
    from canid.analysis.fleet.storage.lock import LockError
    from canid.values.text import json_values

    _know_the_words(args.logs)
    if args.output is None:
        raise ConfigError("fleet: -o DIR is missing: the folder of the results")
    is_url(args.output)  # before anything is listed: an address that is not opened is refused
    json = options.json_output(args)
    page = report_option.output(args, "fleet")
    read = [path for path in (args.vehicle, args.vehicles) if path]
    outputs.check([json, page], read)
    plan = planned(
        args.logs, vehicle=args.vehicle, vehicles=args.vehicles, folders=args.folders, skip=[args.output]
    )
    for note in plan.notes:
        info(note)
    settings = _settings(args)
    with (
        mirror.working(args.output) as at,
        fleet_store.opened(at.folder, lambda: _uploaded(at.push)) as store,
    ):
        for note in store.notes:
            info(note)
        # at once: what is made of the results of an interrupted run needs to know its vehicle files
        store.note(command=command(_anywhere(args)), settings=settings._asdict())
        said: list[str] = []

        def noted(line: str) -> None:
            said.append(line)
            info(line)

        with Progress(f"{len(plan.logs):,} logs") as bar:
            shown = _shown(bar)
            try:
                done = fleet_run.run(
                    plan,
                    store,
                    settings,
                    runner(args, plan.sources, noted),
                    retry_failed=args.retry_failed,
                    progress=shown,
                    hashing=bar.to,
                    inform=noted,
                )
            except KeyboardInterrupt:
                info(f"what was finished is in {args.output}; the same command goes on")
                raise
            except LockError:
                raise
            except OutputError as error:
                raise OutputError(f"{error}; make room, and the same command goes on") from None
        counted = fleet_run.counts(done.logs)
        store.note(
            command=command(_anywhere(args)), settings=settings._asdict(), logs=counted._asdict(), said=said
        )
        if page is None:  # the page pools them as well
            _pooled(at.folder, counted)
    show = line_printer(args.json)
    for line in summary(counted, done.analysed, args.output):
        show(line)
    if said:
        show(
            f"{_some(len(said), 'note')} on the storage or the cluster: above, and in {args.output}/fleet.json (said)"
        )
    complete_files.write(json, lambda: json_values.document("fleet", document(args, done, counted)) + "\n")
    code = DAMAGED if counted.failed or counted.damaged else DONE
    return code if page is None else _report(args, page.path) or code


def _uploaded(push: Callable[[], None]) -> None:
    """Upload what is new; where the storage does not take it, the next part, or the end of the run, tries again."""
    from canid.analysis.fleet.storage.lock import LockError

    try:
        push()
    except LockError:
        raise
    except OutputError as error:
        info(f"{error}; the run goes on")


def _pooled(folder: Path, counted: Counts) -> None:
    """Write the tables of drivers and of the population, unless they are those of these drives."""
    from canid.analysis.fleet.answers.summary import current, summarise

    if counted.drivers and not current(folder):
        with Progress("pooling the drives"):
            summarise(folder)


def _know_the_words(words: Sequence[str]) -> None:
    """Refuse a first word that is a sub-verb with a slip."""
    first = words[0]
    if os.path.lexists(first) or not first.isalpha():
        return
    from canid.ui.cli.verbs import VERBS

    near = get_close_matches(first, next(verb.parts for verb in VERBS if verb.name == "fleet"), n=1)
    if near:
        raise ConfigError(f'fleet: "{first}" is no file or folder; did you mean "canid fleet {near[0]}"?')


def _settings(args: argparse.Namespace) -> Settings:
    from canid.analysis.fleet.job import Settings

    return Settings(
        windows=not args.no_windows,
        diagnosis=not args.no_diagnosis,
        traffic=not args.no_traffic,
        timeout_s=args.timeout,
        memory_bytes=args.memory,
    )


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def runner(
    args: argparse.Namespace, sources: Mapping[str, Source], inform: Callable[[str], None] = info
) -> Callable[[Iterable[Job]], Generator[Outcome]]:
    """Who analyses: processes of this machine, or Dask."""
    if args.scheduler is not None:
        from canid.analysis.fleet.running import dask_cluster

        if line := dask_cluster.exposure(args.scheduler):
            inform(line)

    def analysed(jobs: Iterable[Job]) -> Generator[Outcome]:
        if args.scheduler is not None:
            from canid.analysis.fleet.running import dask_run

            yield from dask_run.outcomes(jobs, sources, scheduler=args.scheduler, inform=inform)
        else:
            from canid.analysis.fleet.running import local_run

            yield from local_run.outcomes(jobs, sources, args.workers or cores())

    return analysed


def _shown(bar: Progress, now_s: Callable[[], float] = time.monotonic) -> Callable[[Any], None]:
    """Show how far a run is: in the bar, and where there is none as a line after a minute and then every ten.

    Example:
        >>> from contextlib import redirect_stderr
        >>> from canid.analysis.fleet.running.run import Progress as Now
        >>> seconds = iter((0.0, 90.0))
        >>> with Progress("logs") as bar:
        ...     shown = _shown(bar, lambda: next(seconds))
        ...     with redirect_stderr(sys.stdout):
        ...         shown(Now(10, 1000, 1, 0.02))
        canid: 10 of 1,000 logs, 1 failed, 1.2 h left
    """
    begun = now_s()
    due = [begun + FIRST_LINE_S]

    def shown(now: Any) -> None:
        at = now_s()
        failed = f"{now.failed:,} failed" if now.failed else ""
        left = f"{_time_left((at - begun) * (1.0 / now.share - 1.0))} left" if now.share > 0.0 else ""
        remark = ", ".join(filter(None, (failed, left)))
        bar.count(now.done, now.total, remark)
        if at >= due[0] and not is_terminal(sys.stderr):
            due[0] = at + LINE_S
            info(", ".join(filter(None, (f"{now.done:,} of {now.total:,} logs", remark))))

    return shown


def _time_left(seconds: float) -> str:
    """A time as a person says it.

    >>> _time_left(50.0), _time_left(600.0), _time_left(9000.0), _time_left(500000.0)
    ('50 s', '10 min', '2.5 h', '5.8 days')
    """
    if seconds >= 172_800.0:
        return f"{seconds / 86_400.0:.1f} days"
    if seconds >= 3_600.0:
        return f"{seconds / 3_600.0:.1f} h"
    if seconds >= 90.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds:.0f} s"


def summary(counted: Counts, analysed: int, folder: str) -> list[str]:
    """What came of the logs, and what can be made of it.

    Example:
        >>> from canid.analysis.fleet.running.run import counts
        >>> rows = [{"status": "ok", "driver": "anna"}, {"status": "failed", "failure": "empty"}]
        >>> for line in summary(counts(rows), 2, "out"):
        ...     print(line)
        2 logs: 1 ok, 1 failed (1 empty); 2 analysed now
        1 driver: anna 1
        out/drives.parquet has a row for each log; logs.parquet says why logs failed
        next: canid fleet report out, canid fleet query out drivers, canid fleet prior out
    """
    parts = [f"{counted.ok:,} ok"] if counted.ok else []
    parts += [f"{counted.damaged:,} damaged"] if counted.damaged else []
    if counted.failed:
        reasons = [f"{times:,} {name}" for name, times in counted.failures.items()]
        more = [f"{len(reasons) - MAX_FAILURES:,} more reasons"] if len(reasons) > MAX_FAILURES else []
        parts.append(f"{counted.failed:,} failed ({', '.join(reasons[:MAX_FAILURES] + more)})")
    copies = f", {counted.duplicates:,} of them copies of others" if counted.duplicates else ""
    lines = [f"{_some(counted.logs, 'log')}: {', '.join(parts)}{copies}; {analysed:,} analysed now"]
    if counted.drivers:
        ordered = sorted(counted.drivers.items(), key=lambda item: (-item[1], item[0]))
        names = [f"{driver or '(no name)'} {drives:,}" for driver, drives in ordered[:MAX_DRIVERS]]
        more = [f"{len(ordered) - MAX_DRIVERS:,} more"] if len(ordered) > MAX_DRIVERS else []
        lines.append(f"{_some(len(ordered), 'driver')}: {', '.join(names + more)}")
    at = shlex.quote(folder)
    lines.append(f"{folder}/drives.parquet has a row for each log; logs.parquet says why logs failed")
    if counted.drivers:
        lines.append(f"next: canid fleet report {at}, canid fleet query {at} drivers, canid fleet prior {at}")
    return lines


def _some(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


class LogCounts(NamedTuple):
    """How many logs came to what."""

    planned: int
    ok: int
    damaged: int
    failed: int
    duplicates: int
    analysed: int  # in this run


class DrivesOfDriver(NamedTuple):
    """Drives of one driver."""

    driver: str
    drives: int


class NotOk(NamedTuple):
    """A damaged or failed log."""

    log: str | None
    status: str | None
    failure: str | None
    reason: str | None


class FleetRun(NamedTuple):
    """The object of --json."""

    folder: str
    command: str
    logs: LogCounts
    failures: Mapping[str, int]
    drivers: tuple[DrivesOfDriver, ...]
    not_ok: tuple[NotOk, ...]


def document(args: argparse.Namespace, done: Run, counted: Counts) -> FleetRun:
    """What --json writes."""
    from canid.analysis.fleet.planning.listing import is_url

    return FleetRun(
        args.output if is_url(args.output) else os.path.abspath(args.output),
        command(args),
        LogCounts(
            counted.logs, counted.ok, counted.damaged, counted.failed, counted.duplicates, done.analysed
        ),
        counted.failures,
        tuple(DrivesOfDriver(*pair) for pair in sorted(counted.drivers.items())),
        tuple(NotOk(*map(row.get, NotOk._fields)) for row in done.logs if row.get("status") != "ok"),
    )


def command(args: argparse.Namespace) -> str:
    """The command that gives the same results.

    Example:
        >>> command(argparse.Namespace(logs=["a b"], output="out", vehicle="generic", timeout=3600.0, memory=10**9,
        ...     no_diagnosis=True))
        "canid fleet 'a b' -o out --vehicle generic --timeout 3600s --memory 1000000000 --no-diagnosis"
    """
    with_unit = argparse.Namespace(**{**vars(args), "timeout": f"{args.timeout:g}s"})
    return reproducing(with_unit, "fleet", *args.logs, options=OPTIONS)


def _anywhere(args: argparse.Namespace) -> argparse.Namespace:
    """The same with absolute paths: the folder is read from other folders than that of the run."""

    def full(word: str | None) -> str | None:
        return os.path.abspath(word) if word is not None and os.path.exists(word) else word

    of_files = {name: full(getattr(args, name)) for name in ("vehicle", "vehicles", "output")}
    return argparse.Namespace(**{**vars(args), **of_files, "logs": [full(word) for word in args.logs]})


def _report(args: argparse.Namespace, page: str) -> int:
    """The page of `canid fleet report`, by this name."""
    from canid.ui.cli import Parser

    module = import_module("canid.ui.cli.commands.fleet_report")
    parser = Parser(prog="canid fleet report")
    module.arguments(parser)
    # where JSON has standard output, the answer of the page goes where all other text goes
    with redirect_stdout(sys.stderr if args.json == "-" else sys.stdout):
        return int(module.run(parser.parse_args([args.output, "-o", page])))
