"""Which column of a table is which role: by a column map, or by the headings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from canid.analysis.tables import column_map
from canid.analysis.tables.column_map import ColumnEntry, ColumnMap
from canid.analysis.tables.heading_readings import readings
from canid.analysis.tables.heading_words import says_accelerator
from canid.analysis.tables.headings import (
    ALIASES,
    CLOCKS,
    DATED,
    EXTRA,
    HEADWAY,
    TIME,
    Heading,
    closing,
    in_words,
    parsed_without_path,
    role_of,
)
from canid.analysis.tables.remedies import COMMAND_LINE, Remedies
from canid.analysis.tables.source import Source, number
from canid.signals.vehicle.quoting import brief, several
from canid.signals.vehicle.schema import did_you_mean
from canid.signals.vehicle.units import unit_of
from canid.values.errors import ConfigError
from canid.values.roles import ROLES

# columns that are needed to follow a vehicle, apart from own speed and output: one of each line
LEAD_DISTANCE = ("gap", "spacing", HEADWAY, "position")
LEAD_MOTION = ("range_rate", "lead_speed", "lead_id", "lane", "lead_position")

# roles that no estimate is made of: of several columns one is taken
_REDUNDANT = ("gnss_speed", "wheel_speed", "altitude", "lat", "lon")
# columns that a message names
MAX_DESCRIBED = 8
# of several columns with the same heading, one
_EQUAL = re.compile(r"(.+?) ?#(\d{1,4})")


class Found(NamedTuple):
    """A role's column."""

    place: int
    entry: ColumnEntry
    unit: str | None  # stated by the map or the heading; None: nowhere
    sign_place: int = -1  # of `sign_of`
    closing: bool = False  # the range rate with the other sign
    parts: tuple[
        tuple[str, int], ...
    ] = ()  # what stands before times in columns of its own, see `date_column.joined`
    points: tuple[int, ...] = ()  # of `between`: x, y, x, y
    rest: tuple[int, int] | None = None  # of whole seconds: the column of the rest, how many are a second

    @property
    def places(self) -> tuple[int, ...]:
        """All columns that it is made of."""
        measured = self.points or (self.place,)
        others = (self.sign_place, *(place for _, place in self.parts), *(self.rest or ())[:1])
        return (*measured, *(place for place in others if place >= 0))


class Resolved(NamedTuple):
    """The columns of a table."""

    found: Mapping[str, Found]
    map: ColumnMap
    notes: tuple[str, ...] = ()  # what was judged or taken for granted
    numbers: tuple[int, ...] = ()  # of the vehicles, where columns are numbered by them


def resolve(
    headings: Sequence[str],
    by: ColumnMap,
    name: str,
    number: int | None = None,
    says: Remedies = COMMAND_LINE,
    source: Source | None = None,
) -> Resolved:
    """Find the columns.

    Args:
        headings: of the table.
        by: the column map; an empty one: by the headings.
        name: of the table, for messages.
        number: of the vehicle, where columns are numbered.
        says: what the user can do, for messages.
        source: of the columns, by which a heading is judged that has several meanings; None: none is.

    Raises:
        ConfigError: two columns could be the same role, or a column of the map is not there.

    Example:
        >>> columns = resolve(["t", "v_ego [km/h]", "gap"], ColumnMap(), "x.csv").found
        >>> {role: (column.place, column.unit) for role, column in columns.items()}
        {'time': (0, None), 'speed': (1, 'km/h'), 'gap': (2, None)}
    """
    parsed = parsed_without_path(headings)
    if by.entries:
        return _by_map(parsed, by, name, number, says)
    by_name, notes = _by_heading(parsed, name, says, source)
    notes += _units_taken(by_name) if source is not None and says is COMMAND_LINE else []
    made = Resolved(by_name, by, tuple(f"{name}: {note}" for note in notes))
    usual = {role: column for role, column in by_name.items() if not in_words(parsed[column.place])}
    if _follows(usual) or by.driver is not None:
        return made
    for title in column_map.shipped():
        candidate = column_map.read_map(title)
        numbers = _numbers(parsed, candidate) if candidate.numbered else ()
        if candidate.numbered and not numbers:
            continue
        other = _entries(parsed, candidate, number or (numbers[0] if numbers else None))
        timed = TIME in other or (candidate.entries[TIME].rate is not None and not candidate.header)
        if timed and _follows(other) and len(other) > len(usual) - (TIME in usual):
            resolved = _by_map(parsed, candidate, name, number, says)
            return resolved._replace(notes=(f"{name}: read as {candidate.name} (--columns {title})",))
    return made


