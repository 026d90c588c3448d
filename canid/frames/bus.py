"""Opening buses through python-can, wrapped so that nothing but receiving is left."""

from __future__ import annotations

import contextlib
import errno
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from canid.errors import BusError, CanidError, ConfigError
from canid.frames import devices, listen_only, python_can, slcan, stamps
from canid.frames.bus_configuration import BusConfiguration, configure
from canid.frames.device_watch import DeviceWatch
from canid.frames.frame_check import MAX_STAMP_NS, ImpossibleFrameError, why_impossible
from canid.frames.listen_only import ListenOnly
from canid.frames.python_can_receiver import PythonCanReceiver
from canid.frames.received import Received, Receiver
from canid.frames.stamp_clock import StampClock
from canid.types import NAN, Flag

# linux/can.h: CAN_INV_FILTER, a filter whose match is turned round; only the kernel knows it
INVERTED = 0x2000_0000
# interfaces without filters in a driver: canid filters behind the door, where it sees every message
_FILTERED_HERE = ("udp_multicast", "virtual")
_EXTENDED, _FD = int(Flag.EXTENDED), int(Flag.FD)

Filters = Sequence[Mapping[str, Any]]


class Opened(NamedTuple):
    """A bus that was opened."""

    receiver: Receiver
    listen_only: ListenOnly
    waiting: Callable[[], int] | None = None  # how many frames wait to be read; None: nobody can tell


