"""Logs for a study: read, or simulated through DBC and .blf, in several processes."""

from __future__ import annotations

import argparse
import os
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.ui.cli.inputs import drive_source, reading
from canid.ui.terminal.progress import Progress
from canid.values.errors import DONE, CanidError, ConfigError

if TYPE_CHECKING:
    from canid.analysis.drive.drive_reader import Drive
    from canid.models.simulation import Simulation
    from canid.signals.vehicle import Vehicle
    from canid.ui.cli.inputs.drive_source import Car
    from canid.values.types import Trace
    from canid_study.artifact import Skipped, Study
    from canid_study.chen_ulsoy.settings import ChenUlsoySettings


# of lane keeping that are simulated, as the paper has
DRIVERS = 12
# of each of them, for the null band of |Delta|: below 20 there is none
REPLICATES = 40


def of_logs(args: argparse.Namespace, car: Car) -> tuple[list[Study], int]:
    """Study recorded logs; also the exit code that the damaged ones among them deserve.

    A log that cannot be read is skipped and reported, where there are others. Raises the first
    error where none can be read.
    """
    from canid_study.artifact import Skipped

    drives: dict[str, Trace] = {}
    skipped: list[Skipped] = []
    errors: list[CanidError] = []
    damaged = DONE
    with _mapped(args.jobs if len(args.logs) > 1 else 1) as run:
        with Progress(f"reading {len(args.logs)} logs") as bar:
            read = partial(_read, car=car, start=args.start, stop=args.stop)
            for k, (path, drive) in enumerate(zip(args.logs, run(read, args.logs), strict=True), 1):
                bar.to(k / len(args.logs))
                if isinstance(drive, CanidError):
                    errors.append(drive)
                    skipped.append(Skipped(path, "the whole log", str(drive).removeprefix(f"{path}: ")))
                    continue
                damaged = reading.report_health(drive.health) or damaged
                drives[path] = drive.trace
        if not drives:
            raise errors[0]
        with Progress(f"studying {len(drives)} logs") as bar:
            study = _study(args, drives, run, lambda done, total: bar.to(done / max(total, 1)))
    return [study._replace(skipped=(*skipped, *study.skipped))], damaged


def _read(path: str, car: Car, start: float, stop: float) -> Drive | CanidError:
    """Read one log, in a process of its own; an error says why it cannot be read."""
    try:
        return drive_source.read_drive(
            path, car, argparse.Namespace(start=start, stop=stop), estimating=False
        )[0]
    except CanidError as error:
        return error


def _study(
    args: argparse.Namespace,
    drives: dict[str, Trace],
    run: Callable[..., Iterator[Any]],
    progress: Callable[[int, int], None],
) -> Study:
    """Study logs that have been read."""
    if args.what == "grover":
        from canid_study.grover import grover

        return grover.study(drives, _settings(args), progress, run=run)
    from canid_study.chen_ulsoy import chen_ulsoy, segments

    drivers: dict[str, list[tuple[str, Trace]]] = {}
    names = driver_names(list(drives), args.by)
    for path, trace in drives.items():
        drivers.setdefault(names[path], []).append((path, trace))
    # a recorded log has no simulator to get used to
    settings = _settings(args)._replace(warm_up=0)
    if args.segment is None:
        settings = settings._replace(segment=segments.fitting_length(drivers, settings))
    study = chen_ulsoy.study(drivers, settings, progress, run=run)
    return study._replace(says=(*study.says, *_limits(drivers, settings, args.by)))


def _limits(
    drivers: Mapping[str, Sequence[tuple[str, Trace]]], settings: ChenUlsoySettings, by: str
) -> Iterator[str]:
    """What the result of recorded logs rests on, and what they lack."""
    from canid_study.chen_ulsoy.segments import LENGTHS

    if settings.segment < LENGTHS[0]:
        yield (
            f"Segments of {settings.segment:g} s, where the paper has {LENGTHS[0]:g} s: the fits' own error is larger."
        )
    several = [name for name, logs in drivers.items() if len(logs) > 1]
    if by == "folder" and several:
        yield (
            f"All logs of {several[0]} are taken as one driver's; if they are not, use --by file, or --by MAP.toml."
        )
    traces = [trace for logs in drivers.values() for _, trace in logs]
    if not all({"steering_assist", "cruise_active"} & {*trace.signals} for trace in traces):
        yield (
            "No signal says whether an assistant steers: map steering_assist in the vehicle file, leave such logs out, or "
            "read the driver as both together."
        )


def _shortest(files: Mapping[str, Path]) -> dict[str, str]:
    """Names of files or folders: the fewest last parts of their paths with which no two have the same name."""
    different = set(files.values())
    deepest = max((len(file.parts) for file in different), default=1)
    for count in range(1, deepest):
        names = {file: "/".join(file.parts[1:][-count:]) or str(file) for file in different}
        if len(set(names.values())) == len(different):
            return {path: names[file] for path, file in files.items()}
    return {path: str(file) for path, file in files.items()}


