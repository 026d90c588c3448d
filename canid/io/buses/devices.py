"""CAN network devices: kind, mode, bit rate and controller state, read from the kernel over rtnetlink.

What `ip -details link show` prints, without a process for each question (rtnetlink(7); linux/rtnetlink.h,
linux/if_link.h, linux/can/netlink.h).
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import NamedTuple

from canid.values.types import NAN

# linux/netlink.h, linux/rtnetlink.h
_MESSAGE_HEADER = Struct("=IHHII")  # length, type, flags, sequence number, port
_IFINFO = Struct("=BxHiII")  # family, type of hardware, index, flags, change
_ATTRIBUTE = Struct("=HH")  # length, type
_ERROR, _NEW_LINK, _DEL_LINK, _GET_LINK = 2, 16, 17, 18
_REQUEST = 1
RTMGRP_LINK = 1
_IFF_UP = 1
# The upper two bits of an attribute's type are flags (nested, network byte order).
_TYPE = 0x3FFF
# linux/if_link.h
_IFNAME, _LINKINFO = 3, 18
_INFO_KIND, _INFO_DATA = 1, 2
# linux/can/netlink.h
_CAN_BITTIMING, _CAN_STATE, _CAN_CTRLMODE = 1, 4, 5
_LISTENONLY = 0x02
_U32 = Struct("=I")
_CTRLMODE = Struct("=II")  # mask, flags
_STATES = ("ERROR-ACTIVE", "ERROR-WARNING", "ERROR-PASSIVE", "BUS-OFF", "STOPPED", "SLEEPING")
# One device's answer has some 1,500 bytes; netlink(7) advises 8 kB and more.
MAX_MESSAGE = 65536
# s that the kernel may take to answer; it answers in microseconds, but a start must never hang
TIMEOUT_S = 5.0


class Device(NamedTuple):
    """A network device."""

    kind: str = ""  # "can", "vcan", ...; "" unknown
    up: bool = False
    listen_only: bool = False
    bitrate: float = NAN  # bit/s; NaN: unknown, as on vcan
    state: str = ""  # ERROR-ACTIVE, ERROR-WARNING, ERROR-PASSIVE, BUS-OFF, STOPPED, SLEEPING; "" unknown
    ifindex: int = 0  # identifies the device while it exists, under whatever name; 0: unknown
    name: str = ""


class Notice(NamedTuple):
    """A message about one device: its present state, or that it was removed."""

    device: Device
    removed: bool = False


def link(channel: str) -> Device | None:
    """Ask the kernel about one device; None where it has none of that name, or no rtnetlink.

    >>> link("no-such-device") is None
    True
    """
    return _ask(0, channel)


def link_of_index(index: int) -> Device | None:
    """Ask the kernel about the device with this index, under whatever name; None where it is gone.

    >>> link_of_index(2_000_000_000) is None
    True
    """
    return _ask(index, "") if index > 0 else None


def _ask(index: int, name: str) -> Device | None:
    if not hasattr(socket, "AF_NETLINK") or len(name.encode()) > 15:  # linux/if.h: IFNAMSIZ
        return None
    body = _IFINFO.pack(0, 0, index, 0, 0)
    if name:
        body += _padded(_IFNAME, name.encode() + b"\0")
    request = _MESSAGE_HEADER.pack(_MESSAGE_HEADER.size + len(body), _GET_LINK, _REQUEST, 1, 0) + body
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as netlink:
            netlink.settimeout(TIMEOUT_S)
            netlink.sendto(request, (0, 0))
            answer = netlink.recv(MAX_MESSAGE)
    except (OSError, ValueError):
        return None
    return next((notice.device for notice in notices(answer)), None)


def notices(datagram: bytes) -> Iterator[Notice]:
    """The devices in a datagram of rtnetlink; errors, other messages and incomplete ones are skipped.

    >>> info = _padded(_LINKINFO, _padded(_INFO_KIND, b"vcan"))
    >>> body = _IFINFO.pack(0, 280, 7, 1, 0) + _padded(_IFNAME, b"can0" + bytes(1)) + info
    >>> [notice] = notices(_MESSAGE_HEADER.pack(16 + len(body), _NEW_LINK, 0, 0, 0) + body)
    >>> notice.device.kind, notice.device.ifindex, notice.device.name, notice.device.up
    ('vcan', 7, 'can0', True)
    >>> list(notices(b"")), list(notices(bytes(40)))
    ([], [])
    """
    at = 0
    while at + _MESSAGE_HEADER.size <= len(datagram):
        length, kind, _, _, _ = _MESSAGE_HEADER.unpack_from(datagram, at)
        if length < _MESSAGE_HEADER.size or at + length > len(datagram):
            return
        if kind in (_NEW_LINK, _DEL_LINK) and length >= _MESSAGE_HEADER.size + _IFINFO.size:
            yield Notice(_device(datagram[at + _MESSAGE_HEADER.size : at + length]), kind == _DEL_LINK)
        at += -(-length // 4) * 4


def _device(message: bytes) -> Device:
    _, _, index, flags, _ = _IFINFO.unpack_from(message)
    attributes = _attributes(message[_IFINFO.size :])
    info = _attributes(attributes.get(_LINKINFO, b""))
    kind = _text(info.get(_INFO_KIND, b""))
    # the numbers of the attributes below are those of kind "can"; vxcan has others under the same numbers
    can = _attributes(info.get(_INFO_DATA, b"")) if kind == "can" else {}
    bitrate = _numbers(can.get(_CAN_BITTIMING, b""), _U32)
    state = _numbers(can.get(_CAN_STATE, b""), _U32)
    mode = _numbers(can.get(_CAN_CTRLMODE, b""), _CTRLMODE)
    return Device(
        kind=kind,
        up=bool(flags & _IFF_UP),
        listen_only=bool(mode and mode[1] & _LISTENONLY),
        bitrate=_bitrate(bitrate),
        state=_STATES[state[0]] if state and state[0] < len(_STATES) else "",
        ifindex=index,
        name=_text(attributes.get(_IFNAME, b"")),
    )


def _bitrate(words: tuple[int, ...]) -> float:
    """Bit/s. slcan writes 0 or 2**32 - 1 where none was set (CAN_BITRATE_UNSET, CAN_BITRATE_UNKNOWN)."""
    return float(words[0]) if words and words[0] not in (0, 0xFFFF_FFFF) else NAN


def _numbers(value: bytes, layout: Struct) -> tuple[int, ...]:
    try:
        return layout.unpack_from(value)
    except StructError:
        return ()


def _text(value: bytes) -> str:
    return value.split(b"\0")[0].decode("utf-8", "replace")


def _attributes(data: bytes) -> dict[int, bytes]:
    """Attributes (struct rtattr) by type."""
    attributes: dict[int, bytes] = {}
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if length < _ATTRIBUTE.size:
            break
        attributes[kind & _TYPE] = data[at + _ATTRIBUTE.size : at + length]
        at += -(-length // 4) * 4
    return attributes


def _padded(kind: int, value: bytes) -> bytes:
    """Encode one attribute."""
    length = _ATTRIBUTE.size + len(value)
    return _ATTRIBUTE.pack(length, kind) + value + bytes(-length % 4)
