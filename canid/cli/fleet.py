"""`canid fleet LOGS... -o DIR`: identify and diagnose many logs, on all cores or on Dask, into tables of one folder."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any

from canid.cli import options, report_option
from canid.cli.output import outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.progress import Progress
from canid.errors import DAMAGED, DONE, ConfigError, OutputError
from canid.logs import formats

if TYPE_CHECKING:
    from canid.fleet.job import Job, Outcome, Settings, Source
    from canid.fleet.run import Counts, Run

# the first word after `canid fleet`; the module canid.cli.fleet_<word> has `arguments(parser)` and `run(args)`
SUB_VERBS = {
    "causes": "diagnose the drives of each driver, and of each car, together",
    "query": "ask the tables of a fleet in SQL, or one of the ready questions",
    "report": "write one page on a fleet: drivers side by side, causes, worst data, what to drive next",
    "prior": "write what a fleet teaches on a new driver as [fopdt.prior]",
    "export": "write the drivers of a fleet as vehicle types of a traffic simulator",
}
# names of drivers in the summary; the rest is counted
MAX_DRIVERS = 10
MAX_FAILURES = 5
TABLE = "tables with named columns"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.fleet.job import Settings

    default = Settings()
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
        help="folder of the results (needed); an earlier run is continued",
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
    parser.add_argument("--workers", type=count, metavar="N", help="processes; default: one per core")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on Dask, on this scheduler: tcp://host:8786"
    )
    parser.add_argument(
        "--timeout",
        type=options.span,
        default=default.timeout_s,
        metavar="TIME",
        help="time that one log may take: 10min, 2h; default: 1h",
    )
    parser.add_argument(
        "--memory",
        type=options.size,
        default=default.memory_bytes,
        metavar="SIZE",
        help="memory that one log may take: 500M, 8G; default: 4G",
    )
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
    options.json_file(parser)
    parser.add_argument(
        "--report", metavar="FILE.html", help="write a page on the fleet, as canid fleet report does"
    )


def count(text: str) -> int:
    """A number of processes, for argparse.

    Example:
        >>> count("4")
        4
    """
    try:
        value = int(text)
    except ValueError:
        value = 0
    # more processes than any machine has cores are a slip
    if not 1 <= value <= 10_000:
        raise argparse.ArgumentTypeError(f'"{text}" is not a number of processes')
    return value


def run(args: argparse.Namespace) -> int:
    """Plan, analyse, store."""
    from canid.fleet import run as fleet_run
    from canid.fleet import store as fleet_store
    from canid.fleet.plan import planned

    _know_the_words(args.logs)
    if args.output is None:
        raise ConfigError("fleet: -o DIR is missing: the folder of the results")
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
    with fleet_store.opened(args.output) as store:
        # at once: what is made of the results of an interrupted run needs to know its vehicle files
        store.note(command=command(_anywhere(args)), settings=_noted(settings))
        with Progress(f"{len(plan.logs):,} logs") as bar:
            shown = _shown(bar)
            try:
                done = fleet_run.run(
                    plan,
                    store,
                    settings,
                    runner(args, plan.sources),
                    retry_failed=args.retry_failed,
                    progress=shown,
                    hashing=bar.to,
                )
            except KeyboardInterrupt:
                info(f"what was finished is in {args.output}; the same command goes on")
                raise
            except OutputError as error:
                raise OutputError(f"{error}; make room, and the same command goes on") from None
        found = fleet_run.counts(done.logs)
        store.note(command=command(_anywhere(args)), settings=_noted(settings), logs=found._asdict())
        if not args.report:  # the page pools them as well
            _pooled(args.output, found)
    show = line_printer(args.json)
    for line in summary(found, done.analysed, args.output):
        show(line)
    with outputs.opened(json) as sink:
        if sink is not None:
            from canid.views import json_values

            sink.write(json_values.document("fleet", to_json(args, done, found)) + "\n")
    code = DAMAGED if found.failed or found.damaged else DONE
    return (_report(args) or code) if args.report else code


def _pooled(folder: str, found: Counts) -> None:
    """Write the tables of drivers and of the population, unless they are those of these drives."""
    from canid.fleet.summary import current, summarise

    if found.drivers and not current(folder):
        with Progress("pooling the drives"):
            summarise(folder)


def _know_the_words(words: Sequence[str]) -> None:
    """Refuse a first word that is a sub-verb with a slip."""
    first = words[0]
    if os.path.lexists(first) or not first.isalpha():
        return
    near = get_close_matches(first, SUB_VERBS, n=1)
    if near:
        raise ConfigError(f'fleet: "{first}" is no file or folder; did you mean "canid fleet {near[0]}"?')


def _settings(args: argparse.Namespace) -> Settings:
    from canid.fleet.job import Settings

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
    args: argparse.Namespace, sources: Mapping[str, Source]
) -> Callable[[Iterable[Job]], Generator[Outcome]]:
    """Who analyses: processes of this machine, or Dask."""
    workers = args.workers or cores()

    def analysed(jobs: Iterable[Job]) -> Generator[Outcome]:
        if args.scheduler is not None or workers > cores():
            from canid.fleet import dask_run

            yield from dask_run.outcomes(
                jobs, sources, scheduler=args.scheduler, workers=workers, inform=info
            )
        else:
            from canid.fleet import local_run

            yield from local_run.outcomes(jobs, sources, workers)

    return analysed


def _shown(bar: Progress) -> Callable[[Any], None]:
    def shown(now: Any) -> None:
        bar.count(now.done, now.total, f"{now.failed:,} failed" if now.failed else "")

    return shown


def summary(found: Counts, analysed: int, folder: str) -> list[str]:
    """What came of the logs, and what can be made of it.

    Example:
        >>> from canid.fleet.run import counts
        >>> rows = [{"status": "ok", "driver": "anna"}, {"status": "failed", "failure": "empty"}]
        >>> for line in summary(counts(rows), 2, "out"):
        ...     print(line)
        2 logs: 1 ok, 1 failed (1 empty); 2 analysed now
        1 driver: anna 1
        out/drives.parquet has a row for each log; logs.parquet says why logs failed
        next: canid fleet report out, canid fleet query out drivers, canid fleet prior out
    """
    parts = [f"{found.ok:,} ok"] if found.ok else []
    parts += [f"{found.damaged:,} damaged"] if found.damaged else []
    if found.failed:
        reasons = [f"{times:,} {name}" for name, times in found.failures.items()]
        more = [f"{len(reasons) - MAX_FAILURES:,} more reasons"] if len(reasons) > MAX_FAILURES else []
        parts.append(f"{found.failed:,} failed ({', '.join(reasons[:MAX_FAILURES] + more)})")
    copies = f", {found.duplicates:,} of them copies of others" if found.duplicates else ""
    lines = [f"{_some(found.logs, 'log')}: {', '.join(parts)}{copies}; {analysed:,} analysed now"]
    if found.drivers:
        ordered = sorted(found.drivers.items(), key=lambda one: (-one[1], one[0]))
        names = [f"{driver or '(no name)'} {drives:,}" for driver, drives in ordered[:MAX_DRIVERS]]
        more = [f"{len(ordered) - MAX_DRIVERS:,} more"] if len(ordered) > MAX_DRIVERS else []
        lines.append(f"{_some(len(ordered), 'driver')}: {', '.join(names + more)}")
    at = shlex.quote(folder)
    lines.append(f"{folder}/drives.parquet has a row for each log; logs.parquet says why logs failed")
    if found.drivers:
        lines.append(f"next: canid fleet report {at}, canid fleet query {at} drivers, canid fleet prior {at}")
    return lines


def _some(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def to_json(args: argparse.Namespace, done: Run, found: Counts) -> dict[str, Any]:
    """The object of --json."""
    return {
        "folder": os.path.abspath(args.output),
        "command": command(args),
        "logs": {
            "planned": found.logs,
            "ok": found.ok,
            "damaged": found.damaged,
            "failed": found.failed,
            "duplicates": found.duplicates,
            "analysed": done.analysed,
        },
        "failures": dict(found.failures),
        "drivers": [{"driver": name, "drives": drives} for name, drives in sorted(found.drivers.items())],
        "not_ok": [
            {key: row.get(key) for key in ("log", "status", "failure", "reason")}
            for row in done.logs
            if row.get("status") != "ok"
        ],
    }


def command(args: argparse.Namespace) -> str:
    """The command that gives the same results.

    Example:
        >>> command(argparse.Namespace(logs=["a b"], output="out", vehicle="generic", vehicles=None, folders=None,
        ...     workers=None, scheduler=None, timeout=3600.0, memory=10**9, no_diagnosis=True, no_windows=False,
        ...     no_traffic=False))
        "canid fleet 'a b' -o out --vehicle generic --timeout 3600s --memory 1000000000 --no-diagnosis"
    """
    words = ["canid", "fleet", *args.logs, "-o", args.output]
    for name in ("vehicle", "vehicles", "folders", "workers", "scheduler"):
        value = getattr(args, name)
        words += [f"--{name}", str(value)] if value else []
    words += ["--timeout", f"{args.timeout:g}s", "--memory", str(args.memory)]
    words += [
        f"--{name.replace('_', '-')}"
        for name in ("no_diagnosis", "no_windows", "no_traffic")
        if getattr(args, name)
    ]
    return shlex.join(words)


def _anywhere(args: argparse.Namespace) -> argparse.Namespace:
    """The same with absolute paths: the folder is read from other folders than that of the run."""

    def full(word: str | None) -> str | None:
        return os.path.abspath(word) if word is not None and os.path.exists(word) else word

    of_files = {name: full(getattr(args, name)) for name in ("vehicle", "vehicles", "output")}
    return argparse.Namespace(**{**vars(args), **of_files, "logs": [full(word) for word in args.logs]})


def _noted(settings: Settings) -> dict[str, Any]:
    return dict(settings._asdict())


def _report(args: argparse.Namespace) -> int:
    """The page of `canid fleet report`."""
    from canid.cli import Parser

    module = import_module("canid.cli.fleet_report")
    parser = Parser(prog="canid fleet report")
    module.arguments(parser)
    # where JSON has standard output, the answer of the page goes where all other text goes
    with redirect_stdout(sys.stderr if args.json == "-" else sys.stdout):
        return int(module.run(parser.parse_args([args.output, "-o", args.report])))
