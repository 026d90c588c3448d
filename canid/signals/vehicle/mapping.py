"""Description of a vehicle, as read from its files: plain values without any DBC object."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal, NamedTuple

from canid.signals.dbc_text.parsing import Container
from canid.signals.vehicle.bits import Bits
from canid.values.roles import Kind
from canid.values.types import Driver, FullScale

# A multiplexed signal is in the frame only where each of these selectors holds one of these raw numbers.
Condition = tuple[tuple[Bits, frozenset[int]], ...]


class SignalMap(NamedTuple):
    """How one signal's raw number becomes a value: `raw * factor + offset`, in the role's unit."""

    signal: str
    bits: Bits
    factor: float
    offset: float
    low: float  # in the role's unit; outside [low, high]: not measured
    high: float
    kind: Kind
    when: Condition = ()
    no_value: Mapping[int, str] = {}  # raw number -> text of the value table that says "no value"
    on: frozenset[float] | None = None  # bool: these DBC values mean true; None: everything but 0
    invert: bool = False  # bool: true and false change places
    # J1939: raw numbers from which on it is reserved, an error, and not available
    reserved: tuple[int, int, int] | None = None
    elsewhere: tuple[SignalMap, ...] = ()  # the same signal on other pages


# how a role is made of others: the mean of several signals; headway times own speed; lead speed minus own speed
Made = Literal["", "mean_of", "headway", "lead_speed"]


class RoleMap(NamedTuple):
    """One role and where it comes from; of one that is made of others, the first of them."""

    role: str
    message: str
    id: int
    extended: bool
    bus: int | None  # None: the first bus on which the message is seen
    unit: str
    stale: float  # s; older than this is not measured any more
    how: SignalMap
    source: int | None = None  # J1939: address of the sender; None: the first that is seen
    made: Made = ""
    parts: tuple[RoleMap, ...] = ()  # of which it is made, each under a name of its own, "speed.1"

    @property
    def where(self) -> str:
        """The signals, with their messages' ids and the bus."""
        if self.parts:
            first, *others = (part.where for part in self.parts)
            says = {"mean_of": "mean of ", "headway": "", "lead_speed": "", "": ""}[self.made]
            joined = {"mean_of": ", ", "headway": " x ", "lead_speed": " - ", "": ""}[self.made]
            return says + joined.join([first, *others])
        bus = "" if self.bus is None else f", bus {self.bus}"
        return f"{self.message}.{self.signal} (0x{self.id:X}{bus})"

    @property
    def signal(self) -> str:
        """The signal's name in the DBC."""
        return self.how.signal

    @property
    def kind(self) -> Kind:
        """Number, bool or state."""
        return self.how.kind

    full_scale: FullScale | None = None  # of a pedal

    @property
    def switch(self) -> bool:
        """Whether it jumps (yes/no, gear): held between readings, never interpolated."""
        return self.how.kind != "number"

    @property
    def valid(self) -> tuple[float, float]:
        """Range in the role's unit; infinite where nothing limits it."""
        return self.how.low, self.how.high


def carried(roles: Iterable[RoleMap]) -> tuple[RoleMap, ...]:
    """What is read from frames: the roles, and the parts of those that are made, each once."""
    by_name: dict[str, RoleMap] = {}
    for role in roles:
        for part in carried(role.parts) if role.parts else (role,):
            by_name.setdefault(part.role, part)
    return tuple(by_name.values())


class TrackMap(NamedTuple):
    """One radar track: the signals of one message."""

    track: int
    message: str
    id: int
    extended: bool
    bus: int | None
    distance: SignalMap
    rate: SignalMap
    lateral: SignalMap | None
    valid: SignalMap | None
    new: SignalMap | None
    source: int | None = None
    angle: SignalMap | None = None  # rad, from the own axis; `distance` is then along the beam
    number: SignalMap | None = (
        None  # of a list of objects: which of them a report describes; else it is `track`
    )

    @property
    def has_side(self) -> bool:
        """Whether it says where the object is to the side."""
        return self.lateral is not None or self.angle is not None


class LeadConfig(NamedTuple):
    """How the vehicle ahead is found."""

    tracks: tuple[TrackMap, ...] | None = None  # None: the roles gap and range_rate give the lead
    # m; half a lane of 3.5 m: an object whose middle is nearer than this is in the own path.
    in_path: float = 1.8
    # Standard deviations of one radar report, as automotive 77 GHz long-range radars are specified.
    gap_noise: float | None = None  # m, standard deviation of one report; None: estimated from the reports
    range_rate_noise: float | None = None  # m/s
    stale: float | None = None  # s; a track's report that is older is not measured; None: the usual
    rate_from_gap: bool = False  # no range rate is sent: it is the derivative of the gap


class MessageMap(NamedTuple):
    """One message that carries mapped signals: what decoding must track and encoding must fill."""

    name: str
    id: int
    extended: bool
    bus: int | None
    length: int  # bytes
    period: float  # s; NaN: the DBC does not say
    counter: Bits | None  # a rolling counter, which shows that the sender is alive
    # (name, where, raw numbers that the DBC defines) of each multiplexer
    selectors: tuple[tuple[str, Bits, frozenset[int]], ...]
    protocol: str = ""  # "j1939": the frames of the id's parameter group, from one source
    source: int | None = None
    container: Container | None = None  # in which it comes, under the container's id


class Vehicle(NamedTuple):
    """A vehicle, read from its TOML and DBC files. Can be pickled."""

    name: str
    path: str
    dbc: tuple[str, ...]
    roles: Mapping[str, RoleMap]
    lead: LeadConfig
    messages: tuple[MessageMap, ...]
    driver: Driver
    estimators: Mapping[str, Any]  # name -> its settings
    warnings: tuple[str, ...]