def _follows(by_role: Mapping[str, Found]) -> bool:
    own_motion = "speed" in by_role or "position" in by_role
    centres = "east" in by_role and by_role["east"].entry.center
    distance = centres or any(x in by_role for x in LEAD_DISTANCE)
    return own_motion and distance and any(x in by_role for x in LEAD_MOTION)


def _by_heading(
    parsed: Sequence[Heading], name: str, says: Remedies, source: Source | None
) -> tuple[dict[str, Found], list[str]]:
    """The columns by their headings, and what was judged."""
    read = readings(parsed, source, says)
    notes = list(read.notes)
    candidates: dict[str, list[int]] = {}
    for place, role in read.roles.items():
        candidates.setdefault(role, []).append(place)
    by_role = {}
    for role, places in candidates.items():
        exact = [place for place in places if parsed[place].name == role]
        # usual names come before what is understood by its words
        places = [place for place in places if not in_words(parsed[place])] or places
        if role == TIME:
            places = _finest(places, source)
            exact = [place for place in exact if place in places]
        if role == TIME:
            places = [place for place in places if parsed[place].name not in CLOCKS] or places
        if role == TIME and not exact:
            places = _times(places, parsed, source)
        chosen = exact or places
        any_will_do = (
            (role == TIME and not _differ(chosen, parsed, source))
            or role in _REDUNDANT
            or _same_quantity([parsed[place] for place in chosen])
        )
        if len(chosen) > 1 and any_will_do:
            if role != TIME:
                chosen = sorted(chosen, key=lambda place: not _is_base(parsed[place]))
            first, *others = [brief(named_apart(place, parsed)) for place in chosen]
            notes.append(f"{role}: taken from {first}; there is {several(others)} as well")
            chosen = chosen[:1]
        if len(chosen) > 1 and role == "episode":
            continue  # a drive is what they say together
        if len(chosen) > 1:
            same = [named_apart(place, parsed) for place in chosen]
            raise ConfigError(
                f"{name}: {role} could be {several(same)}; name the one that is meant: "
                f"{says.column(role, brief(same[0]))}"
            )
        place = chosen[0]
        entry = ColumnEntry.model_validate(parsed[place].text)
        by_role[role] = Found(
            place, entry, parsed[place].unit, closing=closing(parsed[place]) or place in read.closing
        )
    if source is not None and "speed" not in by_role and "gnss_speed" in by_role:
        by_role["speed"] = by_role.pop("gnss_speed")
        notes.append("speed: the one by satellite, since there is no other")
    if "pedal" not in by_role:
        texts = [brief(x.text.strip()) for x in parsed if role_of(x) is None and says_accelerator(x.name)]
        notes.extend(
            f"{text}: not used, since it may be no pedal in %; where it is: {says.column('pedal', text)}"
            for text in texts[:MAX_DESCRIBED]
        )
    return by_role, notes


def _units_taken(by_role: Mapping[str, Found]) -> list[str]:
    """A sentence on columns that state no unit, of those that people write in several.

    >>> _units_taken(resolve(["t", "speed", "gap [m]", "v_rel"], ColumnMap(), "x.csv").found)
    ['no unit is stated for speed, range_rate: taken in m/s']
    """
    out = []
    for unit, roles in (("m/s", ("speed", "lead_speed", "range_rate")), ("m", ("gap",)), ("%", ("pedal",))):
        missing = [role for role in roles if role in by_role and by_role[role].unit is None]
        out += [f"{', '.join(missing)}: taken in {unit}"] if missing else []
    return [f"no unit is stated for {'; for '.join(out)}"] if out else []


