"""The vehicle file's sections as pydantic models, and their mistakes as sentences with a "did you mean"."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    create_model,
    field_validator,
    model_validator,
)

from canid.mathematics.estimators import ESTIMATORS
from canid.signals.vehicle.mapping import LeadConfig
from canid.signals.vehicle.quoting import brief, shown
from canid.values.bus_names import NamedBus
from canid.values.types import Driver

_DRIVER, _LEAD = Driver(), LeadConfig()

# Entries of a section. There are 25 roles; more keys than this are no vehicle file, and each would be one more mistake.
MAX_KEYS = 100
# characters of the vehicle's name; it stands in every view and result
MAX_NAME_LENGTH = 200
# names that "did you mean" compares: 30,000 of them would take a second for every mistake
_MAX_SIMILAR_NAMES = 500
# characters; longer names are not compared
_MAX_SIMILAR_LENGTH = 130


def _between(low: float, high: float) -> Any:
    return Field(ge=low, le=high, allow_inf_nan=False)


# the name of an interface, as Linux and candump have it
_BUS_NAME = re.compile(r"[A-Za-z][!-~]{0,254}")


def _named_bus(value: Any, number: ValidatorFunctionWrapHandler) -> Any:
    return NamedBus(value) if isinstance(value, str) and _BUS_NAME.fullmatch(value) else number(value)


# the number of a bus, as a log's columns hold it, or its name
Bus = Annotated[int, Field(ge=0, le=65535), WrapValidator(_named_bus)]
# of a J1939 sender: 0xFE is the address of none, 0xFF that of all
Source = Annotated[int, Field(ge=0, le=0xFD)]
# the longest path that Linux opens
File = Annotated[str, Field(max_length=4096)]
# a message's and a signal's name, each 128 characters at most in an extended DBC; a unit
Name = Annotated[str, Field(max_length=300)]
# Names of radar tracks, or of a signal in them, each of which may stand for several: TRACK_{0..15}. A radar follows some
# ten to a hundred objects.
MAX_TRACKS = 256
Names = Annotated[
    list[Name],
    Field(min_length=1, max_length=MAX_TRACKS),
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
]
# Of any unit of any role: larger numbers overflow when squared, or swamp all others.
Number = Annotated[float, _between(-1e12, 1e12)]
# s; from one frame of a fast bus to an hour, the longest for which anything is held
Age = Annotated[float, _between(1e-3, 3600.0)]
# Half a lane is 1.8 m, a parking place for a truck 5 m wide.
Width = Annotated[float, _between(0.1, 20.0)]
# m, m/s; standard deviations of a report, from a hundredth of a laser's to a blind radar's
Deviation = Annotated[float, _between(1e-3, 100.0)]
# s; a driver who keeps a minute is not following
Headway = Annotated[float, _between(0.01, 60.0)]


class Section(BaseModel):
    """Common to all sections: no unknown key, no silent conversion (the text "3" is not the number 3)."""

    model_config = ConfigDict(extra="forbid", strict=True)


class DbcFile(Section):
    """One DBC file, and the bus that it describes."""

    file: File
    bus: Bus | None = None
    # of its messages with 29-bit ids; None: what the file declares
    protocol: Literal["j1939", "can"] | None = None


class Options(Section):
    """What is said of a signal where the DBC is silent or wrong."""

    unit: Name | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    bus: Bus | None = None
    source: Source | None = None
    # Low and high limit, in the unit of the signal.
    valid: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    stale: Age | None = None

    @field_validator("scale")
    @classmethod
    def _not_nothing(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("makes every value the same")
        return value

    @field_validator("valid")
    @classmethod
    def _ordered(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError("the lower limit must come first, [low, high]")
        return value


class _Value(Options):
    """What a raw number means."""

    invert: bool = False
    # A state has 256 values at most: what is wider is a number.
    on: Annotated[list[Number], Field(min_length=1, max_length=256)] | None = None
    # of a pedal: what says that 100 % is its full travel, in words
    full_scale: Annotated[str, Field(min_length=1, max_length=200)] | None = None


class SignalEntry(_Value):
    """Where one value comes from: `"MESSAGE.SIGNAL"`, or a table."""

    signal: Name

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"signal": value} if isinstance(value, str) else value


class TrackEntry(_Value):
    """A signal of each radar track: a name, names, or a table."""

    signal: Names

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"signal": value} if isinstance(value, str | list) else value

    def of(self, name: str) -> SignalEntry:
        """The entry of one track, whose signal has this name."""
        return SignalEntry(**(dict(self) | {"signal": name}))


class MeanEntry(Options):
    """The mean of several signals of one unit, such as four wheel speeds: of those that agree."""

    # the wheels of a lorry with its trailer
    mean_of: Annotated[list[Name], Field(min_length=2, max_length=32)]


class HeadwayEntry(Options):
    """A gap that is sent as time headway: headway times own speed."""

    headway: Name


class LeadSpeedEntry(Options):
    """A range rate that is sent as the speed of the vehicle ahead: lead speed minus own speed."""

    lead_speed: Name


class DerivativeEntry(Section):
    """A range rate that nobody sends: the derivative of the gap."""

    derivative_of: Literal["gap"]


Entry = SignalEntry | MeanEntry | HeadwayEntry | LeadSpeedEntry | DerivativeEntry
# key of an entry -> what it is, and the roles that can be made so
MADE_ENTRIES: Mapping[str, tuple[type[Section], tuple[str, ...]]] = {
    "mean_of": (MeanEntry, ("speed", "wheel_speed")),
    "headway": (HeadwayEntry, ("gap",)),
    "lead_speed": (LeadSpeedEntry, ("range_rate",)),
    "derivative_of": (DerivativeEntry, ("range_rate",)),
}


def parse_entry(role: str, value: object, key: str) -> tuple[Entry | None, list[str]]:
    """Check an entry of [signals].

    Args:
        role: that it gives.
        value: what the TOML holds.
        key: where it stands in the file.

    Example:
        >>> parse_entry("gap", {"mean_of": ["A.B", "A.C"]}, "signals.gap")
        (None, ['signals.gap.mean_of: makes speed or wheel_speed, not gap'])
    """
    named = [name for name in MADE_ENTRIES if isinstance(value, dict) and name in value]
    if not named:
        return parse(SignalEntry, value, key)
    if len(named) > 1:
        return None, [f"{key}: {' and '.join(named)} exclude each other"]
    model, roles = MADE_ENTRIES[named[0]]
    if role not in roles:
        return None, [f"{key}.{named[0]}: makes {' or '.join(roles)}, not {brief(role)}"]
    entry, mistakes = parse(model, value, key)
    assert entry is None or isinstance(entry, Entry)
    return entry, mistakes


class LatencySection(Section):
    """How long after what it shows a radar's report comes."""

    # s; a report that is older than this is of another situation
    value: Annotated[float, Field(ge=0.0, le=2.0, allow_inf_nan=False)]
    sd: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)] = 0.0


