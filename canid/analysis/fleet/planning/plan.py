"""The plan of a fleet: which logs there are, whose they are, and how each is decoded."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from canid.analysis.fleet.job import Failure, Source
from canid.analysis.fleet.planning import address, listing
from canid.analysis.fleet.planning.folders import FolderPattern, pattern, whose
from canid.analysis.fleet.planning.listing import Listed
from canid.analysis.fleet.planning.sources import HEADINGS, read_source
from canid.analysis.fleet.planning.vehicle_map import VehicleMap, entry_of, read_map
from canid.analysis.tables import kinds
from canid.io.logs import formats
from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError


class PlannedLog(NamedTuple):
    """One log of the plan."""

    log: str  # absolute path, or URL
    root: str
    size: int  # bytes
    modified_ns: int  # ns since 1970; 0: not known
    driver: str
    car: str
    group_name: str
    source: str  # key of its `Source`; "": it has none
    failure: Failure = Failure.NONE  # why it is not analysed at all
    reason: str = ""


class Plan(NamedTuple):
    """All logs, in the order in which they were listed."""

    logs: Sequence[PlannedLog]
    sources: Mapping[str, Source]
    notes: tuple[str, ...]  # sentences on what was assumed


def planned(
    words: Sequence[str],
    *,
    vehicle: str | None = None,
    vehicles: str | None = None,
    folders: str | None = None,
    skip: Sequence[str] = (),
) -> Plan:
    """Plan the analysis of logs, without reading any of them.

    Args:
        words: of the command line, see `listing.listed`.
        vehicle: vehicle file or column map of all logs, or of those for which the mapping file names none.
        vehicles: mapping file.
        folders: pattern of folder names, such as "{car}/{driver}".
        skip: folders that hold no logs, such as that of the results.

    Raises:
        ConfigError: a word names nothing, a file has mistakes, or logs have no vehicle file.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> folder = Path(tempfile.mkdtemp()) / "anna"
        >>> folder.mkdir()
        >>> _ = (folder / "a.blf").write_bytes(b"0")
        >>> [(one.driver, one.car, one.size) for one in planned([str(folder.parent)], vehicle="generic").logs]
        [('anna', 'Generic car-following vehicle', 1)]
    """
    by = pattern(folders) if folders else None
    mapping = read_map(vehicles) if vehicles else None
    sources = dict(mapping.sources) if mapping is not None else {}
    default = mapping.source if mapping is not None else ""
    if vehicle is not None:
        read = read_source(vehicle)
        sources[read.fingerprint] = read
        default = default or read.fingerprint
    listed = listing.listed(words, skip)
    if vehicle is None and mapping is None:
        _need_no_vehicle(listed)
    flat = _flat_folders(listed) if by is None else frozenset()
    logs = [_planned(file, by, mapping, default, sources, flat) for file in listed]
    if any(log.source == HEADINGS.fingerprint for log in logs):
        sources[HEADINGS.fingerprint] = HEADINGS
    return Plan(logs, sources, _notes([_below_named(file, flat) for file in listed], logs, by, mapping))


def _flat_folders(listed: Sequence[Listed]) -> frozenset[str]:
    """Roots whose logs lie in them directly, where several were named: then their own names are the drivers'."""
    roots = {file.root for file in listed}
    deep = {file.root for file in listed if "/" in file.relative}
    return frozenset(roots - deep) if len(roots) > 1 else frozenset()


def _below_named(file: Listed, flat: frozenset[str]) -> str:
    """The path by which driver and car are known.

    >>> _below_named(Listed("/logs/anna/a.blf", "/logs/anna", 1, 0), frozenset(["/logs/anna"]))
    'anna/a.blf'
    """
    name = address.folder_name(file.root)
    return f"{name}/{file.relative}" if file.root in flat and name else file.relative


def _need_no_vehicle(files: Sequence[Listed]) -> None:
    # a line of a list that names nothing is a failed log, with or without a vehicle file
    frames = [file.log for file in files if file.size != listing.MISSING and not _may_be_table(file.relative)]
    if frames:
        more = f" (and {len(frames) - 1:,} more)" if len(frames) > 1 else ""
        raise ConfigError(
            f"fleet: {brief(frames[0])}{more} is a log of CAN frames: name its vehicle file with --vehicle V.toml, "
            f"or those of all logs with --vehicles MAP.toml (`canid init FILE.dbc` proposes a vehicle file)"
        )


def _may_be_table(path: str) -> bool:
    return formats.log_suffix(path) in kinds.SUFFIXES


def _planned(
    file: Listed,
    by: FolderPattern | None,
    mapping: VehicleMap | None,
    default: str,
    sources: Mapping[str, Source],
    flat: frozenset[str],
) -> PlannedLog:
    relative = file.relative
    entry = entry_of(relative, mapping) if mapping is not None else None
    folders = whose(_below_named(file, flat), by)
    driver = (entry.driver if entry else "") or (folders.driver if folders else "")
    car = (entry.car if entry else "") or (folders.car if folders else "")
    group = (entry.group if entry else "") or (folders.group if folders else "")
    source = (entry.source if entry else "") or default
    if not source and _may_be_table(relative):
        source = HEADINGS.fingerprint
    failure, reason = _problem(file, relative, driver, source, by, mapping, mapped=entry is not None)
    if not car and source in sources:
        decoded = sources[source].vehicle or sources[source].columns
        car = decoded.name if decoded is not None else ""
    # the same few names stand in 100,000 rows
    root, driver, car, group, source = map(sys.intern, (file.root, driver, car, group, source))
    return PlannedLog(
        file.log, root, file.size, file.modified_ns, driver, car, group, source, failure, reason
    )


def _problem(
    file: Listed,
    relative: str,
    driver: str,
    source: str,
    by: FolderPattern | None,
    mapping: VehicleMap | None,
    *,
    mapped: bool,
) -> tuple[Failure, str]:
    """Why a log cannot be analysed."""
    if file.problem:
        return Failure.UNREADABLE, file.problem
    if file.size == listing.MISSING:
        return Failure.MISSING, "no such file"
    if mapping is not None and not mapped:
        return Failure.UNMAPPED, f"no [[drives]] of {mapping.path} matches {relative}"
    if not driver:
        text = by.text if by is not None else ""
        return Failure.UNMAPPED, f"its folders do not match --folders {text}: {relative}"
    if not source:
        return Failure.UNMAPPED, "no vehicle file: its [[drives]] names none, and --vehicle is not given"
    return Failure.NONE, ""


def _notes(
    paths: Sequence[str], logs: Sequence[PlannedLog], by: FolderPattern | None, mapping: VehicleMap | None
) -> tuple[str, ...]:
    if by is not None or mapping is not None:
        return ()
    depths = {min(path.count("/"), 2) for path in paths}
    drivers = {log.driver for log in logs}
    says = {
        0: "logs without folders have their names as drivers",
        1: "the folder is the driver",
        2: "the first folder is the car, the second the driver",
    }
    joined = "; ".join(says[depth] for depth in sorted(depths))
    return (
        f"{len(logs):,} logs of {len(drivers):,} drivers: {joined} (--folders and --vehicles change that)",
    )