def driver_names(paths: Sequence[str], by: str) -> dict[str, str]:
    """Log -> driver.

    Args:
        paths: logs.
        by: "file", "folder", or a TOML file with [drivers]: name = a list of patterns of file names.

    Raises:
        ConfigError: the file cannot be read, or does not name the driver of a log.

    Example:
        >>> driver_names(["s1/a.blf", "s1/b.blf"], "folder"), driver_names(["s1/a.blf"], "file")
        ({'s1/a.blf': 's1', 's1/b.blf': 's1'}, {'s1/a.blf': 'a'})
        >>> driver_names(["x/s1/a.blf", "y/s1/a.blf"], "folder")
        {'x/s1/a.blf': 'x/s1', 'y/s1/a.blf': 'y/s1'}
    """
    # absolute: "." and ".." are no names of a driver
    files = {path: Path(os.path.abspath(path)) for path in paths}
    if by == "file":
        stems = {path: file.with_suffix("") for path, file in files.items()}
        # drive.blf and drive.asc are two files
        return _shortest(stems if len(set(stems.values())) == len(set(files.values())) else files)
    if by == "folder":
        return _shortest({path: file.parent for path, file in files.items()})
    patterns = _drivers_of(by)
    out = {}
    for path in paths:
        matching = [
            name for name, globs in patterns.items() if any(fnmatch(Path(path).name, g) for g in globs)
        ]
        if len(matching) != 1:
            said = f"{len(matching)} drivers ({', '.join(matching)})" if matching else "no driver"
            raise ConfigError(f"{by}: {said} of the log {path}: name exactly one in [drivers]")
        out[path] = matching[0]
    return out


def _drivers_of(path: str) -> dict[str, list[str]]:
    """The table [drivers] of a mapping file. Raises ConfigError."""
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8")).get("drivers")
    except OSError as error:
        raise ConfigError(
            f"study: --by {path}: file, folder, or a TOML file with [drivers] ({error.strerror})"
        ) from error
    except ValueError as error:
        raise ConfigError(f"{path}: no TOML ({error})") from error
    good = isinstance(table, dict) and all(
        isinstance(globs, list) and all(isinstance(g, str) for g in globs) for globs in table.values()
    )
    if not good or not table:
        raise ConfigError(f'{path}: [drivers] is missing, with lines such as "Anna" = ["anna_*.blf"]')
    return dict(table)


def _settings(args: argparse.Namespace) -> Any:
    """The settings of a study: its defaults, and what the command line says."""
    if args.what == "grover":
        from canid_study.grover.grover import GroverSettings

        return GroverSettings(**_stated(args, "min_episode", "gate_fit"))
    from canid_study.chen_ulsoy.chen_ulsoy import ChenUlsoySettings

    return ChenUlsoySettings(**_stated(args, "segment", "bootstraps"))


def _stated(args: argparse.Namespace, *names: str) -> dict[str, Any]:
    """What the command line says of some settings."""
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}


@contextmanager
def _mapped(jobs: int | None) -> Iterator[Callable[..., Iterator[Any]]]:
    """A `map` over processes, in the order of what is given; with one process the ordinary one."""
    workers = jobs or os.cpu_count() or 1
    if workers == 1:
        yield map
        return
    pool: Executor = ProcessPoolExecutor(workers)
    try:
        yield pool.map
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def reproduced(args: argparse.Namespace, vehicle: Vehicle) -> Study:
    """Simulate the printed drivers, each through frames and a .blf, and study what is read back."""
    minutes: tuple[float, ...] = args.minutes
    with _mapped(args.jobs) as run, tempfile.TemporaryDirectory() as folder:
        simulations, study = _reproduction(args, minutes)
        with Progress("simulating the printed drivers") as bar:
            drives = {}
            for name, simulation in simulations:
                drives[name] = _through_log(simulation, vehicle, Path(folder) / "drive.blf")
                bar.to(min(len(drives) / _expected(args, minutes), 1.0))
        with Progress(f"studying {len(drives)} drives") as bar:
            made: Study = study(drives, progress=lambda done, total: bar.to(done / max(total, 1)), run=run)
            return made


def _through_log(simulation: Simulation, vehicle: Vehicle, path: Path) -> tuple[Trace, dict[str, Any]]:
    """Encode, write, read: what a recording of the drive would hold, and its truth."""
    from canid.analysis.drive.drive_reader import read_trace
    from canid.io.logs import write_log
    from canid.models.simulation import START_UTC, frames

    write_log(path, frames(simulation, vehicle), START_UTC)
    trace = read_trace(path, vehicle)
    path.unlink()
    return trace, simulation.truth


def _expected(args: argparse.Namespace, minutes: Iterable[float]) -> int:
    """Drives that will be simulated."""
    if args.what == "grover":
        from canid_study.grover.printed_drivers import SEEDS
        from canid_study.printed_numbers import GROVER_DRIVERS

        return max(len(GROVER_DRIVERS) * (args.seeds or SEEDS) * len(tuple(minutes)), 1)
    from canid_study.chen_ulsoy.printed_drivers import count

    return count(args.drivers or DRIVERS, args.c1)


def _reproduction(
    args: argparse.Namespace, minutes: tuple[float, ...]
) -> tuple[Iterator[tuple[str, Simulation]], Any]:
    """The simulated drives of a paper, and the function that studies them."""
    if args.what == "grover":
        from canid_study.grover import printed_drivers, reproduction

        seeds = {} if args.seeds is None else {"seeds": args.seeds}
        drives = printed_drivers.drives(args.seed, minutes, **seeds)
        return drives, partial(reproduction.study, settings=_settings(args))
    from canid_study.chen_ulsoy import printed_drivers as steering_drivers
    from canid_study.chen_ulsoy import reproduction as steering_reproduction

    if len(minutes) > 1:
        raise ConfigError("study: --minutes: one length for lane keeping")
    settings = _settings(args)
    if args.bootstraps is None:
        settings = settings._replace(bootstraps=REPLICATES)
    push = {} if args.push is None else {"push_sd": args.push}
    drives = steering_drivers.reproduction_drives(
        args.seed, args.drivers or DRIVERS, minutes[0], args.c1, **push
    )
    return drives, partial(steering_reproduction.study, settings=settings)
