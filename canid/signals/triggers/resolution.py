"""Resolution of trigger conditions against a vehicle: roles, signals of its DBC files, and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.signals.samples.sampler import sampled_roles
from canid.signals.triggers.conditions import And, Compared, Condition, Happened, Not, Or, events, mistake
from canid.signals.triggers.trigger import PIPELINE_EVENTS, RECORDER_EVENTS, Trigger
from canid.signals.vehicle import LeadConfig, RoleMap, Vehicle
from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.mapping import MessageMap, carried
from canid.signals.vehicle.named_signals import named_signal, names_of
from canid.signals.vehicle.quoting import brief, several
from canid.signals.vehicle.schema import did_you_mean
from canid.signals.vehicle.units import examples, factor_to
from canid.signals.vehicle.vehicle_file import read_databases
from canid.values.errors import ConfigError
from canid.values.roles import ROLES
from canid.values.types import Driver

# roles that canid makes of others, with their units: they come with the samples
MADE = {"gap": "m", "range_rate": "m/s", "lead_speed": "m/s", "lead_valid": "", "headway": "s"}
# names that a sentence lists
_MAX_NAMES = 12


class Names(NamedTuple):
    """Conditions whose numbers are in the unit of their signal, and where the signals come from."""

    texts: tuple[str, ...]
    conditions: tuple[Condition, ...]
    vehicle: Vehicle  # with the signals that are decoded as its only roles
    stale: Mapping[
        str, float
    ]  # signal that is decoded -> s after which its last value is not measured any more
    sampled: frozenset[str]  # roles that are taken from the samples
    needs_samples: bool  # or estimates, or events of the pipeline


def resolve(trigger: Trigger, vehicle: Vehicle) -> Names:
    """Find the signals that the conditions name.

    Raises:
        ConfigError: there is none of that name, a unit cannot be converted, or an event does not exist; all at once.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> names = resolve(Trigger(("speed > 36 km/h and EGO_SPEED.LongAccel < -2",)), read_vehicle("generic"))
        >>> sorted(names.stale), names.conditions[0].parts[0].value
        (['EGO_SPEED.LongAccel', 'speed'], 10.0)
    """
    signals = _Found(vehicle)
    wrong: list[str] = []
    conditions = []
    for text, condition in zip(trigger.conditions, trigger.parsed, strict=True):
        unknown = sorted(events(condition) - set(PIPELINE_EVENTS) - set(RECORDER_EVENTS))
        wrong += [f'--trigger "{brief(text)}": {_no_event(name)}' for name in unknown]
        conditions.append(_converted(condition, text, signals, wrong))
    if wrong:
        raise ConfigError(*dict.fromkeys(wrong))
    named = set().union(*(events(parsed) for parsed in trigger.parsed)) & set(PIPELINE_EVENTS)
    return Names(
        trigger.conditions,
        tuple(conditions),
        vehicle._replace(
            roles=signals.roles, messages=tuple(signals.messages), lead=LeadConfig(), driver=Driver()
        ),
        {name: role.stale for name, role in signals.roles.items()},
        frozenset(signals.sampled),
        bool(signals.sampled or named or any(map(_asks_monitor, conditions))),
    )


def _no_event(name: str) -> str:
    known = (*PIPELINE_EVENTS, *RECORDER_EVENTS)
    return f'no event "{brief(name)}"{did_you_mean(name, known)}; there are {", ".join(known)}'


def _asks_monitor(condition: Condition) -> bool:
    if isinstance(condition, Compared | Happened):
        return False
    if isinstance(condition, Not):
        return _asks_monitor(condition.of)
    return not isinstance(condition, And | Or) or any(map(_asks_monitor, condition.parts))


class _Found:
    """Signals that were found so far; the DBC files are read when they are first needed."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.roles: dict[str, RoleMap] = {}
        self.messages: list[MessageMap] = []
        self.sampled: set[str] = set()
        self.why = ""  # there is no signal of the name that was asked for last
        self._files: list[Dbc] | None = None
        following = vehicle.driver.task == "car_following"
        self._made = ({*sampled_roles(vehicle), "headway"} & set(MADE) if following else set()) - set(
            vehicle.roles
        )

    def unit(self, name: str) -> str | None:
        """The unit of a signal, which is noted; None: there is none of that name, see `why`."""
        mapped = self.roles.get(name)
        if mapped is None and name in self.vehicle.roles:
            mapped = self.vehicle.roles[name]
            for part in carried((mapped,)):
                key = (part.message, part.bus)
                self._add(name, mapped, next(m for m in self.vehicle.messages if (m.name, m.bus) == key))
        elif mapped is None and name in self._made:
            self.sampled.add(name)
            return MADE[name]
        elif mapped is None:
            signal = named_signal(name, self._databases()) if "." in name else self._no_role(name)
            if isinstance(signal, str):
                self.why = signal
                return None
            mapped = signal.role
            self._add(name, mapped, signal.message)
        return mapped.unit

    def _add(self, name: str, role: RoleMap, message: MessageMap) -> None:
        self.roles[name] = role._replace(role=name)
        same = [
            k
            for k, other in enumerate(self.messages)
            if (other.name, other.bus) == (message.name, message.bus)
        ]
        if same:
            other = self.messages[same[0]]
            self.messages[same[0]] = other._replace(length=max(other.length, message.length))
        else:
            self.messages.append(message)

    def _databases(self) -> list[Dbc]:
        if self._files is None:
            self._files = read_databases(self.vehicle.path)
        return self._files

    def _no_role(self, name: str) -> str:
        known = [*self.vehicle.roles, *sorted(self._made)]
        more = names_of(self._databases())
        what = f'the vehicle file maps no "{name}"' if name in ROLES else f'no role "{brief(name)}"'
        ends = [full for full in more if full.partition(".")[2].lower() == name.lower()]
        if ends:
            close = f' (did you mean "{brief(ends[0])}"?)'
        else:
            close = did_you_mean(name, [*known, "misfit", "mark"]) or did_you_mean(name, more)
        maps = f"it maps {several(known, _MAX_NAMES)}"
        return f"{what}{close}; {maps}; and MESSAGE.SIGNAL of its DBC, such as {several(more, 2)}"


