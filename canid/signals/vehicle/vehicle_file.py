"""Reading of a vehicle file and its DBC files; all their mistakes are reported at once."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from canid.mathematics.estimators import ESTIMATORS
from canid.mathematics.identification.fopdt.prior import CHANNELS
from canid.signals.dbc_text.parsing import ParseError, Parser
from canid.signals.vehicle import file_bytes
from canid.signals.vehicle.database import (
    MAX_DBC_BYTES,
    Dbc,
    brief_sentence,
    load,
    message_map,
    with_protocol,
)
from canid.signals.vehicle.mapping import (
    LeadConfig,
    Made,
    MessageMap,
    RoleMap,
    SignalMap,
    TrackMap,
    Vehicle,
    carried,
)
from canid.signals.vehicle.quoting import brief, shown
from canid.signals.vehicle.schema import (
    MAX_KEYS,
    MAX_NAME_LENGTH,
    SECTIONS,
    DbcFile,
    DerivativeEntry,
    DriverSection,
    Entry,
    HeadwayEntry,
    LeadSection,
    MeanEntry,
    Options,
    SignalEntry,
    did_you_mean,
    parse,
    parse_entry,
    parse_settings,
)
from canid.signals.vehicle.signal_resolution import (
    Mistakes,
    find_message,
    find_signal,
    find_source,
    full_scale,
    signal_map,
)
from canid.signals.vehicle.tracks import resolve_tracks, track_age
from canid.values.errors import ConfigError
from canid.values.roles import DERIVED, NEEDS, OUTPUTS, ROLES, Role
from canid.values.shipped_files import SHIPPED, shipped
from canid.values.types import TASK_INPUTS, Driver, Latency, OutputFilter

# fifty times the largest known vehicle file, with its comments
MAX_TOML_BYTES = 256_000
# DBC files of one vehicle: one or two a bus, and no vehicle has more buses
_MAX_DBC_FILES = 64
# mistakes that are reported at once: more are one mistake repeated, or the file is no vehicle file
_MAX_MISTAKES = 30


def read_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle file (TOML) and the DBC files that it names.

    Args:
        path: the file; or a bare name, such as "generic", of a vehicle that is shipped with canid.

    Returns:
        The vehicle, with `warnings` on what is questionable but no mistake.

    Raises:
        ConfigError: with all mistakes at once, one line each: file, key, what is wrong, did you mean.

    Example:
        >>> vehicle = read_vehicle("generic")
        >>> vehicle.roles["speed"].message, vehicle.roles["speed"].unit
        ('EGO_SPEED', 'm/s')
    """
    return with_databases(path)[0]


def with_databases(path: str | Path) -> tuple[Vehicle, list[Dbc]]:
    """The same, and the DBC files as they were read for it.

    Example:
        >>> vehicle, files = with_databases("generic")
        >>> vehicle.name, [file.file for file in files]
        ('Generic car-following vehicle', ['generic.dbc'])
    """
    file = locate(path)
    data = file_bytes.read(file, MAX_TOML_BYTES, "vehicle file")
    mistakes = Mistakes([], [])
    with Parser() as parser:
        try:
            data.decode("utf-8")
            table = parser.toml(data)
        except UnicodeDecodeError as error:
            raise ConfigError(f"{file} cannot be read: {error}") from None
        except ParseError as error:
            raise ConfigError(f"{file} is not valid TOML: {brief_sentence(str(error))}") from None
        vehicle, files = _vehicle(file, table, mistakes, parser)
    if mistakes.errors or vehicle is None:
        lines = mistakes.errors[:_MAX_MISTAKES]
        if len(mistakes.errors) > _MAX_MISTAKES:
            lines.append(f"and {len(mistakes.errors) - _MAX_MISTAKES:,} more mistakes")
        name = brief(file.name)
        raise ConfigError(*(f"{name}: {line}" for line in lines))
    return vehicle, files


def read_databases(path: str | Path) -> list[Dbc]:
    """Read the DBC files alone that a vehicle file names.

    Raises:
        ConfigError: the vehicle file or one of them cannot be read.

    Example:
        >>> [file.file for file in read_databases("generic")]
        ['generic.dbc']
    """
    file = locate(path)
    mistakes = Mistakes([], [])
    with Parser() as parser:
        try:
            table = parser.toml(file_bytes.read(file, MAX_TOML_BYTES, "vehicle file"))
        except ParseError as error:
            raise ConfigError(f"{file} is not valid TOML: {brief_sentence(str(error))}") from None
        files = _files(file.parent, table.get("dbc"), mistakes, parser)
    if mistakes.errors:
        raise ConfigError(*(f"{brief(file.name)}: {line}" for line in mistakes.errors[:_MAX_MISTAKES]))
    return files


