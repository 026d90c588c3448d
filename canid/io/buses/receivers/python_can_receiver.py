"""Receiving through python-can's own `recv`, for every interface that has no receiver of canid's."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import Any

from canid.io.buses import messages, python_can, timestamp_source
from canid.io.buses.frame_check import ImpossibleFrameError
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.errors import BusError, one_line

# What a back end raises when it cannot parse one message. Drivers and lost devices raise OSError or CanError.
_PARSING = (ValueError, TypeError, LookupError, ArithmeticError, AssertionError, struct.error)
# s of nothing but such errors after which the bus counts as lost: opening it again may help
_ONLY_ERRORS_S = 2.0
# so many of them in a row are slowed down: a back end that raises at once would take a whole core
_MANY_ERRORS = 1000


class PythonCanReceiver:
    """Receives from any python-can bus; `count` is a function that counts drops outside python-can."""

    def __init__(self, bus: Any, name: str, count: Callable[[], int] = lambda: 0):
        # the methods, not the bus: what is not here cannot be called
        self._recv = bus.recv
        self._shutdown = bus.shutdown
        self._state = _state_of(bus)
        self._name = name
        self._count = count
        self._errors = 0  # in a row
        self._errors_since = 0.0  # s, monotonic clock
        self.clock = TimestampSource.UNKNOWN

    @property
    def drops(self) -> int:
        """Frames that the system is known to have dropped."""
        return self._count()

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s; raises BusError where the bus is lost, ImpossibleFrameError for no frame."""
        try:
            message = self._recv(timeout)
        except Exception as error:  # back ends raise errors of their own kinds
            if not _about_one_message(error) or self._too_many():
                raise BusError(f"{self._name} is lost: {one_line(error)}") from None
            raise ImpossibleFrameError(f"python-can cannot understand it ({type(error).__name__})") from None
        self._errors = 0
        if message is None:
            return None
        try:
            return self._received(message)
        except ImpossibleFrameError:
            raise
        except Exception as error:  # whatever stands in the fields of a Message
            raise ImpossibleFrameError(f"it holds nonsense ({type(error).__name__})") from None

    def controller(self) -> str:
        """The controller's state as the driver reports it."""
        return self._state()

    def close(self) -> None:
        """Close the bus."""
        self._shutdown()

    def _received(self, message: Any) -> Received:
        received = messages.received_of(message, time.time_ns())
        if self.clock is TimestampSource.UNKNOWN:
            stamped = bool(message.timestamp)
            self.clock = timestamp_source.of_interface(self._name.partition(" ")[0], stamped=stamped)
        return received

    def _too_many(self) -> bool:
        now = time.monotonic()
        if not self._errors:
            self._errors_since = now
        self._errors += 1
        if self._errors > _MANY_ERRORS:
            time.sleep(0.001)
        return now - self._errors_since > _ONLY_ERRORS_S


def _about_one_message(error: BaseException) -> bool:
    """Whether an error of `recv` is about one message, not about the bus."""
    cause: BaseException | None = error
    if isinstance(error, python_can.load().CanError):  # python-can wraps what its parser raised
        cause = error.__cause__
    return isinstance(cause, _PARSING) or type(cause).__module__.partition(".")[0] == "msgpack"


def _state_of(bus: Any) -> Callable[[], str]:
    """A function for the controller's state as the driver reports it; most do not, and the base class returns ACTIVE.

    A PASSIVE that was asked for (pcan, systec: listen-only) is not about errors.
    """
    can = python_can.load()
    if getattr(type(bus), "state", None) is can.BusABC.state:
        return lambda: ""
    words = {can.BusState.ACTIVE: "error_active", can.BusState.PASSIVE: "error_passive"}

    def state() -> str:
        try:
            return "bus_off" if bus.state is can.BusState.ERROR else words.get(bus.state, "")
        except Exception:  # back ends raise errors of their own kinds; `recv` will raise too
            return ""

    if state() == "error_passive":
        del words[can.BusState.PASSIVE]
    return state
