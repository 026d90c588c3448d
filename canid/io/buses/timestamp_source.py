"""The clock that stamps the frames of a bus."""

from __future__ import annotations

from enum import Enum


class TimestampSource(Enum):
    """The value completes "times are stamped by ..."."""

    UNKNOWN = "a clock that is not known yet"
    HARDWARE = "the interface's own clock (hardware)"
    KERNEL = "the kernel's clock, on arrival"
    DRIVER = "the interface or its driver"
    SENDER = "the sender's clock"
    HOST = "canid, on receipt"


# python-can 4.6: udp_multicast asks the kernel (SO_TIMESTAMPNS), virtual forwards the sender's stamp
_KNOWN = {
    "udp_multicast": TimestampSource.KERNEL,
    "virtual": TimestampSource.SENDER,
}


def of_interface(interface: str, *, stamped: bool) -> TimestampSource:
    """The clock of an interface that is read through python-can.

    >>> of_interface("udp_multicast", stamped=True).value, of_interface("serial", stamped=False).name
    ("the kernel's clock, on arrival", 'HOST')
    """
    return _KNOWN.get(interface, TimestampSource.DRIVER) if stamped else TimestampSource.HOST
