"""Opening buses through python-can, wrapped so that nothing but receiving is left."""

from __future__ import annotations

import contextlib
import errno
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from canid.errors import BusError, ConfigError
from canid.frames import devices, listen_only, messages, python_can, stamp_clock, stamps
from canid.frames.listen_only import ListenOnly
from canid.frames.received import Received, Receiver
from canid.frames.stamp_clock import StampClock
from canid.types import NAN

# linux/can.h: CAN_INV_FILTER, a filter whose match is turned round; only the kernel knows it
INVERTED = 0x2000_0000


class _PythonCanReceiver:
    """Receives from any python-can bus; drops are known where something outside python-can counts them."""

    def __init__(self, bus: Any, name: str, count: Callable[[], int] = lambda: 0):
        # the methods, not the bus: what is not here cannot be called
        self._recv = bus.recv
        self._shutdown = bus.shutdown
        self._state = _state_of(bus)
        self._name = name
        self._count = count
        self.clock = StampClock.UNKNOWN

    @property
    def drops(self) -> int:
        return self._count()

    def recv(self, timeout: float) -> Received | None:
        end = time.monotonic() + timeout
        while True:
            try:
                message = self._recv(max(end - time.monotonic(), 0.0))
            except Exception as error:  # back ends raise errors of their own kinds
                raise BusError(f"{self._name} is lost: {_one_line(error)}") from None
            if message is None:
                return None
            if self.clock is StampClock.UNKNOWN:
                interface = self._name.partition(" ")[0]
                self.clock = stamp_clock.of_interface(interface, stamped=bool(message.timestamp))
            # an interface that gives no time stamp: the host's clock is the next best
            ns = stamps.from_float(message.timestamp) if message.timestamp else time.time_ns()
            length = message.dlc if message.is_remote_frame else -1
            return Received(
                ns, message.arbitration_id, bytes(message.data), messages.flags_of(message), length
            )

    def controller(self) -> str:
        return self._state()

    def close(self) -> None:
        self._shutdown()


def _state_of(bus: Any) -> Callable[[], str]:
    """What the driver says of the controller; most say nothing, and the base class says ACTIVE for them.

    A PASSIVE that was asked for (pcan, systec: listen-only) says nothing of errors.
    """
    can = python_can.load()
    if getattr(type(bus), "state", None) is can.BusABC.state:
        return lambda: ""
    words = {can.BusState.ACTIVE: "error_active", can.BusState.PASSIVE: "error_passive"}

    def told() -> str:
        try:
            return "bus_off" if bus.state is can.BusState.ERROR else words.get(bus.state, "")
        except Exception:  # back ends raise errors of their own kinds; `recv` will tell
            return ""

    if told() == "error_passive":
        del words[can.BusState.PASSIVE]
    return told


