"""python-can's command-line arguments for a bus, and listening to the buses that they name.

The options are those of `can.cli.add_bus_arguments`. That one imports python-can for a mere --help and prints
to standard output; and here -c may be given several times, once per bus.
"""

from __future__ import annotations

import argparse
import ast
import time
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any

from canid.io.buses import python_can
from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.buses.bus_opener import INVERTED_FILTER
from canid.values import bounded_numbers
from canid.values.bus_names import of_open_buses
from canid.values.errors import ConfigError
from canid.values.types import Frame

# s that one bus is waited for before the time is checked again
_TURN_S = 0.1
_NAMES = ("interface", "bitrate", "fd", "data_bitrate", "can_filters", "timing")


def add_bus_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare -i, -c, -b, --fd, --data-bitrate, --timing, --filter, --bus-kwargs; not given means unset."""
    group = parser.add_argument_group(
        "bus", "defaults come from can.conf or from CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE"
    )
    suppress = argparse.SUPPRESS
    group.add_argument(
        "-i",
        "--interface",
        default=suppress,
        help="python-can interface: socketcan, pcan, vector, kvaser, ...",
    )
    group.add_argument(
        "-c",
        "--channel",
        action="append",
        default=suppress,
        help="channel: can0, PCAN_USBBUS1, ...; repeat the option for more buses",
    )
    group.add_argument(
        "-b", "--bitrate", type=bounded_numbers.bit_rate, default=suppress, help="bit rate in bit/s"
    )
    group.add_argument("--fd", action="store_true", default=suppress, help="use CAN FD")
    group.add_argument(
        "--data-bitrate",
        type=bounded_numbers.bit_rate,
        default=suppress,
        help="bit rate of the CAN FD data phase in bit/s",
    )
    group.add_argument(
        "--timing",
        nargs="+",
        type=_integer,
        default=suppress,
        metavar="NAME=N",
        help="bit timing, as in python-can",
    )
    group.add_argument(
        "--filter",
        nargs="+",
        type=can_filter,
        dest="can_filters",
        default=suppress,
        metavar="ID:MASK",
        help="receive only frames with id & MASK == ID & MASK (hex); with ID~MASK all other frames",
    )
    group.add_argument(
        "--bus-kwargs",
        nargs="+",
        type=_value,
        default=suppress,
        metavar="NAME=VALUE",
        help="further arguments of the interface",
    )


def configs_of(namespace: argparse.Namespace) -> list[dict[str, Any]]:
    """python-can's keyword arguments, one dict per bus. Raises ConfigError for an unknown interface.

    >>> parser = argparse.ArgumentParser()
    >>> add_bus_arguments(parser)
    >>> configs_of(parser.parse_args(["-i", "socketcan", "-c", "can0", "-c", "can1", "--fd"]))[1]
    {'interface': 'socketcan', 'fd': True, 'channel': 'can1'}
    """
    given = vars(namespace)
    config: dict[str, Any] = {name: given[name] for name in _NAMES if name in given}
    if "interface" in config:
        _known(config["interface"])
    if "timing" in config:
        config["timing"] = _timing(dict(config["timing"]))
    config |= dict(given.get("bus_kwargs", ()))
    channels: Sequence[str] = given.get("channel", ())
    return [config | {"channel": channel} for channel in channels] or [config]


def named(namespace: argparse.Namespace) -> bool:
    """Whether the arguments name a bus (can.conf and CAN_* may do so as well).

    >>> named(argparse.Namespace(channel=["can0"])), named(argparse.Namespace())
    (True, False)
    """
    return "interface" in namespace or "channel" in namespace


def listen(
    buses: Sequence[ReceiveOnlyBus],
    duration: float,
    report: Callable[[str], object] = lambda line: None,
    ends: Callable[[], bool] = lambda: False,
) -> Iterator[Frame]:
    """Frames of open buses, which are closed at the end, for `duration` s; times count from the first frame.

    `report` gets lines for the user: whether each bus listens only, what configured it, what was left out. `ends` is
    asked at each turn, frames or none. Raises BusError.
    """
    numbers = of_open_buses([bus.channel for bus in buses])
    for bus in buses:
        report(f"{bus.name}: {bus.listen_only.says}")
        if bus.configured_by:
            report(f"{bus.name}: configured by {', '.join(bus.configured_by)}")
    first: int | None = None
    end = time.monotonic() + duration
    try:
        while (left := end - time.monotonic()) > 0 and not ends():
            for number, bus in zip(numbers, buses, strict=True):
                got = bus.recv(min(left, _TURN_S) if len(buses) == 1 else _TURN_S / 10)
                if got is not None:
                    first = got.ns if first is None else first
                    yield Frame((got.ns - first) * 1e-9, number, got.id, got.data, got.flags, got.length)
    finally:
        for bus in buses:
            if bus.impossible:
                report(
                    f"{bus.name}: {bus.impossible:,} messages left out that no bus can carry: {bus.impossible_why}"
                )
            bus.shutdown()


def can_filter(text: str) -> dict[str, int]:
    """Parse one filter, for argparse.

    >>> can_filter("100:7FC")
    {'can_id': 256, 'can_mask': 2044}
    """
    inverted = "~" in text
    id_, _, mask = text.partition("~" if inverted else ":")
    try:
        numbers = int(id_, 16), int(mask, 16)
    except ValueError:
        numbers = (-1, -1)
    if not all(0 <= number < 1 << 32 for number in numbers):
        raise argparse.ArgumentTypeError(f"{text!r} is no filter (such as 100:7FC, in hex)")
    return {"can_id": numbers[0] | (INVERTED_FILTER if inverted else 0), "can_mask": numbers[1]}


def _known(interface: str) -> None:
    names = sorted(python_can.load().VALID_INTERFACES)
    if interface not in names:
        close = get_close_matches(interface, names, n=1)
        hint = f'did you mean "{close[0]}"?' if close else f"python-can has {', '.join(names)}"
        raise ConfigError(f'no interface "{interface}"; {hint}')


def _value(text: str) -> tuple[str, Any]:
    name, separator, value = text.partition("=")
    name = name.replace("-", "_")
    if not separator or not name.isidentifier():
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=VALUE")
    try:
        return name, ast.literal_eval(value)  # numbers, True, False, None
    except (ValueError, SyntaxError):
        return name, value


def _integer(text: str) -> tuple[str, int]:
    name, value = _value(text)
    if not isinstance(value, int):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=whole number")
    return name, value


def _timing(given: dict[str, int]) -> Any:
    can = python_can.load()
    try:
        return (can.BitTimingFd if "nom_brp" in given else can.BitTiming)(**given)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"--timing: {error}") from None
