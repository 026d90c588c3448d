"""The vehicle file's sections as pydantic models, and their mistakes as sentences with a "did you mean"."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from canid.types import ArmaxSettings, Driver, FopdtSettings, Prior
from canid.vehicle.mapping import LeadConfig
from canid.vehicle.quoting import brief, shown

_ARMAX, _FOPDT, _DRIVER, _LEAD = ArmaxSettings(), FopdtSettings(), Driver(), LeadConfig()

# Entries of a section. There are 23 roles; more keys than this are no vehicle file, and each would be one more mistake.
MOST_KEYS = 100
# characters of the vehicle's name; it stands in every view and result
LONGEST_NAME = 200
# Names among which "did you mean" looks: 30,000 of them would take a second for every mistake.
_MOST_SIMILAR = 500
# characters; nobody has mistyped a longer name
_LONGEST_SIMILAR = 130


def _between(low: float, high: float) -> Any:
    return Field(ge=low, le=high, allow_inf_nan=False)


# the number of a bus, as a log's columns hold it
Bus = Annotated[int, Field(ge=0, le=65535)]
# the longest path that Linux opens
File = Annotated[str, Field(max_length=4096)]
# a message's and a signal's name, each 128 characters at most in an extended DBC; a unit
Name = Annotated[str, Field(max_length=300)]
# Of any unit of any role: what is further out overflows once it is squared, or is lost beside it.
Number = Annotated[float, _between(-1e12, 1e12)]
# s; from one frame of a fast bus to an hour, the longest for which anything is held
Age = Annotated[float, _between(1e-3, 3600.0)]
# Half a lane is 1.8 m, a parking place for a truck 5 m wide.
Width = Annotated[float, _between(0.1, 20.0)]
# m, m/s; standard deviations of a report, from a hundredth of a laser's to a blind radar's
Deviation = Annotated[float, _between(1e-3, 100.0)]
# s; a driver who keeps a minute is not following
Headway = Annotated[float, _between(0.01, 60.0)]
# s of data: the windows' rows are kept in memory and fitted twice a second
Stretch = Annotated[float, _between(1.0, 600.0)]
# s; what is refitted more often than the grid's step is not refitted more often
Pace = Annotated[float, _between(0.05, 600.0)]
# s; the grid's step is the shortest lag that it can show, and what takes longer than 20 s is no reaction
Lag = Annotated[float, _between(0.15, 20.0)]
# s; of beliefs about lags and dead times: from exact to indifferent
Belief = Annotated[float, _between(1e-3, 100.0)]
# Below 0.5 a sample counts less than half as soon as the next one comes: no estimate would be left.
Forgetting = Annotated[float, Field(gt=0.5, le=1, allow_inf_nan=False)]


class Section(BaseModel):
    """Common to all sections: no unknown key, no silent conversion (the text "3" is not the number 3)."""

    model_config = ConfigDict(extra="forbid", strict=True)


class DbcFile(Section):
    """One DBC file, and the bus that it describes."""

    file: File
    bus: Bus | None = None


class SignalEntry(Section):
    """Where one value comes from: `"MESSAGE.SIGNAL"`, or a table where the DBC is silent or wrong."""

    signal: Name
    unit: Name | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    bus: Bus | None = None
    # Low and high limit, in the unit of the signal.
    valid: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    stale: Age | None = None
    invert: bool = False
    # A state has 256 values at most: what is wider is a number.
    on: Annotated[list[Number], Field(min_length=1, max_length=256)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"signal": value} if isinstance(value, str) else value

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


class LeadSection(Section):
    """Radar tracks from which the lead is chosen, and the radar's noise."""

    tracks: Name | None = None
    distance: SignalEntry | None = None
    rate: SignalEntry | None = None
    lateral: SignalEntry | None = None
    valid: SignalEntry | None = None
    new: SignalEntry | None = None
    bus: Bus | None = None
    rate_sign: Literal[1, -1] = 1
    in_path: Width = _LEAD.in_path
    gap_noise: Deviation = _LEAD.gap_noise
    range_rate_noise: Deviation = _LEAD.range_rate_noise


class DriverSection(Section):
    """Whose answer is identified."""

    task: Literal["car_following", "lane_keeping"] = "car_following"
    output: Name = _DRIVER.output
    headway_desired: Headway = _DRIVER.headway_desired


