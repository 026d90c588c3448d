"""Listen-only: how each python-can interface is asked for it, and what came of it, in one line.

canid never sends. But a controller that is not in listen-only mode still acknowledges frames and answers
faulty ones with error frames: only listen-only keeps it electrically silent.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from canid.frames import devices, python_can


class ListenOnly(NamedTuple):
    """What is known of one bus."""

    on: bool | None  # None: nobody can tell
    says: str  # one line for the user


# Keyword arguments that ask for it; the value "PASSIVE" stands for can.BusState.PASSIVE.
# From the constructors in python-can 4.6: every other interface ignores or refuses the wish.
_ASK: dict[str, dict[str, Any]] = {
    "vector": {"listen_only": True},
    "slcan": {"listen_only": True},
    "nixnet": {"listen_only": True},
    "pcan": {"state": "PASSIVE"},
    "systec": {"state": "PASSIVE"},
    "kvaser": {"driver_mode": False},  # DRIVER_MODE_SILENT
}
# There is no wire to be silent on.
_NO_WIRE = ("virtual", "udp_multicast")


def arguments(interface: str) -> dict[str, Any]:
    """Return what to add to python-can's arguments for an interface to listen only; {}: there is no way.

    >>> arguments("slcan"), arguments("socketcan")
    ({'listen_only': True}, {})
    """
    asked = dict(_ASK.get(interface, {}))
    if asked.get("state") == "PASSIVE":
        asked["state"] = python_can.load().BusState.PASSIVE
    return asked


def statement(interface: str, channel: str) -> ListenOnly:
    """Tell what holds for a bus that was opened with `arguments`; SocketCAN devices are read back.

    >>> statement("virtual", "0").says
    'listen-only: not needed, virtual is no physical bus'
    """
    if interface in _NO_WIRE:
        return ListenOnly(True, f"listen-only: not needed, {interface} is no physical bus")
    if interface == "socketcan":
        return of_device(channel, devices.link(channel))
    if interface in _ASK:
        return ListenOnly(None, f"listen-only: asked for; {interface} cannot be read back")
    return ListenOnly(
        False,
        f"listen-only: not supported by {interface}: canid never sends, but the controller acknowledges",
    )


def interfaces() -> list[str]:
    """One line per python-can interface: how it is kept from acknowledging.

    >>> [line for line in interfaces() if line.startswith("slcan")]
    ['slcan: listen-only is asked for (listen_only=True)']
    """
    lines = []
    for interface in sorted(python_can.load().VALID_INTERFACES):
        asked = ", ".join(f"{key}={value}" for key, value in _ASK.get(interface, {}).items())
        if asked:
            says = f"listen-only is asked for ({asked})"
        elif interface == "socketcan":
            says = "read back from the device; to set: ip link set CHANNEL type can listen-only on"
        elif interface in _NO_WIRE:
            says = "no physical bus"
        else:
            says = (
                "no listen-only through python-can: canid never sends, but the controller acknowledges frames"
            )
        lines.append(f"{interface}: {says}")
    return lines


def of_device(channel: str, device: devices.Device | None) -> ListenOnly:
    """Tell what holds for a SocketCAN device.

    >>> of_device("can0", devices.Device(kind="can", listen_only=True)).says
    'listen-only: yes (read back from can0)'
    """
    if device is None:
        return ListenOnly(None, f"listen-only: unknown, the system does not tell about {channel}")
    if device.kind != "can":
        kind = device.kind or "of an unknown kind"
        return ListenOnly(
            device.kind == "vcan" or None, f"listen-only: {channel} is {kind}, it has no such mode"
        )
    if device.listen_only:
        return ListenOnly(True, f"listen-only: yes (read back from {channel})")
    return ListenOnly(
        False,
        f"listen-only: no: canid never sends, but {channel} acknowledges frames; for silence: "
        f"ip link set {channel} down && ip link set {channel} up type can listen-only on",
    )
