"""The one place that sends: a log onto a bus that has no wire. A physical one must be armed by its name."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterable, Mapping
from typing import Any

from canid.io.buses import devices, messages, python_can
from canid.io.buses.bus_configuration import BusConfiguration, configure
from canid.io.buses.command_line import configs_of
from canid.values.bus_names import of_open_buses
from canid.values.errors import BusError, CanidError, ConfigError
from canid.values.types import Flag, Frame

# s that a full transmit queue may take to drain
_QUEUE_TIMEOUT_S = 2.0
# s: a shorter sleep takes longer than asked for
_MIN_SLEEP_S = 0.0005
# On `virtual` the log's own times go along, counted from 1: small numbers keep every nanosecond,
# and 0 would mean that there is none.
_FIRST_STAMP_S = 1.0


def allowed(interface: str, channel: str, arm: str | None, device: devices.Device | None) -> None:
    """Raise ConfigError unless only programs can hear what is sent there, or the user has armed the channel.

    >>> allowed("virtual", "0", None, None)
    >>> allowed("socketcan", "c", None, devices.Device(kind="can"))
    Traceback (most recent call last):
    canid.values.errors.ConfigError: will not send to socketcan c, a physical bus; if you must: -i socketcan -c c --arm c
    """
    # a plug-in with the name of an interface of python-can may be anything
    of_python_can = python_can.is_own(interface)
    if of_python_can and interface in ("virtual", "udp_multicast"):
        return
    if of_python_can and interface == "socketcan" and device is not None and device.kind == "vcan":
        return
    if arm is not None and arm == channel and channel:
        return
    raise ConfigError(
        f"will not send to {interface} {channel}, a physical bus; if you must:"
        f" -i {interface} -c {channel} --arm {channel}"
    )


def onto(
    bus: Mapping[str, Any] | argparse.Namespace,
    frames: Iterable[Frame],
    speed: float = 1.0,
    arm: str | None = None,
) -> int:
    """Send frames at their times, `speed` times as fast (inf: without pause); returns how many.

    `bus`: python-can's arguments, or a namespace of `add_bus_arguments`. With several channels each takes the bus of
    the log that has its number (can1: 1), by the rule of `values.bus_names` as live and in logs; with one channel all go
    there. Error frames cannot be sent: they are left out. On udp_multicast no packet leaves the machine (hop limit 0).

    Raises ConfigError for a physical bus that is not armed, BusError where the bus does not take frames.
    """
    if not speed > 0:
        raise ValueError(f"speed {speed} is not above 0")
    configs = configs_of(bus) if isinstance(bus, argparse.Namespace) else [dict(bus)]
    resolved = [_config(config, arm) for config in configs]
    numbers = of_open_buses([str(config.get("channel", "")) for config in resolved])
    buses: dict[int, Any] = {}
    try:
        for number, config in zip(numbers, resolved, strict=True):
            try:
                bus_class = python_can.bus_class(config["interface"])
                with python_can.without_current_folder():
                    buses[number] = bus_class(
                        **{key: value for key, value in config.items() if key != "interface"}
                    )
            except CanidError:
                raise
            except Exception as error:  # each back end has its own kinds
                name = f"{config['interface']} {config.get('channel', '')}".strip()
                raise BusError(f"cannot open {name} to send: {' '.join(str(error).split())}") from None
        return _paced(buses, frames, speed)
    finally:
        for each in buses.values():
            each.shutdown()


def _config(given: Mapping[str, Any], arm: str | None) -> dict[str, Any]:
    """python-can's arguments of one bus that may be sent to. Raises ConfigError.

    A physical bus is the one that the command line names, as a whole: no can.conf, no CAN_CONFIG can put another
    interface, device or bit rate behind an armed channel name.
    """
    configuration = configure(given)
    try:
        _allowed(configuration, None)
    except ConfigError:
        if arm is None:
            raise
        if not {"interface", "channel"} <= configuration.given:
            raise ConfigError(
                f"--arm {arm} needs the bus on the command line, -i INTERFACE -c {arm}: files and the environment"
                " do not name a bus to send to"
            ) from None
        configuration = configure(given, given_only=True)
        _allowed(configuration, arm)
    config = dict(configuration.parameters)
    if configuration.interface == "udp_multicast":
        config["hop_limit"] = 0
    elif configuration.interface == "virtual":
        config["preserve_timestamps"] = True
    elif configuration.interface == "socketcan":
        config.setdefault("fd", True)
    return config


def _allowed(configuration: BusConfiguration, arm: str | None) -> None:
    device = devices.link(configuration.channel) if configuration.interface == "socketcan" else None
    allowed(configuration.interface, configuration.channel, arm, device)


def _paced(buses: dict[int, Any], frames: Iterable[Frame], speed: float) -> int:
    sent = 0
    began: float | None = None
    only = next(iter(buses.values())) if len(buses) == 1 else None
    for frame in frames:
        bus = buses.get(frame.bus, only)
        if bus is None or frame.flags & Flag.ERROR:
            continue
        if math.isfinite(speed):
            now = time.monotonic()
            began = now - frame.t / speed if began is None else began
            ahead = began + frame.t / speed - now
            if ahead > _MIN_SLEEP_S:
                time.sleep(ahead)
        message = messages.message_of(frame._replace(flags=frame.flags & ~Flag.TX), _FIRST_STAMP_S)
        message.channel = None
        _send(bus, message)
        sent += 1
    return sent


def _send(bus: Any, message: Any) -> None:
    until = time.monotonic() + _QUEUE_TIMEOUT_S
    while True:
        try:
            bus.send(message, timeout=_QUEUE_TIMEOUT_S)
            return
        except Exception as error:  # each back end has its own kinds
            # a full queue drains; other errors persist
            if time.monotonic() > until:
                raise BusError(
                    f"{bus.channel_info} takes no frames: {' '.join(str(error).split())}"
                ) from None
            time.sleep(0.001)  # s; some ten frames leave a 1 Mbit/s bus in this time