def _times(places: Sequence[int], parsed: Sequence[Heading], source: Source | None) -> list[int]:
    """Columns that may hold the times, the best first: those that advance, not dates, in the order of `ALIASES`."""
    sample = source.sample() if source is not None and len(places) > 1 else []
    advance = [place for place in places if not sample or len({*sample[place]}) > 1] or list(places)
    undated = [place for place in advance if parsed[place].name not in DATED] or advance
    usual = (*ALIASES[TIME], *(parsed[place].name for place in undated))
    return sorted(undated, key=lambda place: usual.index(parsed[place].name))


def _finest(places: Sequence[int], source: Source | None) -> list[int]:
    """The columns of times without those that repeat their values where another one counts on."""
    sample = source.sample() if source is not None and len(places) > 1 else []
    counts = {place: len({*sample[place]}) for place in places if sample}
    on = [k for k in counts if 0 < len(sample[k]) == counts[k] and sorted(sample[k], key=number) == sample[k]]
    return [place for place in places if not on or 2 * counts[place] > len(sample[place])]


def _differ(places: Sequence[int], parsed: Sequence[Heading], source: Source | None) -> bool:
    """Whether columns have the same heading and other values."""
    sample = source.sample() if source is not None else []
    equal = len({parsed[place].text.strip() for place in places}) == 1
    return bool(sample) and equal and any(sample[place] != sample[places[0]] for place in places)


def _same_quantity(columns: Sequence[Heading]) -> bool:
    """Whether columns of one name differ in their units alone."""
    units = [unit_of(column.unit or "") for column in columns]
    dimensions = {unit.dimension for unit in units if unit is not None}
    different = len({column.unit for column in columns}) == len(columns)
    return different and None not in units and len(dimensions) == 1 and len({x.name for x in columns}) == 1


def _is_base(column: Heading) -> bool:
    unit = unit_of(column.unit or "")
    return unit is not None and unit.factor == 1.0


def place_of(wanted: str, parsed: Sequence[Heading]) -> int:
    """The place of a column; −1: there is none. Its text, or the text without the unit, in any case.

    Example:
        >>> from canid.analysis.tables.headings import heading
        >>> place_of("v", [heading("t"), heading("V [km/h]")])
        1
        >>> place_of("v #2", [heading("v"), heading("v")])
        1
    """
    plain = wanted.strip()
    if (equal := _EQUAL.fullmatch(plain)) is not None:
        places = _equal(equal[1], parsed)
        if len(places) > 1:
            return places[int(equal[2]) - 1] if 0 < int(equal[2]) <= len(places) else -1
    texts = [column.text.strip() for column in parsed]
    lower = [text.lower() for text in texts]
    bare = [re.split(r"\s*[\[(]", text)[0] for text in lower]
    for names, name in ((texts, plain), (lower, plain.lower()), (bare, plain.lower())):
        if name in names:
            return names.index(name)
    return -1


def _equal(text: str, parsed: Sequence[Heading]) -> list[int]:
    """The places of the columns with this heading."""
    return [place for place, column in enumerate(parsed) if column.text.strip() == text]


def named_apart(place: int, parsed: Sequence[Heading]) -> str:
    """A column's heading, with its number where others have the same.

    Example:
        >>> from canid.analysis.tables.headings import heading
        >>> [named_apart(k, [heading("t"), heading("v"), heading("v")]) for k in range(3)]
        ['t', 'v #1', 'v #2']
    """
    text = parsed[place].text.strip()
    equal = _equal(text, parsed)
    return f"{text} #{equal.index(place) + 1}" if len(equal) > 1 else text


def _filled(name: str, number: int | None) -> str:
    """A column's name for one vehicle: "Speed{n-1}" is "Speed1" of vehicle 2."""
    if number is None:
        return name
    return (
        name.replace("{n}", str(number)).replace("{n-1}", str(number - 1)).replace("{n+1}", str(number + 1))
    )


