"""Opening buses through python-can, listen-only where the interface has that."""

from __future__ import annotations

import contextlib
import errno
import socket
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import metadata
from typing import Any

from canid.io.buses import devices, listen_only, python_can, slcan
from canid.io.buses.bus import Filters, Opened, ReceiveOnlyBus
from canid.io.buses.bus_configuration import BusConfiguration, configure
from canid.io.buses.device_watch import DeviceWatch
from canid.io.buses.receivers.python_can_receiver import PythonCanReceiver
from canid.io.buses.receivers.received_frame import Receiver
from canid.values.errors import BusError, CanidError, ConfigError, one_line
from canid.values.types import NAN

# linux/can.h: CAN_INV_FILTER, a filter whose match is turned round; only the kernel knows it
INVERTED_FILTER = 0x2000_0000
# interfaces without filters in a driver: canid filters after the frame check, where it sees every message
_WITHOUT_DRIVER_FILTERS = ("udp_multicast", "virtual")


def open_bus(config: Mapping[str, Any], *, hardware_stamps: bool = False) -> ReceiveOnlyBus:
    """Open one bus with python-can's keyword arguments; can.conf and CAN_* fill in what is missing.

    It is opened listen-only where the interface has that, whatever the configuration says; `listen_only` is what was
    read back. `hardware_stamps`: SocketCAN devices stamp with their own clock where they have one. Raises
    BusError, or ConfigError for what canid refuses: a `config` that asks for an active node, code from the current
    folder, a filter that the interface does not have.

    >>> bus = open_bus({"interface": "virtual", "channel": "doctest"})
    >>> bus.name, bus.recv(0.0), hasattr(bus, "send")
    ('virtual doctest', None, False)
    >>> bus.shutdown()
    """
    configuration = configure(config)
    interface, channel = configuration.interface, configuration.channel
    parameters, overruled = listen_only.impose(interface, configuration.parameters, configuration.given)
    filters: Filters = parameters.get("can_filters") or ()
    of_python_can = python_can.is_own(interface)
    if interface == "socketcan" and of_python_can:
        # a socket without it does not receive CAN FD frames at all; on a classic bus it changes nothing
        parameters.setdefault("fd", True)
    elif any(each["can_id"] & INVERTED_FILTER for each in filters):
        raise ConfigError(f"a filter ID~MASK works on socketcan only, not on {interface}; use ID:MASK")
    here = interface in _WITHOUT_DRIVER_FILTERS and of_python_can
    if here:
        parameters.pop("can_filters", None)

    bitrate = _number(parameters.get("bitrate"))
    watch = None
    if interface == "socketcan" and of_python_can:
        device = devices.link(channel)
        bitrate = device.bitrate if device else NAN  # the device's own; the argument sets nothing
        watch = DeviceWatch(channel)
    return ReceiveOnlyBus(
        _opener(configuration, parameters, hardware_stamps, watch),
        device=watch,
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        data_bitrate=_number(parameters.get("data_bitrate")),
        filtered=bool(filters) and not here,
        filters=filters if here else (),
        hide_fd=interface == "udp_multicast" and not parameters.get("fd", True),
        configured_by=(*configuration.sources, *([overruled] if overruled else [])),
    )


def _opener(
    configuration: BusConfiguration,
    parameters: Mapping[str, Any],
    hardware_stamps: bool,
    device: DeviceWatch | None,
) -> Callable[[], Opened]:
    """The function that opens the bus, the first time and after it was lost."""
    interface, channel, name = configuration.interface, configuration.channel, configuration.name
    of_python_can = python_can.is_own(interface)

    def opener() -> Opened:
        arguments = {key: value for key, value in parameters.items() if key not in ("interface", "channel")}
        if "channel" in parameters:
            arguments["channel"] = parameters["channel"]
        try:
            slcan_alone = interface == "slcan" and of_python_can
            bus_class = slcan.listening_class() if slcan_alone else python_can.bus_class(interface)
            with python_can.without_current_folder():
                bus = bus_class(**arguments)
        except ConfigError:
            raise
        except Exception as error:  # each back end has its own kinds, and its module may need another one
            raise BusError(
                f"cannot open {name}: {one_line(error)}; {_advice(interface, channel, error)}"
            ) from None
        silent = listen_only.read_back(interface, channel, bus)
        if interface == "socketcan" and of_python_can:
            return Opened(_socketcan(bus, hardware_stamps, device), silent)
        if interface == "udp_multicast" and of_python_can:
            from canid.io.buses.receivers.udp_drops import watch

            if not hasattr(socket.socket, "recvmsg"):  # Windows
                return Opened(PythonCanReceiver(bus, name, watch(bus)), silent)
            return Opened(_udp(bus, name, watch(bus)), silent)
        if interface == "virtual" and of_python_can:
            return Opened(PythonCanReceiver(bus, name), silent, bus.queue.qsize)
        return Opened(PythonCanReceiver(bus, name), silent)

    return opener