class ReceiveOnlyBus:
    """A bus that can be listened to. It has no way to send."""

    def __init__(
        self,
        opener: Callable[[], Receiver],
        *,
        interface: str,
        channel: str,
        bitrate: float = NAN,
        data_bitrate: float = NAN,
        listen: ListenOnly | None = None,
        filtered: bool = False,
    ):
        self.interface = interface
        self.channel = channel
        self.name = f"{interface} {channel}".strip()
        self.bitrate = bitrate  # bit/s, NaN: unknown
        self.data_bitrate = data_bitrate
        self.listen_only = listen or ListenOnly(None, "listen-only: unknown")
        self.filtered = filtered  # software filters may make recv(0) return None with frames left
        self._opener = opener
        self._receiver: Receiver | None = opener()
        self._offset: int | None = None
        self._lost_drops = 0

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s for a frame, its time in ns since 1970; None: none came. Raises BusError.

        Stamps of an interface that counts from a zero of its own (since boot, say) are set against the host's
        clock once, at the first frame.
        """
        if self._receiver is None:
            raise BusError(f"{self.name} is closed")
        got = self._receiver.recv(timeout)
        if got is None:
            return None
        if self._offset is None:
            epoch = got.ns >= stamps.EPOCH_FLOOR * stamps.SECOND
            self._offset = 0 if epoch else time.time_ns() - got.ns
        return got._replace(ns=got.ns + self._offset) if self._offset else got

    @property
    def state(self) -> str:
        """Tell whether it is "open" or "closed"."""
        return "closed" if self._receiver is None else "open"

    @property
    def clock(self) -> StampClock:
        """Which clock stamps the frames; unknown before the first one."""
        return self._receiver.clock if self._receiver else StampClock.UNKNOWN

    def controller(self) -> str:
        """What the driver says of the controller, as in `BusStats`; "" where it says nothing."""
        return self._receiver.controller() if self._receiver else ""

    @property
    def drops(self) -> int:
        """Frames that the kernel dropped because we were late; 0 where the interface cannot tell."""
        return self._lost_drops + (self._receiver.drops if self._receiver else 0)

    def shutdown(self) -> None:
        """Close; a second call does nothing."""
        receiver, self._receiver = self._receiver, None
        if receiver is not None:
            self._lost_drops += receiver.drops
            try:
                receiver.close()
            except Exception as error:
                raise BusError(f"{self.name} could not be closed: {_one_line(error)}") from None

    def reopen(self) -> None:
        """Open again after the bus was lost. Raises BusError."""
        with contextlib.suppress(BusError):  # it is lost: what closing says of it is not news
            self.shutdown()
        self._offset = None
        self._receiver = self._opener()


def resolve(config: Mapping[str, Any]) -> dict[str, Any]:
    """Fill in python-can's configuration (can.conf, CAN_*). Raises BusError where no interface comes out.

    >>> resolve({"interface": "virtual", "channel": "a"})["channel"]
    'a'
    """
    given = dict(config)
    try:
        found = python_can.load().util.load_config(config=given, context=given.pop("config_context", None))
    except Exception as error:  # of any kind, from files that the user wrote
        # what python-can says where nothing at all names an interface
        why = "none is named" if '"None"' in str(error) else _one_line(error)
        raise BusError(
            f"no bus: {why}; name one with -i INTERFACE -c CHANNEL, in can.conf or CAN_INTERFACE"
        ) from None
    return {key: value for key, value in found.items() if value is not None}


def open_bus(config: Mapping[str, Any], *, hardware_stamps: bool = False) -> ReceiveOnlyBus:
    """Open one bus with python-can's keyword arguments; can.conf and CAN_* fill in what is missing.

    Listen-only is asked for where the interface has it. `hardware_stamps`: SocketCAN devices stamp with their own
    clock where they have one. Raises BusError, or ConfigError for a filter that the interface does not have.

    >>> bus = open_bus({"interface": "virtual", "channel": "doctest"})
    >>> bus.name, bus.recv(0.0), hasattr(bus, "send")
    ('virtual doctest', None, False)
    >>> bus.shutdown()
    """
    can = python_can.load()
    resolved = resolve(config)
    interface = str(resolved.get("interface", ""))
    channel = str(resolved.get("channel", ""))
    name = f"{interface} {channel}".strip()
    for key, value in listen_only.arguments(interface).items():
        resolved.setdefault(key, value)
    if interface == "socketcan":
        # a socket without it does not get CAN FD frames at all; on a classic bus it changes nothing
        resolved.setdefault("fd", True)
    elif any(each["can_id"] & INVERTED for each in resolved.get("can_filters") or ()):
        raise ConfigError(f"a filter ID~MASK works on socketcan only, not on {interface}; use ID:MASK")

    def opener() -> Receiver:
        try:
            bus = can.Bus(ignore_config=True, **resolved)
        except Exception as error:  # each back end has its own kinds
            raise BusError(
                f"cannot open {name}: {_one_line(error)}; {_advice(interface, channel, error)}"
            ) from None
        if interface == "socketcan":
            from canid.frames.socketcan import SocketcanReceiver

            return SocketcanReceiver(bus, hardware=hardware_stamps)
        if interface == "udp_multicast":
            from canid.frames.udp_drops import watch

            if not hasattr(socket.socket, "recvmsg") or bus.filters:  # Windows; filters in software
                return _PythonCanReceiver(bus, name, watch(bus))
            from canid.frames.udp_multicast import UdpReceiver

            return UdpReceiver(bus, name, watch(bus))
        return _PythonCanReceiver(bus, name)

    bitrate = float(resolved.get("bitrate", NAN))
    if interface == "socketcan":
        device = devices.link(channel)
        bitrate = device.bitrate if device else NAN  # the device's own; the argument sets nothing
    bus = ReceiveOnlyBus(
        opener,
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        data_bitrate=float(resolved.get("data_bitrate", NAN)),
        filtered=bool(resolved.get("can_filters")),
    )
    bus.listen_only = listen_only.statement(interface, channel)
    return bus


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
    except BusError:
        for bus in buses:
            bus.shutdown()
        raise
    return buses


def wrap(bus: Any, name: str = "") -> ReceiveOnlyBus:
    """Make a python-can bus that is open already receive-only; it cannot be opened again once it is lost.

    >>> bus = wrap(python_can.load().Bus("doctest", interface="virtual"), "virtual doctest")
    >>> bus.name, hasattr(bus, "send")
    ('virtual doctest', False)
    >>> bus.shutdown()
    """
    interface, _, channel = (name or str(bus.channel_info)).partition(" ")
    receivers: list[Receiver] = [_PythonCanReceiver(bus, f"{interface} {channel}".strip())]

    def opener() -> Receiver:
        if not receivers:
            raise BusError(f"{interface} {channel} cannot be opened again")
        return receivers.pop()

    return ReceiveOnlyBus(opener, interface=interface, channel=channel)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _advice(interface: str, channel: str, error: BaseException) -> str:
    """Say what to try next."""
    code = getattr(error, "errno", None) or getattr(error, "error_code", None)
    if interface == "socketcan":
        if code == errno.EAFNOSUPPORT:
            return "this kernel has no CAN: sudo modprobe can can_raw"
        if code == errno.ENODEV:
            return f"is it plugged in? see `ip link`; for a virtual one: sudo ip link add {channel} type vcan"
        return f"try: sudo ip link set {channel} up type can bitrate 500000"
    if isinstance(error, ImportError | NotImplementedError) or "install" in str(error):
        return f"the package or driver for {interface} is missing: pip install 'python-can[{interface}]'"
    return f"check the {interface} driver, the channel name and that no other program holds it"