def _entries(parsed: Sequence[Heading], by: ColumnMap, number: int | None) -> dict[str, Found]:
    by_role = {}
    for role, entry in by.entries.items():
        places = [place for name in entry.names if (place := place_of(_filled(name, number), parsed)) >= 0]
        if places:
            sign = place_of(_filled(entry.sign_of, number), parsed) if entry.sign_of else -1
            unit = entry.unit if entry.unit is not None else parsed[places[0]].unit
            by_role[role] = Found(places[0], entry, unit, sign)
            continue
        points = tuple(place_of(name, parsed) for name in entry.between or ())
        if points and min(points) >= 0:
            by_role[role] = Found(points[0], entry, entry.unit or parsed[points[0]].unit, points=points)
    return by_role


def _numbers(parsed: Sequence[Heading], by: ColumnMap) -> tuple[int, ...]:
    """Numbers of the vehicles whose own speed and gap are there."""
    needed = [entry for role, entry in by.entries.items() if role in ("speed", "gap", "lead_speed")]
    texts = " ".join(column.text for column in parsed)
    candidates = sorted({int(digits) for digits in re.findall(r"(\d{1,3})\b", texts)})
    return tuple(
        n
        for n in candidates
        if all(any(place_of(_filled(x, n), parsed) >= 0 for x in entry.names) for entry in needed)
    )


def _by_map(
    parsed: Sequence[Heading], by: ColumnMap, name: str, number: int | None, says: Remedies
) -> Resolved:
    numbers = _numbers(parsed, by) if by.numbered else ()
    if by.numbered and number is None:
        if len(numbers) > 1:
            listed = ", ".join(map(str, numbers))
            raise ConfigError(
                f"{name}: holds several vehicles that follow: {says.vehicle.removesuffix(' ID')}: {listed}"
            )
        number = numbers[0] if numbers else 2
    if by.numbered and number not in numbers:
        listed = ", ".join(map(str, numbers)) or "none"
        raise ConfigError(
            f"{name}: no vehicle {number} follows in it (with own speed, gap and lead speed): {listed}"
        )
    by_role = _entries(parsed, by, number)
    for role, column in by_role.items():
        equal = [named_apart(place, parsed) for place in _equal(column.entry.names[0].strip(), parsed)]
        if len(equal) > 1:
            raise ConfigError(
                f"{name}: {role}: several columns are called {brief(column.entry.names[0])}: name the one that is meant "
                f"{' or '.join(map(brief, equal[:MAX_DESCRIBED]))}"
            )
    for role, entry in by.entries.items():
        if entry.sign_of and role in by_role and by_role[role].sign_place < 0:
            raise ConfigError(f"{name}: no column {brief(entry.sign_of)}, of which {role} has the sign")
    if not by.path.startswith(str(column_map.SETS)):
        texts = [column.text.strip() for column in parsed]
        for role, entry in by.entries.items():
            if role not in by_role and not (role == TIME and entry.rate is not None):
                wanted = _filled(entry.names[0], number)
                raise ConfigError(
                    f"{name}: no column {brief(wanted)} for {role}{did_you_mean(wanted, texts)}; it has {several(texts, 12)}"
                )
    return Resolved(by_role, by, numbers=numbers)


def described(by_role: Mapping[str, Found], headings: Sequence[str]) -> str:
    """The columns that were found, in words.

    Example:
        >>> described(resolve(["t", "gap"], ColumnMap(), "x").found, ["t", "gap"])
        'time = t, gap = gap'
    """
    known = list(dict.fromkeys(role for role in (TIME, *ROLES, *EXTRA) if role in by_role))
    shown = [f"{role} = {_named(headings, by_role[role])}" for role in known[:MAX_DESCRIBED]]
    more = [f"and {len(known) - MAX_DESCRIBED} more"] if len(known) > MAX_DESCRIBED else []
    return ", ".join([*shown, *more])


def _named(headings: Sequence[str], column: Found) -> str:
    places = (*(place for _, place in column.parts), column.place, *(column.rest or ())[:1])
    return " + ".join(
        brief(headings[place].strip()) or "the column without a name" for place in places if place >= 0
    )
