"""slcan for listening: python-can's slcan bus, which can write nothing but what configures and closes the adapter.

The commands are those of Lawicel's CAN232 (manual of version 3): C closes the channel, S and s set the bit rate, Y is
CANable's data bit rate, L opens the channel in listen-only mode, O opens it as an active node. canid writes the first
five; every other one is refused here, whatever asks for it.
"""

from __future__ import annotations

import re
import time
from functools import cache
from typing import Any

from canid.errors import BusError
from canid.frames import python_can

# "" is what python-can writes for "no data bit rate"
_CONFIGURING = re.compile(r"C|L|S[0-9]|s[0-9A-Fa-f]{4}|Y[0-9]|", re.ASCII)
# s; an adapter answers a command within one USB turn (1 to 16 ms), one behind a network within this
_ANSWER = 0.2
# s without a byte: what was in the pipe before is over
_QUIET = 0.03
_LOOK = 0.005  # s between two looks for an answer
# an adapter's answers
DONE, REFUSED = b"\r", b"\a"


@cache
def listening_class() -> Any:
    """Make python-can's slcanBus one that opens with L and refuses to write O, t, T, r, R and all the rest."""
    base = python_can.bus_class("slcan")

    class ListeningSlcanBus(base):  # type: ignore[misc, valid-type]
        """slcan, listen-only."""

        written: tuple[str, ...] = ()  # every command, in order
        answer: bytes = b""  # to the latest L; empty: none came

        def _write(self, string: str) -> None:
            if not _CONFIGURING.fullmatch(string):
                raise BusError(f"canid does not write {string[:20]!r} to an slcan adapter: it listens only")
            self.written += (string,)
            super()._write(string)

        def open(self) -> None:
            """Close, in case another program left the channel open as an active node; then L."""
            self.close()
            self._bytes(_ANSWER, _QUIET)
            self._write("L")
            first = self._bytes(_ANSWER, 0.0)
            self.answer, rest = first[:1], first[1:]
            if self.answer not in (DONE, REFUSED):
                self.answer, rest = b"", first
            self._buffer.extend(rest)

        def _bytes(self, longest: float, quiet: float) -> bytes:
            """What the adapter sends within `longest` s, until it is quiet; quiet 0: until the first bytes."""
            got = b""
            end = time.monotonic() + longest
            until = time.monotonic() + quiet if quiet else end
            while time.monotonic() < min(until, end):
                waiting = self.serialPortOrig.in_waiting
                if waiting:
                    got += self.serialPortOrig.read(waiting)
                    if not quiet:
                        break
                    until = time.monotonic() + quiet
                else:
                    time.sleep(_LOOK)
            return got

        def _recv_internal(self, timeout: float | None) -> Any:
            try:
                return super()._recv_internal(timeout)
            except Exception:
                # a line that is no text would otherwise stand before every later one
                self._buffer.clear()
                raise

    return ListeningSlcanBus


def was_opened_silently(bus: Any) -> bool:
    """Tell whether the adapter was opened with L, after C, and was never told to take part.

    >>> class Bus: written = ("C", "S6", "", "C", "L", "C", "L")
    >>> was_opened_silently(Bus()), was_opened_silently(object())
    (True, False)
    """
    written: tuple[str, ...] = getattr(bus, "written", ())
    # what stands behind the last C holds now
    return "C" in written and "L" in written[_last(written, "C") :] and "O" not in written


def _last(words: tuple[str, ...], word: str) -> int:
    return len(words) - 1 - words[::-1].index(word)