def locate(path: str | Path) -> Path:
    """Find the vehicle file of a path or a bare name.

    Raises:
        ConfigError: there is none; lists the vehicles that are shipped with canid.
    """
    given = Path(path)
    if os.path.exists(given):
        return given  # of a folder, a pipe reading it gives the error
    known = {file.stem: file for file in sorted(shipped().glob("*.toml"))}
    if given.name == str(path) and given.suffix in ("", ".toml") and given.stem in known:
        return known[given.stem]
    folder = given.parent if os.path.isdir(given.parent) else Path()
    near = difflib.get_close_matches(given.name, [p.name for p in folder.glob("*.toml")] + list(known), n=1)
    hint = f' (did you mean "{near[0]}"?)' if near else ""
    raise ConfigError(
        f"vehicle file {brief(str(given))} does not exist{hint}; shipped with canid: {', '.join(known)}"
    )


def _vehicle(
    file: Path, table: Mapping[str, Any], mistakes: Mistakes, parser: Parser
) -> tuple[Vehicle | None, list[Dbc]]:
    errors = mistakes.errors
    if len(table) > MAX_KEYS:
        errors.append(f"{len(table):,} keys and sections; the sections are {', '.join(SECTIONS)}")
        return None, []
    errors += [
        f"{brief(key)}: unknown section{did_you_mean(key, SECTIONS)}" for key in table if key not in SECTIONS
    ]
    name = table.get("name", file.stem)
    if not isinstance(name, str):
        errors.append(f"name: must be a text, not {shown(name)}")
    elif len(name) > MAX_NAME_LENGTH:
        errors.append(f"name: has {len(name):,} characters; at most {MAX_NAME_LENGTH:,}")

    driver, wrong = parse(DriverSection, table.get("driver", {}), "driver")
    errors += wrong
    estimators = {}
    for estimator in ESTIMATORS:
        section = table.get(estimator.name, {})
        estimators[estimator.name], wrong = parse_settings(estimator.settings, section, estimator.name)
        errors += wrong
    lead, wrong = parse(LeadSection, table.get("lead", {}), "lead")
    errors += wrong

    entries = _entries(table.get("signals", {}), errors)
    files = _files(file.parent, table.get("dbc"), mistakes, parser)
    roles: dict[str, RoleMap] = {}
    tracks: tuple[TrackMap, ...] | None = None
    if any(file.messages for file in files):
        roles = _roles(entries, files, mistakes)
        tracks = resolve_tracks(lead, files, mistakes) if lead is not None else None
    if driver is not None and lead is not None:
        errors += _missing(driver, lead, table.get("signals", {}))
        errors += _foreign_priors(driver, estimators)
    if errors or driver is None or lead is None:
        return None, files
    stated = lead.latency
    of_driver = _driver(driver)._replace(
        latency=None if stated is None else Latency(stated.value, stated.sd),
        full_scale=roles[driver.output].full_scale,
    )
    vehicle = Vehicle(
        name=str(name),
        path=str(file),
        dbc=tuple(str(_relative_to(file.parent, dbc.file)) for dbc in _dbc_entries(table.get("dbc"), [])),
        roles=roles,
        lead=LeadConfig(
            tracks,
            lead.in_path,
            lead.gap_noise,
            lead.range_rate_noise,
            track_age(lead),
            isinstance(entries.get("range_rate"), DerivativeEntry),
        ),
        messages=_messages(files, [*carried(roles.values()), *(tracks or ())]),
        driver=of_driver,
        estimators={name: _of_driver(settings, of_driver) for name, settings in estimators.items()},
        warnings=tuple(mistakes.warnings),
    )
    return vehicle, files


def _driver(section: DriverSection) -> Driver:
    """Make the driver; of what nobody says otherwise, an acceleration was smoothed somehow and a pedal was not."""
    stated = section.output_filter
    made = OutputFilter(stated.kind, stated.width) if stated is not None else None
    if made is None:
        made = OutputFilter("unknown" if section.output == "accel" else "none")
    return Driver(section.task, section.output, section.headway_desired, made)


def _of_driver(settings: Any, driver: Driver) -> Any:
    """Settings of an estimator, with what `[driver]` states."""
    return settings._replace(
        **{name: getattr(driver, name) for name in settings._fields if name in Driver._fields}
    )


def _entries(section: object, errors: list[str]) -> dict[str, Entry]:
    if not isinstance(section, dict):
        errors.append(f"signals: must be a section, not {shown(section)}")
        return {}
    if len(section) > MAX_KEYS:
        errors.append(f"signals: {len(section):,} entries; there are {len(ROLES)} roles")
        return {}
    entries: dict[str, Entry] = {}
    for role, value in section.items():
        key = f"signals.{brief(role)}"
        if role in DERIVED:
            errors.append(f"{key}: {DERIVED[role]}")
            continue
        if role not in ROLES:
            errors.append(f"{key}: unknown role{did_you_mean(role, ROLES)}")
        entry, wrong = parse_entry(role, value, key)
        errors += wrong
        if entry is not None and role in ROLES:
            entries[role] = entry
    return entries


