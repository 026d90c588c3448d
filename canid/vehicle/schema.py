"""The vehicle file's sections as pydantic models, and their mistakes as sentences with a "did you mean"."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from canid.types import ArmaxSettings, Driver, FopdtSettings, Prior
from canid.vehicle.mapping import LeadConfig

_ARMAX, _FOPDT, _DRIVER, _LEAD = ArmaxSettings(), FopdtSettings(), Driver(), LeadConfig()
Bus = Annotated[int, Field(ge=0)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
# Below 0.5 a sample counts less than half as soon as the next one comes: no estimate would be left.
Forgetting = Annotated[float, Field(gt=0.5, le=1)]


class Section(BaseModel):
    """Common to all sections: no unknown key, no silent conversion (the text "3" is not the number 3)."""

    model_config = ConfigDict(extra="forbid", strict=True)


class DbcFile(Section):
    """One DBC file, and the bus that it describes."""

    file: str
    bus: Bus | None = None


class SignalEntry(Section):
    """Where one value comes from: `"MESSAGE.SIGNAL"`, or a table where the DBC is silent or wrong."""

    signal: str
    unit: str | None = None
    scale: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    offset: Annotated[float, Field(allow_inf_nan=False)] = 0.0
    bus: Bus | None = None
    # Low and high limit, in the unit of the signal.
    valid: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    stale: Positive | None = None
    invert: bool = False
    on: list[float] | None = None

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"signal": value} if isinstance(value, str) else value

    @field_validator("valid")
    @classmethod
    def _ordered(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError("the lower limit must come first, [low, high]")
        return value


class LeadSection(Section):
    """Radar tracks from which the lead is chosen, and the radar's noise."""

    tracks: str | None = None
    distance: SignalEntry | None = None
    rate: SignalEntry | None = None
    lateral: SignalEntry | None = None
    valid: SignalEntry | None = None
    new: SignalEntry | None = None
    bus: Bus | None = None
    rate_sign: Literal[1, -1] = 1
    in_path: Positive = _LEAD.in_path
    gap_noise: Positive = _LEAD.gap_noise
    range_rate_noise: Positive = _LEAD.range_rate_noise


class DriverSection(Section):
    """Whose answer is identified."""

    task: Literal["car_following", "lane_keeping"] = "car_following"
    output: str = _DRIVER.output
    headway_desired: Positive = _DRIVER.headway_desired


class ArmaxSection(Section):
    """Orders and memory of the ARMAX estimator."""

    na: Annotated[int, Field(ge=1, le=10)] = _ARMAX.na
    nb: Annotated[int, Field(ge=1, le=10)] = _ARMAX.nb
    nc: Annotated[int, Field(ge=0, le=10)] = _ARMAX.nc
    nk: Annotated[int, Field(ge=0, le=50)] = _ARMAX.nk
    start: Positive = _ARMAX.start
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

    tau: Positive | None = None
    tau_factor: Annotated[float, Field(gt=1.0, le=100.0)] | None = None
    dead_time: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    dead_time_sd: Positive | None = None
    same_tau: Positive | None = None
    same_dead_time: Positive | None = None

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

    window: Positive = _FOPDT.window
    refit: Positive = _FOPDT.refit
    tau_max: Positive = _FOPDT.tau_max
    dead_time_max: Positive = _FOPDT.dead_time_max
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
    by_lower = {other.lower(): other for other in words}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.5)
    return f' (did you mean "{by_lower[near[0]]}"?)' if near else ""


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
    try:
        return model.model_validate(value), []
    except ValidationError as error:
        return None, [_sentence(model, key, dict(mistake)) for mistake in error.errors(include_url=False)]


def _sentence(model: type[BaseModel], key: str, mistake: dict[str, Any]) -> str:
    path = [str(step) for step in mistake["loc"]]
    where = ".".join([key, *path])
    kind = mistake["type"]
    if kind == "extra_forbidden":
        # An entry of [lead] is itself a table with keys of its own.
        fields = SignalEntry.model_fields if len(path) > 1 else model.model_fields
        return f"{where}: unknown key{did_you_mean(path[-1], fields)}"
    if kind == "missing":
        return f"{where}: is missing"
    if kind == "literal_error":
        hint = did_you_mean(str(mistake["input"]), mistake["ctx"]["expected"].replace("'", "").split(" or "))
        return f"{where}: must be {mistake['ctx']['expected']}, not {mistake['input']!r}{hint}"
    if kind == "model_type":
        return f"{where}: must be a table or a text, not {mistake['input']!r}"
    says = mistake["msg"].removeprefix("Value error, ").replace("Input should be ", "must be ")
    return f"{where}: {says}, not {mistake['input']!r}"
