"""Which clock stamped a frame: times are worth no more than that."""

from __future__ import annotations

from enum import Enum


class StampClock(Enum):
    """The value completes "times are stamped by ..."."""

    UNKNOWN = "a clock that is not known yet"
    HARDWARE = "the interface's own clock (hardware)"
    KERNEL = "the kernel's clock, on arrival"
    DRIVER = "the interface or its driver"
    SENDER = "the sender's clock"
    HOST = "canid, on receipt"


# python-can 4.6: udp_multicast asks the kernel (SO_TIMESTAMPNS), virtual hands on what the sender put in
_KNOWN = {
    "udp_multicast": StampClock.KERNEL,
    "virtual": StampClock.SENDER,
}


def of_interface(interface: str, *, stamped: bool) -> StampClock:
    """Tell the clock of an interface that is read through python-can.

    >>> of_interface("udp_multicast", stamped=True).value, of_interface("serial", stamped=False).name
    ("the kernel's clock, on arrival", 'HOST')
    """
    return _KNOWN.get(interface, StampClock.DRIVER) if stamped else StampClock.HOST
