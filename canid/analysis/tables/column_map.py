"""A column map: which column of a table is which role, in which unit; read from TOML, or shipped for public data sets."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, model_validator

from canid.analysis.tables.headings import EXTRA, TIME
from canid.mathematics.estimators import ESTIMATORS
from canid.signals.dbc_text.parsing import ParseError, Parser
from canid.signals.vehicle import Vehicle, file_bytes
from canid.signals.vehicle.quoting import brief, shown
from canid.signals.vehicle.schema import (
    MAX_KEYS,
    Age,
    DriverSection,
    Name,
    Number,
    Section,
    did_you_mean,
    parse,
    parse_settings,
)
from canid.signals.vehicle.vehicle_file import MAX_TOML_BYTES
from canid.values.errors import ConfigError
from canid.values.roles import OUTPUTS, ROLES
from canid.values.types import Driver, OutputFilter

SECTIONS = ("name", "describes", "header", "columns", "driver", *(estimator.name for estimator in ESTIMATORS))
SETS = Path(__file__).parent / "sets"
_Names = Annotated[list[Name], Field(min_length=1, max_length=20)]


class ColumnEntry(Section):
    """Where one role comes from: a column's name, several of which the first that is there is taken, or a table."""

    column: Name | _Names
    unit: Name | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    absolute: bool = False  # without its sign
    sign_of: Name | None = None  # multiplied by the sign of another column
    between: Annotated[list[Name], Field(min_length=4, max_length=4)] | None = (
        None  # the distance of two points: x, y, x, y
    )
    center: bool = False  # of a position: of the vehicle's centre, not of its front
    none: Annotated[
        list[Number], Field(default_factory=list, max_length=20)
    ]  # numbers that say that there is none
    true: Annotated[
        list[Name], Field(default_factory=list, max_length=20)
    ]  # texts, or numbers, that mean yes
    rate: Annotated[float, Field(gt=0.0, le=1e6)] | None = None  # of a time that counts frames: frames per s
    stale: Age | None = None  # s; a value that is older counts as not measured
    valid: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None  # in the role's unit

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"column": value} if isinstance(value, str | list) else value

    @property
    def names(self) -> list[str]:
        """The columns that it may be."""
        return [self.column] if isinstance(self.column, str) else list(self.column)


class ColumnMap(NamedTuple):
    """A column map; empty: columns are found by their headings alone."""

    name: str = ""
    path: str = ""
    entries: Mapping[str, ColumnEntry] = {}
    header: tuple[str, ...] = ()  # names of the columns of a table without a header
    driver: Driver | None = None  # None: judged from the columns
    estimators: Mapping[str, Any] = {}
    stale: Mapping[str, float] = {}  # role -> s, of a vehicle file

    @property
    def numbered(self) -> bool:
        """Whether columns are numbered by the vehicle, as Speed1, Speed2."""
        return any("{n" in name for entry in self.entries.values() for name in entry.names)


def shipped() -> dict[str, Path]:
    """The column maps that are shipped, by name.

    Example:
        >>> sorted(shipped())
        ['citysim', 'exid', 'follownet', 'highd', 'lyft', 'ngsim', 'openacc', 'openpilot', 'sumo', 'ultra_av', 'waymo']
    """
    return {path.stem: path for path in sorted(SETS.glob("*.toml"))}


def of_vehicle(vehicle: Vehicle) -> ColumnMap:
    """A map whose columns are found by their headings, with a vehicle's driver, settings and ages.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> of_vehicle(read_vehicle("generic")).driver.output
        'pedal'
    """
    stale = {role: how.stale for role, how in vehicle.roles.items()}
    return ColumnMap(name=vehicle.name, driver=vehicle.driver, estimators=vehicle.estimators, stale=stale)


def toml_of(path: str | Path) -> dict[str, Any] | None:
    """The TOML file of a path, or of the name of a shipped map; None: there is no such file.

    Raises:
        ConfigError: it cannot be read.
    """
    file = locate(path)
    if file is None:
        return None
    with Parser() as parser:
        try:
            return parser.toml(file_bytes.read(file, MAX_TOML_BYTES, "column map"))
        except ParseError as error:
            raise ConfigError(f"{file} is not valid TOML: {brief(str(error))}") from None


def locate(path: str | Path) -> Path | None:
    """The file of a path, or of the name of a shipped map."""
    given = Path(path)
    return given if os.path.isfile(given) else shipped().get(str(path).lower())


def read_map(path: str | Path) -> ColumnMap:
    """Read a column map.

    Args:
        path: the file; or the name of a shipped one, such as "highd".

    Raises:
        ConfigError: with all mistakes at once, a line each.

    Example:
        >>> read_map("highd").entries["speed"].column
        'xVelocity'
    """
    table = toml_of(path)
    file = locate(path)
    if table is None or file is None:
        raise ConfigError(
            f"column map {brief(str(path))} does not exist; shipped with canid: {', '.join(shipped())}"
        )
    return of_table(table, str(file))


def of_table(table: Mapping[str, Any], path: str) -> ColumnMap:
    """Check what the TOML file of a column map holds. Raises ConfigError with all mistakes."""
    errors = [
        f"{brief(key)}: unknown section{did_you_mean(key, SECTIONS)}"
        for key in list(table)[:MAX_KEYS]
        if key not in SECTIONS
    ]
    section = table.get("columns")
    entries: dict[str, ColumnEntry] = {}
    known = (*ROLES, *EXTRA)
    if not isinstance(section, dict) or not section or len(section) > MAX_KEYS:
        errors.append(
            f'columns: must be a section with entries such as speed = "v [km/h]", not {shown(section)}'
        )
        section = {}
    for role, value in section.items():
        key = f"columns.{brief(role)}"
        if role not in known:
            errors.append(f"{key}: unknown role{did_you_mean(role, known)}; there are {', '.join(known)}")
            continue
        entry, wrong = parse(ColumnEntry, value, key)
        errors += wrong
        if entry is not None:
            entries[role] = entry
            if entry.rate is not None and role != TIME:
                errors.append(f"{key}.rate: only time counts frames")
    header = table.get("header", [])
    if not (isinstance(header, list) and len(header) <= 1000 and all(isinstance(x, str) for x in header)):
        errors.append("header: must be the list of the columns' names, of a table without a header")
        header = []
    driver: Driver | None = None
    stated, wrong = parse(DriverSection, table.get("driver", {}), "driver")
    errors += wrong
    if stated is not None and "driver" in table:
        if stated.output not in OUTPUTS:
            errors.append(
                f"driver.output: is not one of {', '.join(OUTPUTS)}{did_you_mean(stated.output, OUTPUTS)}"
            )
        made = None if stated.output_filter is None else OutputFilter(*dict(stated.output_filter).values())
        driver = Driver(stated.task, stated.output, stated.headway_desired, made)
    estimators = {}
    for estimator in ESTIMATORS:
        settings, wrong = parse_settings(estimator.settings, table.get(estimator.name, {}), estimator.name)
        errors += wrong
        estimators[estimator.name] = settings
    if errors:
        name = brief(Path(path).name)
        raise ConfigError(*(f"{name}: {line}" for line in errors[:30]))
    return ColumnMap(
        str(table.get("name", Path(path).stem)), path, entries, tuple(header), driver, estimators
    )