class ArmaxSection(Section):
    """Orders and memory of the ARMAX estimator."""

    na: Annotated[int, Field(ge=1, le=10)] = _ARMAX.na
    nb: Annotated[int, Field(ge=1, le=10)] = _ARMAX.nb
    nc: Annotated[int, Field(ge=0, le=10)] = _ARMAX.nc
    nk: Annotated[int, Field(ge=0, le=50)] = _ARMAX.nk
    start: Stretch = _ARMAX.start
    # One number, or several memories at once.
    forgetting: Annotated[tuple[Forgetting, ...], Field(min_length=1, max_length=8)] = _ARMAX.forgetting

    @field_validator("forgetting", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return (
            tuple(value) if isinstance(value, list) else (value,) if isinstance(value, int | float) else value
        )

    @field_validator("forgetting")
    @classmethod
    def _ascending(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if list(value) != sorted(set(value)):
            raise ValueError("must ascend, the longest memory last")
        return value


class PriorSection(Section):
    """What is believed of lags and dead times before any data."""

    tau: Belief | None = None
    tau_factor: Annotated[float, Field(ge=1.001, le=100.0)] | None = None
    dead_time: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    dead_time_sd: Belief | None = None
    same_tau: Belief | None = None
    same_dead_time: Belief | None = None

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        for a, b in (("tau", "tau_factor"), ("dead_time", "dead_time_sd")):
            if (getattr(self, a) is None) != (getattr(self, b) is None):
                raise ValueError(f"{a} and {b} belong together: give both or neither")
        if all(value is None for value in self.model_dump().values()):
            raise ValueError("is empty: state a belief, or leave the section out")
        return self


class FopdtSection(Section):
    """Window and box of the FOPDT estimator."""

    window: Stretch = _FOPDT.window
    refit: Pace = _FOPDT.refit
    tau_max: Lag = _FOPDT.tau_max
    dead_time_max: Lag = _FOPDT.dead_time_max
    prior: PriorSection | None = None

    def settings(self) -> FopdtSettings:
        """Return them as the estimator takes them."""
        plain = self.model_dump(exclude={"prior"})
        if self.prior is not None:
            plain["prior"] = Prior(**self.prior.model_dump(exclude_none=True))
        return FopdtSettings(**plain)


SECTIONS = ("name", "dbc", "signals", "lead", "driver", "armax", "fopdt")
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
    if len(word) > _LONGEST_SIMILAR:
        return ""
    by_lower = {other.lower(): other for other in words}
    if len(by_lower) > _MOST_SIMILAR:
        # the nearest in length, and of these the ones that begin alike
        start, length = word[:2].lower(), len(word)
        nearest = sorted(by_lower, key=lambda x: abs(len(x) - length) + 2 * (not x.startswith(start)))
        by_lower = {other: by_lower[other] for other in nearest[:_MOST_SIMILAR]}
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
    if isinstance(value, dict) and len(value) > MOST_KEYS:
        return None, [f"{key}: {len(value):,} keys; it has {len(model.model_fields)}"]
    try:
        return model.model_validate(value), []
    except ValidationError as error:
        return None, [_sentence(model, key, dict(mistake)) for mistake in error.errors(include_url=False)]


def _sentence(model: type[BaseModel], key: str, mistake: dict[str, Any]) -> str:
    path = [str(step) for step in mistake["loc"]]
    where = ".".join([key, *map(brief, path)])
    kind = mistake["type"]
    if kind == "extra_forbidden":
        # An entry of [lead] is itself a table with keys of its own.
        fields = SignalEntry.model_fields if len(path) > 1 else model.model_fields
        return f"{where}: unknown key{did_you_mean(path[-1], fields)}"
    if kind == "missing":
        return f"{where}: is missing"
    if kind == "literal_error":
        hint = did_you_mean(str(mistake["input"]), mistake["ctx"]["expected"].replace("'", "").split(" or "))
        return f"{where}: must be {mistake['ctx']['expected']}, not {shown(mistake['input'])}{hint}"
    if kind == "model_type":
        return f"{where}: must be a table or a text, not {shown(mistake['input'])}"
    says = mistake["msg"].removeprefix("Value error, ").replace("Input should be ", "must be ")
    return f"{where}: {says}, not {shown(mistake['input'])}"
