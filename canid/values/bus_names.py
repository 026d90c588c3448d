"""Interfaces by name as buses by number: one rule for logs, for live and for vehicle files.

Buses count from 0. The digits at the end of the name are the number (can0: 0, can1: 1, vcan3: 3). A name without digits,
or whose number another name has that comes before it in the alphabet, gets the next number above all of these, in the
order of the names. So the number of a bus does not depend on which interface speaks first.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from zlib import crc32

from canid.values.terminal_text import terminal_text

# a bus is two bytes wide in columns, and 0xFFFF, which as a channel is 0x10000, fits no .blf
MAX_BUSES = 0xFFFF
# the last part of an address (239.0.0.7, localhost:8080), or of several channels in one (0,1), is no number
_END = re.compile(r"((?:.*[^\d.,:/])?)(\d+)")
# digits of a number: more are no bus
_MAX_DIGITS = 5
# interfaces that are listed by name: a vehicle has ten
_MAX_SHOWN = 16


def number_of(name: str) -> int | None:
    """The number at the end of a name; None: there is none that is a bus.

    >>> number_of("can1"), number_of("0"), number_of("powertrain"), number_of("can99999"), number_of("239.0.0.7")
    (1, 0, None, None, None)
    """
    match = _END.fullmatch(name)
    if match is None or len(match[2].lstrip("0")) > _MAX_DIGITS:
        return None
    number = int(match[2])
    return number if number < MAX_BUSES else None


def bus_numbers(names: Iterable[str]) -> dict[str, int]:
    """The number of each interface, whatever the order of the names.

    >>> bus_numbers(["can1", "can0"]), bus_numbers(["can1"])
    ({'can0': 0, 'can1': 1}, {'can1': 1})
    >>> bus_numbers(["vcan0", "can10", "can0", "can2"])
    {'can0': 0, 'can2': 2, 'can10': 10, 'vcan0': 11}
    >>> bus_numbers(["powertrain", "body"])
    {'body': 0, 'powertrain': 1}
    """
    ordered = sorted(set(names), key=_natural)
    numbers: dict[str, int] = {}
    taken: set[int] = set()
    rest = []
    for name in ordered:
        number = number_of(name)
        if number is None or number in taken:
            rest.append(name)
        else:
            numbers[name] = number
            taken.add(number)
    return with_more(numbers, rest)


def of_open_buses(channels: Sequence[str]) -> list[int]:
    """The number of each open bus, by the rule of `bus_numbers`; a channel that comes twice is on two devices: two buses.

    >>> of_open_buses(["can1", "can0"]), of_open_buses(["can2"]), of_open_buses(["239.0.0.7"]), of_open_buses(["0", "0"])
    ([1, 0], [2], [0], [0, 1])
    """
    names = [f"{each} of device {k} " if each in channels[:k] else each for k, each in enumerate(channels)]
    numbers = bus_numbers(names)
    return [numbers[name] for name in names]


def with_more(numbers: Mapping[str, int], names: Iterable[str]) -> dict[str, int]:
    """Number further interfaces, each above all others; where that is no bus, with the first that is free.

    >>> with_more({"can1": 1}, ["slcan", "vcan"])
    {'can1': 1, 'slcan': 2, 'vcan': 3}
    """
    extended = dict(numbers)
    taken = set(extended.values())
    above = max(taken, default=-1) + 1
    for name in names:
        number = above if above < MAX_BUSES else next(k for k in range(MAX_BUSES + 1) if k not in taken)
        extended[name] = number
        taken.add(number)
        above = max(above, number + 1)
    return extended


def _natural(name: str) -> tuple[str, int, str]:
    match = _END.fullmatch(name)
    number = None if match is None else number_of(name)
    return (name, -1, name) if match is None or number is None else (match[1], number, name)


def on_log(bus: int | None, numbers: Mapping[str, int]) -> int | None:
    """The bus of a log that a number or a name means; of a log of one interface alone it is that one.

    >>> on_log(NamedBus("can1"), {"can0": 0, "can1": 1}), on_log(0, {"can1": 1}), on_log(0, {"can1": 1, "can2": 2})
    (1, 1, 0)
    """
    if bus is None:
        return None
    if isinstance(bus, NamedBus):
        return bus.on(numbers)
    return next(iter(numbers.values())) if len(numbers) == 1 else bus


def bus_text(numbers: Mapping[str, int]) -> str:
    """Which interface is which bus, in one line.

    >>> bus_text({"can0": 0, "can1": 1})
    'can0 → bus 0, can1 → bus 1'
    """
    shown = [f"{terminal_text(name)} → bus {number}" for name, number in numbers.items()][:_MAX_SHOWN]
    more = len(numbers) - len(shown)
    return ", ".join(shown) + (f" and {more:,} more" if more else "")


class NamedBus(int):
    """A bus that is named, in a vehicle file, before a log says which number it has; equal to no number of a bus.

    >>> bus = NamedBus("can1")
    >>> f"{bus}", bus == NamedBus("can1"), bus > MAX_BUSES, bus.on({"can1": 7}), bus.on({})
    ('can1', True, True, 7, 1)
    """

    name: str

    def __new__(cls, name: str) -> NamedBus:
        """By its name alone."""
        made = super().__new__(cls, MAX_BUSES + 1 + crc32(name.encode()))
        made.name = name
        return made

    def on(self, numbers: Mapping[str, int]) -> int:
        """The number in a log whose interfaces have these; by its own digits where the log has no names."""
        number = numbers.get(self.name)
        if number is None and not numbers:
            number = number_of(self.name)
        return self if number is None else number

    def __str__(self) -> str:
        return self.name

    __repr__ = __str__

    def __format__(self, spec: str) -> str:
        return format(self.name, spec)

    def __reduce__(self) -> tuple[type[NamedBus], tuple[str]]:
        return NamedBus, (self.name,)


def bus_of(given: int | str | None) -> int | None:
    """What `bus = ...` of a vehicle file names.

    >>> bus_of(1), bus_of("can1"), bus_of(None)
    (1, can1, None)
    """
    return NamedBus(given) if isinstance(given, str) else given
