"""The sides of a comparison as the command line names them: logs, parts of logs, folders, JSON of identify or diagnose."""

from __future__ import annotations

import argparse
import json
import math
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.inputs.named_files import existing
from canid.ui.terminal.progress import Progress
from canid.values.errors import DONE, ConfigError, LogError
from canid.values.shipped_files import located

if TYPE_CHECKING:
    from canid.analysis.comparison.drive import DriveEstimates, Side
    from canid.signals.vehicle import Vehicle
    from canid.ui.cli.inputs.drive_source import Car
    from canid.values.types import Trace

# bytes; JSON of an hour with all its windows takes 3 MB
MAX_JSON_BYTES = 200_000_000
_PART = re.compile(r"(?P<path>.+)@(?P<start>[0-9.]*):(?P<stop>[0-9.]*)")


class Named(NamedTuple):
    """One log or JSON file."""

    path: str
    start: float  # s; NaN: not stated
    stop: float  # s; NaN: not stated

    @property
    def is_json(self) -> bool:
        """By its suffix."""
        return self.path.lower().endswith(".json")


def named(words: str) -> list[Named]:
    """Split what names a side into files.

    Raises:
        ConfigError: a folder holds no logs, or a part is none.

    Example:
        >>> named("dbc@60:300,a.json")
        [Named(path='dbc', start=60.0, stop=300.0), Named(path='a.json', start=nan, stop=nan)]
    """
    # a name may hold commas
    parts = [words] if os.path.exists(words) else [part for part in words.split(",") if part]
    if not parts:
        raise ConfigError(f'compare: "{words}" names no file')
    return [part_named for part in parts for part_named in _named(part)]


def _named(part: str) -> list[Named]:
    if os.path.isdir(part):
        from canid.io.logs import formats

        files = sorted(
            str(path)
            for path in Path(part).iterdir()
            if formats.log_suffix(path) in (*formats.read_suffixes(), ".parquet", ".vbo")
        )
        if not files:
            raise ConfigError(f"{part}: holds no log ({formats.described()})")
        return [Named(file, math.nan, math.nan) for file in files]
    match = None if os.path.exists(part) else _PART.fullmatch(part)
    if match is None:
        return [_located(part, math.nan, math.nan)]
    try:
        start, stop = (float(match[key]) if match[key] else math.nan for key in ("start", "stop"))
    except ValueError:
        raise ConfigError(f'compare: "{part}" is no part of a log; write LOG@60:300, in s') from None
    if stop <= start:
        raise ConfigError(f"compare: {part} ends before it begins")
    return [_located(match["path"], start, stop)]


def _located(path: str, start: float, stop: float) -> Named:
    file = str(located(path))
    part = Named(file, start, stop)
    if not part.is_json:
        existing(file)
    return part


def read(args: argparse.Namespace, sides: list[list[Named]]) -> tuple[tuple[Side, Side], int]:
    """Read and identify both sides.

    Args:
        args: of the verb.
        sides: one (its halves are compared) or two.

    Returns:
        the sides, and the exit code that damaged logs deserve.

    Raises:
        ConfigError: a vehicle is missing, or a JSON file is not canid's.
        LogError: a log cannot be read.
    """
    from canid.analysis.comparison.drive import Side

    cars = [_car(args, label, side) for label, side in zip("ab", sides, strict=False)]
    if len(sides) == 1:
        return _halves(args, sides[0], cars[0])
    made, code = [], DONE
    for label, side, car in zip("AB", sides, cars, strict=True):
        drives: list[DriveEstimates] = []
        for part in side:
            if part.is_json:
                drives += _from_json(part.path)
                continue
            assert car is not None
            name, trace, health, vehicle = _trace(args, part, car)
            code = health or code
            drives.append(_estimated(args, trace, name, vehicle))
        made.append(Side(label, tuple(drives)))
    return (made[0], made[1]), code


def _halves(args: argparse.Namespace, side: list[Named], car: Car | None) -> tuple[tuple[Side, Side], int]:
    """Both halves of one drive, with as much usable driving in each."""
    from canid.analysis.comparison import halves
    from canid.analysis.comparison.drive import Side

    if len(side) != 1 or side[0].is_json or car is None:
        raise ConfigError("compare: only a log has halves; name a second side, or one log")
    _, trace, code, vehicle = _trace(args, side[0], car)
    first, second = halves.halves(trace)
    if not (len(first.t) and len(second.t)):
        raise LogError(f"{side[0].path}: holds no drive that could be halved")
    made = [
        Side(label, (_estimated(args, part, f"{side[0].path}@{part.t[0]:.0f}:{part.t[-1]:.0f}", vehicle),))
        for label, part in (("A", first), ("B", second))
    ]
    return (made[0], made[1]), code


def _car(args: argparse.Namespace, label: str, side: list[Named]) -> Car | None:
    if all(part.is_json for part in side):
        return None
    name = getattr(args, f"vehicle_{label}") or args.vehicle
    if name is None and not any(drive_source.is_table(part.path) for part in side if not part.is_json):
        raise ConfigError("compare: --vehicle V.toml is missing; generic and generic_lane are built in")
    return drive_source.car(args, "compare", name)


def _trace(args: argparse.Namespace, source: Named, car: Car) -> tuple[str, Trace, int, Vehicle]:
    part = argparse.Namespace(
        start=args.start if math.isnan(source.start) else source.start,
        stop=args.stop if math.isnan(source.stop) else source.stop,
    )
    drive, vehicle = drive_source.read_drive(source.path, car, part, estimating=False)
    code = reading.report_health(drive.health, source.path)
    start = "" if math.isinf(part.start) else f"{part.start:g}"
    stop = "" if math.isinf(part.stop) else f"{part.stop:g}"
    return (f"{source.path}@{start}:{stop}" if start or stop else source.path), drive.trace, code, vehicle


def _estimated(args: argparse.Namespace, trace: Trace, name: str, vehicle: Vehicle) -> DriveEstimates:
    """As identified or diagnosed; a file of the verb's --json gives the same comparison."""
    from canid.analysis.comparison import result_estimates
    from canid.values.text.numbers import role_unit

    if args.diagnose:
        from canid.models.diagnosis.diagnose import diagnose

        with Progress(f"diagnosing {name}") as bar:
            report = diagnose(trace, progress=bar.to)
        return result_estimates.of_report(report, name, vehicle.name, role_unit(report.output))
    from canid.analysis.drive.drive_parameters import identify

    result = identify(trace, select_orders=False, sliding=False, **vehicle.estimators)
    unit = role_unit(result.drive_summary.output)
    return result_estimates.of_identified(result, name, vehicle.name, unit)


def _from_json(path: str) -> list[DriveEstimates]:
    """All drives of a JSON file. Raises ConfigError."""
    from canid.analysis.comparison import drive_json

    try:
        if os.path.getsize(path) > MAX_JSON_BYTES:
            raise ConfigError(
                f"{path}: is larger than {MAX_JSON_BYTES // 1_000_000} MB; canid writes no such JSON"
            )
        data: Any = json.loads(Path(path).read_text(encoding="utf-8"))
        objects = data if isinstance(data, list) else [data]
        if not objects or not all(isinstance(entry, dict) for entry in objects):
            raise ValueError("it holds no JSON object")
        return [drive_json.read(entry) for entry in objects]
    except FileNotFoundError:
        raise ConfigError(f"no such file: {path}") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        why = "it is no JSON" if isinstance(error, json.JSONDecodeError | RecursionError) else str(error)
        raise ConfigError(f"{path}: cannot be compared: {why}") from error