def _dbc_entries(section: object, errors: list[str]) -> list[DbcFile]:
    listed = section if isinstance(section, list) else [] if section is None else [section]
    if not listed:
        errors.append('dbc: is missing; write dbc = ["<vehicle>.dbc"]')
    if len(listed) > _MAX_DBC_FILES:
        errors.append(f"dbc: {len(listed):,} files; at most {_MAX_DBC_FILES} are read")
        return []
    entries = []
    for index, value in enumerate(listed):
        short = {"file": value} if isinstance(value, str) else value
        entry, wrong = parse(DbcFile, short, f"dbc[{index}]")
        errors += wrong
        entries += [entry] if entry is not None else []
    return entries


def _relative_to(folder: Path, file: str) -> Path:
    """Resolve a path relative to the vehicle file; "a/../b" is shown to the user as "b". "shipped:x.dbc" is canid's own."""
    shipped_name = file.removeprefix(SHIPPED)
    if shipped_name != file and Path(shipped_name).name == shipped_name:
        return shipped() / shipped_name
    return Path(os.path.normpath(folder / file))


def _shipped_hint(file: str) -> str:
    """What to write where a file is missing and canid has one of that name: another file is never read in its place."""
    if Path(file).name != file or not os.path.isfile(shipped() / file):
        return ""
    return f'; canid\'s own file of that name is "{SHIPPED}{file}"'


def _files(folder: Path, section: object, mistakes: Mistakes, parser: Parser) -> list[Dbc]:
    files, bytes_left = [], MAX_DBC_BYTES
    for entry in _dbc_entries(section, mistakes.errors):
        try:
            path = _relative_to(folder, entry.file)
            dbc, warnings, size = load(path, entry.bus, parser, bytes_left)
        except ConfigError as error:
            hint = "" if os.path.lexists(path) else _shipped_hint(entry.file)
            mistakes.errors.append(f"dbc: {error}{hint}")
            # Its place is kept, so that "no message X in ..." names the files that could not be searched.
            files.append(Dbc(f"{brief(Path(entry.file).name)} (not read)", entry.bus, {}))
            continue
        bytes_left -= size
        files.append(dbc if entry.protocol is None else with_protocol(dbc, entry.protocol))
        mistakes.warnings.extend(warnings)
    return files


# of a gap that is sent as a time
_HEADWAY = Role("s", "number", "time headway")


def _roles(entries: Mapping[str, Entry], files: Sequence[Dbc], mistakes: Mistakes) -> dict[str, RoleMap]:
    """Resolve the entries; those that are made of the own speed after it."""
    roles: dict[str, RoleMap] = {}
    for role, entry in entries.items():
        if isinstance(entry, SignalEntry):
            mapped = _role(role, ROLES[role], entry, files, mistakes)
        elif isinstance(entry, MeanEntry):
            mapped = _mean(role, entry, files, mistakes)
        else:
            continue
        if mapped is not None:
            roles[role] = mapped
    for role, entry in entries.items():
        if isinstance(entry, SignalEntry | MeanEntry | DerivativeEntry):
            continue
        headway = isinstance(entry, HeadwayEntry)
        kind: Made = "headway" if headway else "lead_speed"
        definition = _HEADWAY if headway else ROLES["lead_speed"]
        signal = _single(entry, getattr(entry, kind))
        first = _role(f"{role}.{kind}", definition, signal, files, mistakes, f"signals.{role}.{kind}")
        if first is not None and (own_speed := roles.get("speed")) is not None:
            speed = own_speed._replace(role=f"{role}.speed")
            roles[role] = first._replace(role=role, unit=ROLES[role].unit, made=kind, parts=(first, speed))
    if isinstance(entries.get("range_rate"), DerivativeEntry):
        mistakes.warnings.append(
            "range_rate: none is sent; it is the derivative of the gap, whose noise widens the intervals: say so where you "
            "quote K"
        )
    # in the order of the file
    return {role: roles[role] for role in entries if role in roles}


def _single(entry: Entry, signal: str) -> SignalEntry:
    """The options of a made entry, for one of its signals."""
    return SignalEntry(signal=signal, **{name: getattr(entry, name) for name in Options.model_fields})