class ReceiveOnlyBus:
    """A bus that can be listened to. It has no way to send.

    Every frame passes `frame_check` here: what no bus can carry is counted in `impossible` and left out.
    """

    def __init__(
        self,
        opener: Callable[[], Opened],
        *,
        interface: str,
        channel: str,
        bitrate: float = NAN,
        data_bitrate: float = NAN,
        filtered: bool = False,
        filters: Filters = (),
        hide_fd: bool = False,
        configured_by: tuple[str, ...] = (),
        device: DeviceWatch | None = None,
    ):
        """`filters`, `hide_fd`: applied here; `filtered`: by python-can, in software perhaps.

        `device`: the network device of a SocketCAN bus.
        """
        self.interface = interface
        self.channel = channel
        self.name = f"{interface} {channel}".strip()
        self.bitrate = bitrate  # bit/s, NaN: unknown
        self.data_bitrate = data_bitrate
        self.filtered = filtered  # software filters may make recv(0) return None with frames left
        self.configured_by = (
            configured_by  # files and environment variables, as in `BusConfiguration.sources`
        )
        self.impossible = 0  # messages that no bus can carry, left out
        self.impossible_why = ""  # the latest of them
        self.hidden = 0  # frames that filters left out
        self.passed_over_ns = 0  # when the latest of both was received, ns since 1970; 0: nobody knows
        self._filters = [(int(f["can_id"]), int(f["can_mask"]), f.get("extended")) for f in filters]
        self._hides = bool(filters) or hide_fd
        self._hide_fd = hide_fd
        self._opener = opener
        self._device = device
        self._receiver: Receiver | None
        self._receiver, self.listen_only, self._waiting = opener()
        self._news = [("listen_only", self.listen_only.says)] if self.listen_only.warns else []
        self._offset: int | None = None
        self._lost_drops = 0

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s for a frame, its time in ns since 1970; None: none came. Raises BusError.

        With a timeout of 0 one message is taken, and None may also mean that it was left out. Stamps of an interface
        that counts from a zero of its own (since boot, say) are set against the host's clock once, at the first frame.
        """
        receiver = self._receiver
        if receiver is None:
            raise BusError(f"{self.name} is closed")
        end = 0.0
        while True:
            try:
                got = receiver.recv(timeout)
                if got is None:
                    return None
                why = why_impossible(got)
                if not why:
                    if self._offset != 0:
                        got = self._since_1970(got)
                    if not self._hides or not self._hidden(got):
                        return got
                    self.hidden += 1
                    self.passed_over_ns = got.ns
                else:
                    self._left_out(why, got.ns if type(got.ns) is int and self._offset == 0 else 0)
            except ImpossibleFrameError as error:
                self._left_out(str(error), error.ns)
            if not timeout:
                return None
            now = time.monotonic()
            end = end or now + timeout
            if now >= end:
                return None
            timeout = end - now

    def _since_1970(self, got: Received) -> Received:
        """Set a stamp of the interface's own against the host's clock. Raises ImpossibleFrameError."""
        if self._offset is None:
            epoch = got.ns >= stamps.EPOCH_FLOOR * stamps.SECOND
            self._offset = 0 if epoch else time.time_ns() - got.ns
        ns = got.ns + self._offset
        if not 0 <= ns <= MAX_STAMP_NS:
            raise ImpossibleFrameError("a time stamp that no log can hold")
        return got._replace(ns=ns)

    def _hidden(self, got: Received) -> bool:
        """Tell whether filters leave a frame out, as `can.BusABC.set_filters` defines it."""
        if self._hide_fd and got.flags & _FD:
            return True
        extended = bool(got.flags & _EXTENDED)
        return bool(self._filters) and not any(
            (of is None or bool(of) == extended) and not (id_ ^ got.id) & mask
            for id_, mask, of in self._filters
        )

    def _left_out(self, why: str, ns: int) -> None:
        self.impossible += 1
        self.impossible_why = why
        self.passed_over_ns = ns

    @property
    def left_out(self) -> int:
        """Messages that were taken and not handed on: impossible or hidden."""
        return self.impossible + self.hidden

    def waiting(self) -> int | None:
        """How many frames wait to be read; None where nobody can tell."""
        return self._waiting() if self._waiting else None

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
        if self._device is not None:
            self._device.close()
        self._close()

    def _close(self) -> None:
        receiver, self._receiver = self._receiver, None
        if receiver is not None:
            self._lost_drops += receiver.drops
            try:
                receiver.close()
            except Exception as error:
                raise BusError(f"{self.name} could not be closed: {_one_line(error)}") from None

    def resumed(self) -> bool:
        """Tell whether what is open receives again by itself: a SocketCAN socket whose device is up again.

        It has kept what came since then. Raises BusError while that device is down: no other one takes its place.
        """
        return self._device is not None and self._receiver is not None and self._device.resumed()

    @property
    def holds_socket(self) -> bool:
        """Tell whether a lost bus is still open below: its device may only be down."""
        return self._device is not None and self._receiver is not None

    def news(self) -> list[tuple[str, str]]:
        """What has changed of the device since the last call, as (what, says) of events: name, mode, bit rate.

        The first call tells of a bus that may take part: one that is not known to listen only.
        """
        own, self._news = self._news, []
        if self._device is None:
            return own
        news, device = self._device.news(), self._device.device
        if news and device is not None:
            self.channel, self.name = device.name, f"{self.interface} {device.name}"
            self.bitrate = device.bitrate
            self.listen_only = listen_only.of_device(device.name, device)
        return own + news

    def reopen(self) -> None:
        """Receive again after the bus was lost. Raises BusError."""
        if self.resumed():
            return
        with contextlib.suppress(BusError):  # it is lost: what closing says of it is not news
            self._close()
        self._offset = None
        before = self.listen_only
        self._receiver, self.listen_only, self._waiting = self._opener()
        # a SocketCAN device tells its changes itself
        if self._device is None and self.listen_only != before:
            self._news.append(("listen_only_changed", self.listen_only.says))


def open_bus(config: Mapping[str, Any], *, hardware_stamps: bool = False) -> ReceiveOnlyBus:
    """Open one bus with python-can's keyword arguments; can.conf and CAN_* fill in what is missing.

    It is opened listen-only where the interface has that, whatever the configuration says, and `listen_only` tells
    what was read back. `hardware_stamps`: SocketCAN devices stamp with their own clock where they have one. Raises
    BusError, or ConfigError for what canid refuses: a `config` that asks for an active node, code from the current
    folder, a filter that the interface does not have.

    >>> bus = open_bus({"interface": "virtual", "channel": "doctest"})
    >>> bus.name, bus.recv(0.0), hasattr(bus, "send")
    ('virtual doctest', None, False)
    >>> bus.shutdown()
    """
    found = configure(config)
    interface, channel = found.interface, found.channel
    parameters, overruled = listen_only.impose(interface, found.parameters, found.given)
    filters: Filters = parameters.get("can_filters") or ()
    own = python_can.is_own(interface)
    if interface == "socketcan" and own:
        # a socket without it does not get CAN FD frames at all; on a classic bus it changes nothing
        parameters.setdefault("fd", True)
    elif any(each["can_id"] & INVERTED for each in filters):
        raise ConfigError(f"a filter ID~MASK works on socketcan only, not on {interface}; use ID:MASK")
    here = interface in _FILTERED_HERE and own
    if here:
        parameters.pop("can_filters", None)

    bitrate = _number(parameters.get("bitrate"))
    watch = None
    if interface == "socketcan" and own:
        device = devices.link(channel)
        bitrate = device.bitrate if device else NAN  # the device's own; the argument sets nothing
        watch = DeviceWatch(channel)
    return ReceiveOnlyBus(
        _opener(found, parameters, hardware_stamps, watch),
        device=watch,
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        data_bitrate=_number(parameters.get("data_bitrate")),
        filtered=bool(filters) and not here,
        filters=filters if here else (),
        hide_fd=interface == "udp_multicast" and not parameters.get("fd", True),
        configured_by=(*found.sources, *([overruled] if overruled else [])),
    )


def _opener(
    found: BusConfiguration, parameters: Mapping[str, Any], hardware_stamps: bool, device: DeviceWatch | None
) -> Callable[[], Opened]:
    """Return what opens the bus, the first time and after it was lost."""
    interface, channel, name = found.interface, found.channel, found.name
    own = python_can.is_own(interface)

    def opener() -> Opened:
        arguments = {key: value for key, value in parameters.items() if key not in ("interface", "channel")}
        if "channel" in parameters:
            arguments["channel"] = parameters["channel"]
        try:
            slcan_alone = interface == "slcan" and own
            bus_class = slcan.listening_class() if slcan_alone else python_can.bus_class(interface)
            with python_can.without_current_folder():
                bus = bus_class(**arguments)
        except ConfigError:
            raise
        except Exception as error:  # each back end has its own kinds, and its module may need another one
            raise BusError(
                f"cannot open {name}: {_one_line(error)}; {_advice(interface, channel, error)}"
            ) from None
        silent = listen_only.read_back(interface, channel, bus)
        if interface == "socketcan" and own:
            from canid.frames.socketcan import SocketcanReceiver

            return Opened(SocketcanReceiver(bus, hardware=hardware_stamps, device=device), silent)
        if interface == "udp_multicast" and own:
            from canid.frames.udp_drops import watch

            if not hasattr(socket.socket, "recvmsg"):  # Windows
                return Opened(PythonCanReceiver(bus, name, watch(bus)), silent)
            from canid.frames.udp_multicast import UdpReceiver

            return Opened(UdpReceiver(bus, name, watch(bus)), silent)
        if interface == "virtual" and own:
            return Opened(PythonCanReceiver(bus, name), silent, bus.queue.qsize)
        return Opened(PythonCanReceiver(bus, name), silent)

    return opener


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


def wrap(bus: Any, name: str = "") -> ReceiveOnlyBus:
    """Make a python-can bus that is open already receive-only; it cannot be opened again once it is lost.

    >>> bus = wrap(python_can.load().Bus("doctest", interface="virtual"), "virtual doctest")
    >>> bus.name, hasattr(bus, "send")
    ('virtual doctest', False)
    >>> bus.shutdown()
    """
    interface, _, channel = (name or str(bus.channel_info)).partition(" ")
    queue = getattr(bus, "queue", None) if interface == "virtual" else None
    opened = [
        Opened(
            PythonCanReceiver(bus, f"{interface} {channel}".strip()),
            listen_only.read_back(interface, channel, bus),
            queue.qsize if queue is not None else None,
        )
    ]

    def opener() -> Opened:
        if not opened:
            raise BusError(f"{interface} {channel} cannot be opened again")
        return opened.pop()

    return ReceiveOnlyBus(opener, interface=interface, channel=channel)


def _number(value: Any) -> float:
    """A bit rate; NaN where it is none: it only serves the bus load."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return NAN


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
