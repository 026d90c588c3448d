"""What a bus hands over, and what every bus can do: receive, and nothing else."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from canid.frames.stamp_clock import StampClock


class Received(NamedTuple):
    """One frame as it came from a bus."""

    ns: int  # ns since 1970, or since some zero of the interface's own
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
        """Frames that the system is known to have dropped before we could read them."""

    @property
    def clock(self) -> StampClock:
        """Which clock stamps the frames; known with the first one."""

    def controller(self) -> str:
        """What the driver says of the controller, as in `BusStats`; "" where it says nothing."""

    def close(self) -> None:
        """Let go of the bus."""