def _socketcan(bus: Any, hardware_stamps: bool, device: DeviceWatch | None) -> Receiver:
    from canid.io.buses.receivers import many_messages
    from canid.io.buses.receivers.socketcan import SocketcanReceiver
    from canid.io.buses.receivers.socketcan_columns import SocketcanColumnsReceiver

    receiver = SocketcanColumnsReceiver if many_messages.available() else SocketcanReceiver
    return receiver(bus, hardware=hardware_stamps, device=device)


def _udp(bus: Any, name: str, count: Callable[[], int]) -> Receiver:
    from canid.io.buses.receivers import many_messages
    from canid.io.buses.receivers.udp_columns import UdpColumnsReceiver
    from canid.io.buses.receivers.udp_multicast import UdpReceiver

    return (UdpColumnsReceiver if many_messages.available() else UdpReceiver)(bus, name, count)


def open_buses(configs: Sequence[Mapping[str, Any]]) -> list[ReceiveOnlyBus]:
    """Open all, or none: where one fails the others are closed again. Raises BusError.

    A single bus is stamped by its hardware where SocketCAN gives that. Several are stamped by the kernel: devices'
    clocks drift apart by tens of ms an hour, and dead times between buses would drift with them.
    """
    buses: list[ReceiveOnlyBus] = []
    try:
        for config in configs:
            bus = open_bus(config, hardware_stamps=len(configs) == 1)
            buses.append(bus)
    except CanidError:
        for bus in buses:
            with contextlib.suppress(BusError):
                bus.shutdown()
        raise
    return buses


def _number(value: Any) -> float:
    """A bit rate; NaN where it is none: it is only used for the bus load."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return NAN


# what brings the packages of an interface, where it is no extra of python-can that is called so
PACKAGES = {"udp_multicast": "canid[udp]", "slcan": "python-can[serial]", "robotell": "python-can[serial]"}


def package_of(interface: str) -> str:
    """What pip installs for an interface; "": python-can has no extra for it.

    >>> package_of("udp_multicast"), package_of("gs_usb"), package_of("kvaser")
    ('canid[udp]', 'python-can[gs-usb]', '')
    """
    name = interface.replace("_", "-")
    extras = metadata("python-can").get_all("Provides-Extra") or []
    return PACKAGES.get(interface, f"python-can[{name}]" if name in extras else "")


def _advice(interface: str, channel: str, error: BaseException) -> str:
    """What to try next, for an error message."""
    code = getattr(error, "errno", None) or getattr(error, "error_code", None)
    if interface == "socketcan":
        if code == errno.EAFNOSUPPORT:
            return "this kernel has no CAN: sudo modprobe can can_raw"
        if code == errno.ENODEV:
            return f"is it plugged in? see `ip link`; for a virtual one: sudo ip link add {channel} type vcan"
        return f"try: sudo ip link set {channel} up type can bitrate 500000"
    if isinstance(error, ImportError | NotImplementedError) or "install" in str(error):
        package = package_of(interface)
        remedy = (
            f"pip install '{package}'" if package else "install it as python-can's page on the interface says"
        )
        return f"the package or driver for {interface} is missing: {remedy}"
    return f"check the {interface} driver, the channel name and that no other program holds it"