class LeadSection(Section):
    """Radar tracks from which the lead is chosen, and the radar's noise."""

    tracks: Names | None = None
    distance: TrackEntry | None = None
    rate: TrackEntry | None = None
    lateral: TrackEntry | None = None
    angle: TrackEntry | None = None
    valid: TrackEntry | None = None
    new: TrackEntry | None = None
    id: TrackEntry | None = None
    bus: Bus | None = None
    source: Source | None = None
    rate_sign: Literal[1, -1] = 1
    in_path: Width = _LEAD.in_path
    gap_noise: Deviation | None = _LEAD.gap_noise
    range_rate_noise: Deviation | None = _LEAD.range_rate_noise
    latency: LatencySection | None = None


class FilterSection(Section):
    """How the output was smoothed before it was recorded."""

    kind: Literal["savitzky_golay", "moving_average", "first_order", "none"]
    # s; what is wider than this has smoothed the answer away
    width: Annotated[float, Field(ge=0.0, le=5.0, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _has_a_width(self) -> FilterSection:
        if (self.width == 0.0) != (self.kind == "none"):
            raise ValueError("needs a width in s, and only `none` has none")
        return self


class DriverSection(Section):
    """Whose answer is identified."""

    task: Literal["car_following", "lane_keeping"] = "car_following"
    output: Name = _DRIVER.output
    headway_desired: Headway = _DRIVER.headway_desired
    output_filter: FilterSection | None = None


@cache
def settings_section(kind: Any) -> type[Section]:
    """Make the section of a settings type: a NamedTuple whose fields have defaults and pydantic's constraints."""
    hints = get_type_hints(kind, include_extras=True)
    fields: dict[str, Any] = {
        name: (_nested(hints[name]), kind._field_defaults[name])
        for name in kind._fields
        if name not in (*DriverSection.model_fields, "latency")  # [driver] and [lead] state these
    }
    return create_model(kind.__name__, __base__=Section, __doc__=kind.__doc__, **fields)


def _nested(hint: Any) -> Any:
    """The same type hint, with settings types inside it as sections that give such settings."""
    if isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        return Annotated[settings_section(hint), AfterValidator(lambda section: hint(**dict(section)))]
    if get_origin(hint) is Annotated:
        inner, *constraints = get_args(hint)
        return Annotated[_nested(inner), *constraints]
    if get_origin(hint) in (Union, UnionType):
        return Union[*map(_nested, get_args(hint))]
    return hint


SECTIONS = ("name", "dbc", "signals", "lead", "driver", *(estimator.name for estimator in ESTIMATORS))
M = TypeVar("M", bound=BaseModel)


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """Make a hint in brackets, or nothing.

    Example:
        >>> did_you_mean("pedl", ["pedal", "speed"])
        ' (did you mean "pedal"?)'
        >>> did_you_mean("xyz", ["pedal", "speed"])
        ''
    """
    # Case is the commonest slip of all, so it does not count as a difference.
    if len(word) > _MAX_SIMILAR_LENGTH:
        return ""
    by_lower = {other.lower(): other for other in words}
    if len(by_lower) > _MAX_SIMILAR_NAMES:
        # the nearest in length, and of these the ones that begin alike
        start, length = word[:2].lower(), len(word)
        nearest = sorted(by_lower, key=lambda x: abs(len(x) - length) + 2 * (not x.startswith(start)))
        by_lower = {other: by_lower[other] for other in nearest[:_MAX_SIMILAR_NAMES]}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.5)
    return f' (did you mean "{brief(by_lower[near[0]])}"?)' if near else ""


def parse(model: type[M], value: object, key: str) -> tuple[M | None, list[str]]:
    """Check one section or entry.

    Args:
        model: what it should be.
        value: what the TOML holds.
        key: where it stands in the file.

    Returns:
        The checked value (None if it has mistakes) and the mistakes, each one line "key: what is wrong".

    Example:
        >>> parse(DriverSection, {"tsk": "car_following"}, "driver")
        (None, ['driver.tsk: unknown key (did you mean "task"?)'])
    """
    if isinstance(value, dict) and len(value) > MAX_KEYS:
        return None, [f"{key}: {len(value):,} keys; it has {len(model.model_fields)}"]
    try:
        return model.model_validate(value), []
    except ValidationError as error:
        return None, [_sentence(model, key, dict(mistake)) for mistake in error.errors(include_url=False)]


def parse_settings(kind: Any, value: object, key: str) -> tuple[Any, list[str]]:
    """Check the section that holds the settings of an estimator.

    Args:
        kind: of the settings, see `settings_section`.
        value: what the TOML holds.
        key: where it stands in the file.

    Returns:
        The settings (None if they have mistakes) and the mistakes, as `parse` gives them.

    Example:
        >>> from canid.mathematics.estimators.fopdt import FopdtSettings
        >>> parse_settings(FopdtSettings, {"window": 30}, "fopdt")[0].window
        30.0
        >>> parse_settings(FopdtSettings, {"windw": 30}, "fopdt")
        (None, ['fopdt.windw: unknown key (did you mean "window"?)'])
    """
    section, mistakes = parse(settings_section(kind), value, key)
    return (kind(**dict(section)) if section is not None else None), mistakes


def _inner(model: type[BaseModel], path: Sequence[str]) -> type[BaseModel]:
    """The section that a path leads to within another."""
    for step in path:
        field = model.model_fields.get(step)
        inner = _sections_in(field.annotation) if field is not None else []
        model = inner[0] if inner else model
    return model


def _sections_in(hint: Any) -> list[type[BaseModel]]:
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return [hint]
    return [section for part in get_args(hint) for section in _sections_in(part)]


def _sentence(model: type[BaseModel], key: str, mistake: dict[str, Any]) -> str:
    path = [str(step) for step in mistake["loc"]]
    where = ".".join([key, *map(brief, path)])
    kind = mistake["type"]
    if kind == "extra_forbidden":
        return f"{where}: unknown key{did_you_mean(path[-1], _inner(model, path[:-1]).model_fields)}"
    if kind == "missing":
        return f"{where}: is missing"
    if kind == "literal_error":
        hint = did_you_mean(str(mistake["input"]), mistake["ctx"]["expected"].replace("'", "").split(" or "))
        return f"{where}: must be {mistake['ctx']['expected']}, not {shown(mistake['input'])}{hint}"
    if kind == "model_type":
        return f"{where}: must be a table or a text, not {shown(mistake['input'])}"
    says = mistake["msg"].removeprefix("Value error, ").replace("Input should be ", "must be ")
    return f"{where}: {says}, not {shown(mistake['input'])}"
