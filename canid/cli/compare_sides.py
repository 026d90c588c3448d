"""The sides of a comparison as the command line names them: logs, parts of logs, folders, JSON of identify or diagnose."""

from __future__ import annotations

import argparse
import json
import math
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.cli import drive_source, reading
from canid.cli.output.progress import Progress
from canid.errors import DONE, ConfigError, LogError
from canid.logs import formats

if TYPE_CHECKING:
    from canid.cli.drive_source import Car
    from canid.comparison.drive import DriveEstimates, Side
    from canid.types import Trace
    from canid.vehicle import Vehicle

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
        >>> named("a.blf@60:300,b.blf")
        [Named(path='a.blf', start=60.0, stop=300.0), Named(path='b.blf', start=nan, stop=nan)]
    """
    # a name may hold commas
    parts = [words] if os.path.exists(words) else [part for part in words.split(",") if part]
    if not parts:
        raise ConfigError(f'compare: "{words}" names no file')
    return [one for part in parts for one in _named(part)]


def _named(part: str) -> list[Named]:
    if os.path.isdir(part):
        files = sorted(
            str(path)
            for path in Path(part).iterdir()
            if formats.log_suffix(path) in (*formats.read_suffixes(), ".parquet", ".vbo")
        )
        if not files:
            raise ConfigError(f"{part}: holds no log ({formats.described()})")
        return [Named(file, math.nan, math.nan) for file in files]
    found = None if os.path.exists(part) else _PART.fullmatch(part)
    if found is None:
        return [Named(part, math.nan, math.nan)]
    try:
        start, stop = (float(found[key]) if found[key] else math.nan for key in ("start", "stop"))
    except ValueError:
        raise ConfigError(f'compare: "{part}" is no part of a log; write LOG@60:300, in s') from None
    if stop <= start:
        raise ConfigError(f"compare: {part} ends before it begins")
    return [Named(found["path"], start, stop)]


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
    from canid.comparison.drive import Side

    cars = [_car(args, label, side) for label, side in zip("ab", sides, strict=False)]
    if len(sides) == 1:
        return _halves(args, sides[0], cars[0])
    made, code = [], DONE
    for label, side, car in zip("AB", sides, cars, strict=True):
        drives: list[DriveEstimates] = []
        for one in side:
            if one.is_json:
                drives += _from_json(one.path)
                continue
            assert car is not None
            name, trace, health, vehicle = _trace(args, one, car)
            code = health or code
            drives.append(_estimated(args, trace, name, vehicle))
        made.append(Side(label, tuple(drives)))
    return (made[0], made[1]), code


def _halves(args: argparse.Namespace, side: list[Named], car: Car | None) -> tuple[tuple[Side, Side], int]:
    """Both halves of one drive, with as much usable driving in each."""
    from canid.comparison import halves
    from canid.comparison.drive import Side

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
    if all(one.is_json for one in side):
        return None
    name = getattr(args, f"vehicle_{label}") or args.vehicle
    if name is None and not any(drive_source.is_table(one.path) for one in side if not one.is_json):
        raise ConfigError("compare: --vehicle V.toml is missing; generic and generic_lane are built in")
    return drive_source.car(args, "compare", name)


def _trace(args: argparse.Namespace, one: Named, car: Car) -> tuple[str, Trace, int, Vehicle]:
    part = argparse.Namespace(
        start=args.start if math.isnan(one.start) else one.start,
        stop=args.stop if math.isnan(one.stop) else one.stop,
    )
    drive, vehicle = drive_source.read_drive(one.path, car, part, estimating=False)
    code = reading.report_health(drive.health, one.path)
    whole = part.start <= 0.0 and math.isinf(part.stop)
    stop = "" if math.isinf(part.stop) else f"{part.stop:g}"
    return (one.path if whole else f"{one.path}@{part.start:g}:{stop}"), drive.trace, code, vehicle


def _estimated(args: argparse.Namespace, trace: Trace, name: str, vehicle: Vehicle) -> DriveEstimates:
    """By the object that --json of identify or diagnose has: a file of it gives the same comparison."""
    from canid.comparison import drive_json

    if args.diagnose:
        from canid.diagnosis.diagnose import diagnose
        from canid.views import diagnosis_json

        with Progress(f"diagnosing {name}") as bar:
            return drive_json.read(
                diagnosis_json.to_json(diagnose(trace, progress=bar.to), name, vehicle.name)
            )
    from canid.drive_parameters import identify
    from canid.views import identification_json

    found = identify(trace, select_orders=False, sliding=False, **vehicle.estimators)
    return drive_json.read(identification_json.to_json(found, name, vehicle.name))


def _from_json(path: str) -> list[DriveEstimates]:
    """All drives of a JSON file. Raises ConfigError."""
    from canid.comparison import drive_json

    try:
        if os.path.getsize(path) > MAX_JSON_BYTES:
            raise ConfigError(
                f"{path}: is larger than {MAX_JSON_BYTES // 1_000_000} MB; canid writes no such JSON"
            )
        of: Any = json.loads(Path(path).read_text(encoding="utf-8"))
        objects = of if isinstance(of, list) else [of]
        if not objects or not all(isinstance(one, dict) for one in objects):
            raise ValueError("it holds no JSON object")
        return [drive_json.read(one) for one in objects]
    except FileNotFoundError:
        raise ConfigError(f"no such file: {path}") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        why = "it is no JSON" if isinstance(error, json.JSONDecodeError | RecursionError) else str(error)
        raise ConfigError(f"{path}: cannot be compared: {why}") from error
