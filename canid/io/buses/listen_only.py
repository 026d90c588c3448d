"""Listen-only mode: how each interface of python-can is made to listen only, and what was read back from it.

canid never sends. But a controller that is not in listen-only mode still acknowledges frames and answers faulty ones
with error frames: only listen-only keeps it electrically silent. So the parameters that switch it on take precedence
over every configuration file and environment variable, and a command line that asks for the contrary is refused. The
reported mode is read back from the opened bus, never taken from the request.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple

from canid.io.buses import devices, python_can, slcan
from canid.values.errors import ConfigError, one_line


class Mode(Enum):
    """The mode of a bus, as far as it is known."""

    VERIFIED = "verified"  # listen-only, read back
    NOT_NEEDED = "not needed"  # there is no wire
    ACTIVE = "active"  # the controller acknowledges frames
    UNVERIFIED = "unverified"  # unknown


class ListenOnly(NamedTuple):
    """Whether a bus is in listen-only mode."""

    on: bool | None  # None: unknown
    says: str  # one line for the user
    mode: Mode = Mode.UNVERIFIED

    @property
    def warns(self) -> bool:
        """Whether the user should see it in red and find it in the journal.

        >>> ListenOnly(None, "unknown").warns, ListenOnly(True, "yes", Mode.VERIFIED).warns
        (True, False)
        """
        return self.mode in (Mode.ACTIVE, Mode.UNVERIFIED)


class _Way(NamedTuple):
    """How one interface is made to listen only."""

    # keyword arguments of its constructor; the value "PASSIVE" stands for can.BusState.PASSIVE
    parameters: dict[str, Any]
    # from an open bus: its mode and the source of that in words; None: it cannot be read back
    read_back: Callable[[Any], tuple[bool | None, str]] | None


# Reading back, for each interface: the mode (None: unknown) and its source in words.


def _slcan(bus: Any) -> tuple[bool | None, str]:
    if not slcan.was_opened_silently(bus):
        return None, "what the adapter was sent is not known"
    if bus.answer == slcan.REFUSED:
        return None, "the adapter refused L, the command for it"
    answered = "confirmed it" if bus.answer else "gave no answer"
    return True, f"the adapter was opened with L, never with O, and {answered}"


def _vector(bus: Any) -> tuple[bool | None, str]:
    # without init access to every channel XL_OUTPUT_MODE_SILENT is not set, and python-can only logs that
    if bus._listen_only and bus.mask and bus.permission_mask & bus.mask == bus.mask:
        return True, "set as output mode of every channel"
    return None, "another program has init access to the channel and decides"


def _nixnet(bus: Any) -> tuple[bool | None, str]:
    return bool(bus._interface.can_lstn_only), "read back from the driver"


def _pcan(bus: Any) -> tuple[bool | None, str]:
    result, value = bus.m_objPCANBasic.GetValue(bus.m_PcanHandle, _PCAN_LISTEN_ONLY)
    if int(getattr(result, "value", result)) != 0:  # PCAN_ERROR_OK
        return None, "the driver does not report it"
    return int(value) == 1, "read back from the driver"  # PCAN_PARAMETER_ON


def _systec(bus: Any) -> tuple[bool | None, str]:
    # MODE_LISTEN_ONLY = 1 of what UcanInitCanEx was given (systec/constants.py)
    return bool(int(bus._params["mode"]) & 1), "the mode that the controller was started with"


def _seeed(bus: Any) -> tuple[bool | None, str]:
    return bus.op_mode == "silent", "the mode that the adapter was configured with"


# PCANBasic.h
_PCAN_LISTEN_ONLY = 8

# Each from the constructor in python-can 4.6. kvaser: driver_mode False is DRIVER_MODE_SILENT, and a handle without init
# access cannot set it; python-can keeps no record of either, and CANlib's canGetBusOutputControl is not wrapped.
# cantact: set_monitor, kept nowhere. Every other interface has no such parameter: canalystii, etas (always
# OCI_BUSMODE_ACTIVE), gs_usb (starts in normal mode), iscan, ixxat (never sets CAN_OPMODE_LISTONLY), neousys, neovi,
# nican, robotell, serial, usb2can (its `flags` are not documented).
_WAYS: dict[str, _Way] = {
    "slcan": _Way({"listen_only": True}, _slcan),
    "vector": _Way({"listen_only": True}, _vector),
    "nixnet": _Way({"listen_only": True}, _nixnet),
    "pcan": _Way({"state": "PASSIVE"}, _pcan),
    "systec": _Way({"state": "PASSIVE"}, _systec),
    "seeedstudio": _Way({"operation_mode": "silent"}, _seeed),
    "kvaser": _Way({"driver_mode": False, "no_init_access": False}, None),
    "cantact": _Way({"monitor": True}, None),
}
# There is no wire to be silent on.
_NO_WIRE = ("virtual", "udp_multicast")
# The device is another machine's: whether it listens only is decided there.
_REMOTE = ("socketcand",)


def arguments(interface: str) -> dict[str, Any]:
    """Return the parameters of python-can that make an interface listen only; {}: there is no way.

    >>> arguments("slcan"), arguments("socketcan")
    ({'listen_only': True}, {})
    """
    way = _WAYS.get(interface) if python_can.is_own(interface) else None
    asked = dict(way.parameters) if way else {}
    if asked.get("state") == "PASSIVE":
        asked["state"] = python_can.load().BusState.PASSIVE
    return asked


def impose(
    interface: str, parameters: Mapping[str, Any], given: frozenset[str]
) -> tuple[dict[str, Any], str]:
    """Make the parameters of a bus ask for listen-only, whatever the configuration says.

    Returns them, and what was overruled: "" or one sentence. Raises ConfigError where `given`, the names on the
    command line, holds the contrary.

    >>> impose("slcan", {"channel": "/dev/ttyACM0", "listen_only": False}, frozenset())[1]
    'the configuration has listen_only=False: overruled, canid listens only'
    """
    out, overruled = dict(parameters), []
    for key, value in arguments(interface).items():
        if key in parameters and parameters[key] != value:
            shown = f"{key}={_shown(parameters[key])}"
            if key in given:
                raise ConfigError(
                    f"{shown}: canid listens only and opens {interface} with {key}={_shown(value)}"
                )
            overruled.append(shown)
        out[key] = value
    says = f"the configuration has {', '.join(overruled)}: overruled, canid listens only" if overruled else ""
    return out, says


def read_back(interface: str, channel: str, bus: Any) -> ListenOnly:
    """The mode of a bus that python-can has opened; SocketCAN devices are queried through netlink.

    >>> read_back("virtual", "0", None).says
    'listen-only: not needed, virtual is no physical bus'
    """
    if not python_can.is_own(interface):
        return _unverified(f"{interface} is not one of python-can's own interfaces")
    if interface in _NO_WIRE:
        return ListenOnly(True, f"listen-only: not needed, {interface} is no physical bus", Mode.NOT_NEEDED)
    if interface == "socketcan":
        return of_device(channel, devices.link(channel) if channel else None)
    if interface in _REMOTE:
        return _unverified(f"{interface} does not report the mode of the device behind it")
    way = _WAYS.get(interface)
    if way is None:
        return ListenOnly(
            False,
            f"listen-only: not supported by {interface}: canid never sends, but the controller acknowledges",
            Mode.ACTIVE,
        )
    asked = ", ".join(f"{key}={value}" for key, value in way.parameters.items())
    if way.read_back is None:
        return _unverified(f"{interface} was opened with {asked} and cannot be read back")
    try:
        on, how = way.read_back(bus)
    except Exception as error:  # a driver's answer, or an attribute that another version of python-can lacks
        return _unverified(
            f"{interface} was opened with {asked}, and reading it back failed: {one_line(error)}"
        )
    if on:
        return ListenOnly(True, f"listen-only: yes ({interface}: {how})", Mode.VERIFIED)
    if on is False:
        says = (
            f"listen-only: no ({interface}: {how}): canid never sends, but the controller acknowledges frames"
        )
        return ListenOnly(False, says, Mode.ACTIVE)
    return _unverified(f"{interface} was opened with {asked}, but {how}")


def interfaces() -> list[str]:
    """One line per interface of python-can: how it is kept from acknowledging.

    >>> [line for line in interfaces() if line.startswith("slcan")]
    ['slcan: opened listen-only (listen_only=True), and read back']
    """
    lines = []
    for interface in sorted(python_can.load().VALID_INTERFACES):
        way = _WAYS.get(interface) if python_can.is_own(interface) else None
        if way:
            asked = ", ".join(f"{key}={value}" for key, value in way.parameters.items())
            says = f"opened listen-only ({asked}), " + (
                "and read back" if way.read_back else "but it cannot be read back"
            )
        elif not python_can.is_own(interface):
            says = "a plug-in: whether it listens only cannot be verified"
        elif interface == "socketcan":
            says = "read back from the device; to set: ip link set CHANNEL type can listen-only on"
        elif interface in _NO_WIRE:
            says = "no physical bus"
        elif interface in _REMOTE:
            says = "the device is another machine's: whether it listens only cannot be verified"
        else:
            says = (
                "no listen-only through python-can: canid never sends, but the controller acknowledges frames"
            )
        lines.append(f"{interface}: {says}")
    return lines


def of_device(channel: str, device: devices.Device | None) -> ListenOnly:
    """The mode of a SocketCAN device.

    >>> of_device("can0", devices.Device(kind="can", listen_only=True)).says
    'listen-only: yes (read back from can0)'
    """
    if not channel:
        return _unverified("all devices are read together")
    if device is None:
        return _unverified(f"the system does not report {channel}")
    if device.kind == "vcan":
        return ListenOnly(
            True, f"listen-only: not needed, {channel} is a virtual device (vcan)", Mode.NOT_NEEDED
        )
    if device.kind != "can":
        return _unverified(f"{channel} is {device.kind or 'of an unknown kind'}, which has no such mode")
    if device.listen_only:
        return ListenOnly(True, f"listen-only: yes (read back from {channel})", Mode.VERIFIED)
    return ListenOnly(
        False,
        f"listen-only: no: canid never sends, but {channel} acknowledges frames; for silence: "
        f"ip link set {channel} down && ip link set {channel} up type can listen-only on",
        Mode.ACTIVE,
    )


def _unverified(why: str) -> ListenOnly:
    return ListenOnly(None, f"listen-only: could not be verified: {why}", Mode.UNVERIFIED)


def _shown(value: Any) -> str:
    name = getattr(value, "name", None)
    text = str(name if isinstance(name, str) else value)
    return text if text.isascii() and text.isprintable() and len(text) <= 40 else "..."
