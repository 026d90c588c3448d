"""A received frame, and the interface of all receivers."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from canid.io.buses.timestamp_source import TimestampSource


class Received(NamedTuple):
    """One frame as it came from a bus."""

    ns: int  # ns since 1970, or since a zero of the interface's own
    id: int
    data: bytes
    flags: int
    length: int = -1  # as in Frame


class Receiver(Protocol):
    """The receiving half of a bus; no sending half exists in this package outside `send`."""

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s for a frame; raises BusError where the bus is lost."""

    @property
    def drops(self) -> int:
        """Frames that the system is known to have dropped before they were read."""

    @property
    def clock(self) -> TimestampSource:
        """Which clock stamps the frames; known with the first one."""

    def controller(self) -> str:
        """The controller's state as the driver reports it, as in `BusStats`; "" where it does not."""

    def close(self) -> None:
        """Close the bus."""