def _converted(condition: Condition, text: str, signals: _Found, wrong: list[str]) -> Condition:
    """The same condition with numbers in the unit of their signal; what is wrong is noted."""
    if isinstance(condition, Not):
        return Not(_converted(condition.of, text, signals, wrong))
    if isinstance(condition, And | Or):
        return type(condition)(tuple(_converted(part, text, signals, wrong) for part in condition.parts))
    if not isinstance(condition, Compared):
        return condition
    unit = signals.unit(condition.name)
    if unit is None:
        wrong.append(str(mistake(text, condition.column, signals.why)))
        return condition
    if not condition.operator and not _is_switch(condition.name, signals):
        says = f'"{condition.name}" is a number, not yes or no; compare it: {condition.name} > 0'
        wrong.append(str(mistake(text, condition.column, says)))
    if not condition.unit:
        return condition
    factor = factor_to(condition.unit, unit)
    if factor is None:
        has = f"{condition.name} is in {brief(unit)}" if unit else f"{condition.name} has no unit"
        known = f"; write one of {examples(unit)}, or none" if unit and examples(unit) else "; leave it out"
        says = f'"{brief(condition.unit)}" cannot be converted: {has}{known}'
        wrong.append(str(mistake(text, condition.unit_column, says)))
        return condition
    return condition._replace(value=condition.value * factor, unit=unit)


def _is_switch(name: str, signals: _Found) -> bool:
    how = signals.vehicle.roles.get(name)
    return name == "lead_valid" or (how is not None and how.kind == "bool")
