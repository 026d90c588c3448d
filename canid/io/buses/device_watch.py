"""The network device of a SocketCAN bus, followed by its index through renames, changes of mode and reconnection.

A raw CAN socket is bound to a device's index, not to its name: it goes on receiving from the same device under a new
name, and never from another device that took the old name. The kernel announces every change (RTMGRP_LINK); reading
the announcements takes no lock that a slow driver may hold, so that a reader of frames may do it.
"""

from __future__ import annotations

import contextlib
import math
import socket

from canid.io.buses import devices
from canid.io.buses.devices import Device
from canid.io.buses.listen_only import of_device
from canid.values.errors import BusError

# Controller states, as in `BusStats`; a stopped or sleeping controller shows as a lost bus.
_CONTROLLER_STATES = {
    "ERROR-ACTIVE": "error_active",
    "ERROR-WARNING": "error_warning",
    "ERROR-PASSIVE": "error_passive",
    "BUS-OFF": "bus_off",
}


class DeviceWatch:
    """Follows one device and collects what changes, as (what, says) of events."""

    def __init__(self, channel: str):
        self.name = channel  # the device's present name
        self.device: Device | None = None
        self._bound = False  # whether the receiving socket is bound to the device
        self._news: list[tuple[str, str]] = []
        self._controller = ""
        # The controller's state by the latest error frame; whether an announcement may contradict it; whether all frames
        # that came before the announcement was read have been read as well.
        self._state_by_frame = ""
        self._announced = self._drained = False
        self._netlink: socket.socket | None = None

    def opened(self, name: str) -> None:
        """A socket was bound to the device that has this name."""
        if self._netlink is None:
            self._netlink = _subscribe()
        self.read_announcements()  # announcements about the previous device; the new one is queried
        device = devices.link(name)
        before, self.device = self.device, device
        self._bound = device is not None
        if device is None:
            return
        self.name = device.name
        self._state_is(device)
        if before is not None and before.ifindex != device.ifindex:
            was = f" (it was named {before.name} in between)" if before.name != device.name else ""
            self._report(
                "device_changed",
                f"socketcan {device.name} is another network device than before{was}: index {device.ifindex}, before"
                f" {before.ifindex}; it was unplugged, or deleted and created again, and is recorded in the same log",
            )
        if before is not None:
            self._compare(before, device)

    def unbound(self) -> None:
        """The socket has lost its device for good: only a new socket can receive again."""
        self._bound = False

    def resumed(self) -> bool:
        """Whether the device that the socket is bound to is up, under whatever name.

        False: it is gone, and a new socket is needed. Raises BusError while it is down: nothing else that has the
        old name is recorded instead.
        """
        self.read_announcements()
        if not self._bound or self.device is None:
            return False
        now = devices.link_of_index(self.device.ifindex)
        if now is None:
            self._bound = False
            return False
        self._changed(now)
        if not now.up:
            raise BusError(f"socketcan {now.name} is down: sudo ip link set {now.name} up")
        # a start resets the controller without an error frame
        self._state_is(now)
        return True

    def news(self) -> list[tuple[str, str]]:
        """Return the changes since the last call."""
        self.read_announcements()
        out, self._news = self._news, []
        return out

    def controller(self) -> str:
        """The controller's state where the device reports it and no error frame did, once; "" nothing new.

        The kernel announces that a controller went bus-off or came back after it has queued the error frame. Where
        all frames were read since and none contained it, that frame was dropped.
        """
        if self._announced and self._drained and self.device is not None:
            self._announced = False
            now = devices.link_of_index(self.device.ifindex)
            if now is not None and _CONTROLLER_STATES.get(now.state, "") != self._state_by_frame:
                self._state_is(now)
        state, self._controller = self._controller, ""
        return state

    def error_frame(self, state: str) -> None:
        """An error frame with the controller's state was read."""
        self._state_by_frame = state

    def drained(self) -> None:
        """The socket is empty: every frame that came before this was read or dropped."""
        self._drained = True

    def _state_is(self, device: Device) -> None:
        self._controller = self._state_by_frame = _CONTROLLER_STATES.get(device.state, "")

    def read_announcements(self) -> None:
        """Read the kernel's announcements."""
        netlink = self._netlink
        while netlink is not None:
            try:
                datagram = netlink.recv(devices.MAX_MESSAGE)
            except BlockingIOError:
                return
            except OSError:  # more announcements than fit were lost: ask for the state instead
                now = devices.link_of_index(self.device.ifindex) if self.device else None
                if now is not None:
                    self._changed(now)
                return
            for notice in devices.notices(datagram):
                if (
                    self.device is not None
                    and notice.device.ifindex == self.device.ifindex
                    and not notice.removed
                ):
                    self._changed(notice.device)

    def close(self) -> None:
        """Stop listening to announcements."""
        netlink, self._netlink = self._netlink, None
        if netlink is not None:
            netlink.close()

    def _changed(self, now: Device) -> None:
        before = self.device
        if before is None:
            return
        if not now.kind:  # an announcement without the device's details
            now = before._replace(up=now.up, name=now.name)
        self.device = now
        if now.name != before.name:
            self._report(
                "bus_renamed",
                f"socketcan {before.name} is now {now.name}: the same device (index {now.ifindex}) under another name;"
                " the recording follows the device",
            )
            self.name = now.name
        self._compare(before, now)
        if now.state in _CONTROLLER_STATES and not self._announced:
            self._announced, self._drained = True, False

    def _compare(self, before: Device, now: Device) -> None:
        if now.kind != before.kind:
            self._report(
                "device_changed", f"socketcan {now.name} is of kind {now.kind}, before {before.kind}"
            )
        if now.listen_only != before.listen_only:
            self._report("listen_only_changed", of_device(now.name, now).says)
        if not _same(now.bitrate, before.bitrate):
            says = f"socketcan {now.name}: bit rate {_rate(now.bitrate)}, before {_rate(before.bitrate)}"
            self._report("bitrate_changed", says)

    def _report(self, what: str, says: str) -> None:
        self._news.append((what, says))


def _subscribe() -> socket.socket | None:
    """A socket that gets the kernel's announcements about devices; None where there are none."""
    if not hasattr(socket, "AF_NETLINK"):
        return None
    with contextlib.suppress(OSError):
        netlink = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
        try:
            netlink.setblocking(False)
            netlink.bind((0, devices.RTMGRP_LINK))
        except OSError:
            netlink.close()
            raise
        return netlink
    return None


def _same(value: float, other: float) -> bool:
    return value == other or (math.isnan(value) and math.isnan(other))


def _rate(bitrate: float) -> str:
    return "unknown" if math.isnan(bitrate) else f"{bitrate:,.0f} bit/s"
