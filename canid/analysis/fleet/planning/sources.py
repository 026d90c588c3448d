"""How logs are decoded: a vehicle file or a column map, read once, with a fingerprint of all that changes a number."""

from __future__ import annotations

import hashlib
from pathlib import Path

from canid.analysis.fleet.job import Source
from canid.analysis.tables import column_map
from canid.analysis.tables.column_map import ColumnMap
from canid.signals.vehicle import Vehicle, read_vehicle

# tables of named columns whose roles follow from their headings
HEADINGS = Source(None, None, "headings")


def read_source(name: str | Path) -> Source:
    """Read a vehicle file, or a column map, by path or by the name of a shipped one.

    Raises:
        ConfigError: with all mistakes of the file, a line each.

    Example:
        >>> generic = read_source("generic")
        >>> generic.vehicle.roles["speed"].unit, generic.columns, len(generic.fingerprint)
        ('m/s', None, 64)
        >>> read_source("openacc").columns.name
        'OpenACC'
    """
    table = column_map.toml_of(name)
    if table is not None and "columns" in table:
        return of_columns(column_map.read_map(name))
    return of_vehicle(read_vehicle(name))


def of_vehicle(vehicle: Vehicle) -> Source:
    """The source of logs of a vehicle; its fingerprint is of the contents of its files, wherever they lie."""
    return Source(vehicle, None, _fingerprint("vehicle", vehicle.name, [vehicle.path, *vehicle.dbc]))


def of_columns(columns: ColumnMap) -> Source:
    """The source of tables with a column map."""
    return Source(None, columns, _fingerprint("columns", columns.name, [columns.path]))


def _fingerprint(kind: str, name: str, files: list[str]) -> str:
    made = hashlib.sha256()
    for part in (kind.encode(), name.encode("utf-8", "surrogatepass"), *map(_bytes, files)):
        made.update(len(part).to_bytes(8, "little") + part)
    return made.hexdigest()


def _bytes(path: str) -> bytes:
    return Path(path).read_bytes()