def _mean(role: str, entry: MeanEntry, files: Sequence[Dbc], mistakes: Mistakes) -> RoleMap | None:
    key = f"signals.{role}.mean_of"
    if len(set(entry.mean_of)) < len(entry.mean_of):
        mistakes.errors.append(f"{key}: names a signal twice")
    parts = [
        _role(f"{role}.{number}", ROLES[role], _single(entry, signal), files, mistakes, key)
        for number, signal in enumerate(entry.mean_of, 1)
    ]
    known = tuple(part for part in parts if part is not None)
    mistakes.warnings.append(
        f"{role}: the mean of {len(known)} signals; the tyres' scale, 2 % or so, is in it until another speed confirms it"
    )
    return known[0]._replace(role=role, made="mean_of", parts=known) if known else None


def _role(
    role: str, definition: Role, entry: SignalEntry, files: Sequence[Dbc], mistakes: Mistakes, key: str = ""
) -> RoleMap | None:
    key = key or f"signals.{role}"
    message_name, dot, signal_name = entry.signal.partition(".")
    if not dot or not message_name or not signal_name:
        mistakes.errors.append(f'{key}: must be "MESSAGE.SIGNAL", not "{brief(entry.signal)}"')
        return None
    match = find_message(message_name, entry.bus, files, key)
    if isinstance(match, str):
        mistakes.errors.append(match)
        return None
    dbc, message = match
    signal = find_signal(signal_name, message, key)
    if isinstance(signal, str):
        mistakes.errors.append(signal)
        return None
    how = signal_map(entry, message, signal, definition, key, mistakes)
    if how is None:
        return None
    return RoleMap(
        full_scale=full_scale(entry, signal, how) if definition is ROLES["pedal"] else None,
        role=role,
        message=message.name,
        id=message.id,
        extended=message.extended,
        bus=entry.bus if entry.bus is not None else dbc.bus,
        unit=definition.unit,
        stale=entry.stale if entry.stale is not None else definition.stale,
        how=how,
        source=find_source(entry.source, message, dbc, key, mistakes),
    )


def _missing(driver: DriverSection, lead: LeadSection, signals: object) -> list[str]:
    """List what the task needs and the file does not map; wrong entries are reported elsewhere."""
    mapped = set(signals) if isinstance(signals, dict) else set()
    errors = []
    if driver.output not in OUTPUTS:
        hint = did_you_mean(driver.output, OUTPUTS)
        errors.append(f'driver.output: "{brief(driver.output)}" is not one of {", ".join(OUTPUTS)}{hint}')
    elif driver.output not in mapped:
        errors.append(f"signals.{driver.output}: is missing; driver.output names it")
    for role in (*NEEDS[driver.task], *(("lead_valid",) if driver.task == "car_following" else ())):
        if lead.tracks is not None and role in ("gap", "range_rate", "lead_valid"):
            if role in mapped:
                errors.append(f"signals.{role}: is given by lead.tracks already; remove one of the two")
        elif role not in mapped and role != "lead_valid":
            also = ", or radar tracks in [lead]" if role in ("gap", "range_rate") else ""
            errors.append(f"signals.{role}: is missing; {driver.task} needs it{also}")
    return errors


def _foreign_priors(driver: DriverSection, estimators: Mapping[str, Any]) -> list[str]:
    """Priors of inputs that the task does not have."""
    inputs = TASK_INPUTS[driver.task]
    return [
        f"{name}.prior.{channel}: {driver.task} has no such input; its inputs are {' and '.join(inputs)}"
        for name, settings in estimators.items()
        if (prior := getattr(settings, "prior", None)) is not None
        for channel in CHANNELS
        if channel not in inputs and getattr(prior, channel) is not None
    ]


def _messages(files: Sequence[Dbc], mapped: Sequence[RoleMap | TrackMap]) -> tuple[MessageMap, ...]:
    """List each message that carries something mapped, once per bus, in the order of the vehicle file."""
    by_key: dict[tuple[str, int | None, int | None], MessageMap] = {}
    for item in mapped:
        key = (item.message, item.bus, item.source)
        if key not in by_key:
            dbc_and_message = find_message(item.message, item.bus, files, "")
            assert not isinstance(dbc_and_message, str), "resolved before"
            by_key[key] = message_map(dbc_and_message[1], item.bus, item.source)
        # a signal that ends behind its message, as some DBC files have them
        needed = -(-max(how.bits.end for how in _signal_maps(item)) // 8)
        by_key[key] = by_key[key]._replace(length=max(by_key[key].length, needed))
    return tuple(by_key.values())


def _signal_maps(item: RoleMap | TrackMap) -> list[SignalMap]:
    if isinstance(item, RoleMap):
        return [item.how]
    parts = (item.distance, item.rate, item.lateral, item.valid, item.new, item.angle, item.number)
    return [part for part in parts if part is not None]
