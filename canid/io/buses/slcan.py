"""Listen-only slcan: python-can's slcan bus, restricted to the commands that configure and close the adapter.

The commands are those of Lawicel's CAN232 (manual of version 3): C closes the channel, S and s set the bit rate, Y is
CANable's data bit rate, L opens the channel in listen-only mode, O opens it as an active node. canid writes the first
five; every other one is refused here, whatever asks for it.
"""

from __future__ import annotations

import re
import time
from functools import cache
from typing import Any

from canid.io.buses import python_can
from canid.values.errors import BusError

# "" is what python-can writes for "no data bit rate"
_CONFIGURING = re.compile(r"C|L|S[0-9]|s[0-9A-Fa-f]{4}|Y[0-9]|", re.ASCII)
# s; an adapter answers a command within one USB turn (1 to 16 ms), one behind a network, or a busy machine, within this
_ANSWER_S = 0.5
# s without a byte, once every command before was answered: nothing more is on its way
_QUIET_S = 0.03
# s in all that the answers to commands before L are waited for; a channel that stays open goes on sending frames
_MAX_SETTLE_S = 1.0
_POLL_S = 0.005  # s between two checks for an answer
# an adapter's answers
DONE, REFUSED = b"\r", b"\a"
# a confirmation followed by a frame: the channel is open
_OPEN = re.compile(rb"\r\r*[tTrRdDbB]")


@cache
def listening_class() -> Any:
    """Make python-can's slcanBus one that opens with L and refuses to write O, t, T, r, R and all the rest."""
    base = python_can.bus_class("slcan")

    class ListeningSlcanBus(base):  # type: ignore[misc, valid-type]
        """slcan, listen-only."""

        written: tuple[str, ...] = ()  # every command, in order
        answer: bytes = b""  # to the latest L; empty: none came
        _answered = 0  # commands whose answers were waited for

        def _write(self, string: str) -> None:
            if not _CONFIGURING.fullmatch(string):
                raise BusError(f"canid does not write {string[:20]!r} to an slcan adapter: it listens only")
            self.written += (string,)
            super()._write(string)

        def open(self) -> None:
            """Close, in case another program left the channel open as an active node; then L."""
            self.close()
            self._settle()
            self._write("L")
            first = self._answer_to_l()
            self.answer, rest = first[:1], first[1:]
            if REFUSED in first:
                self.answer, rest = REFUSED, b""
            elif self.answer != DONE:
                self.answer, rest = b"", first
            self._buffer.extend(rest)

        def _settle(self) -> None:
            """Wait for the answers to all commands before, so that none of them is taken for that to L."""
            got, end = b"", time.monotonic() + _MAX_SETTLE_S
            heard = time.monotonic()
            expected = sum(map(bool, self.written)) - self._answered
            self._answered += expected
            while time.monotonic() < end:
                more = self._waiting()
                got += more
                missing = expected > got.count(DONE) + got.count(REFUSED)
                if more:
                    heard = time.monotonic()
                elif time.monotonic() - heard >= (_ANSWER_S if missing else _QUIET_S):
                    return
                else:
                    time.sleep(_POLL_S)

        def _answer_to_l(self) -> bytes:
            """What the adapter sends after L: until it refuses, is quiet, or confirms and sends the first frame."""
            got, end = b"", time.monotonic() + _ANSWER_S
            heard = 0.0
            while time.monotonic() < end and REFUSED not in got and not _OPEN.match(got):
                more = self._waiting()
                got += more
                if more:
                    heard = time.monotonic()
                elif heard and time.monotonic() - heard >= _QUIET_S:
                    break
                else:
                    time.sleep(_POLL_S)
            return got

        def _waiting(self) -> bytes:
            waiting = self.serialPortOrig.in_waiting
            return bytes(self.serialPortOrig.read(waiting)) if waiting else b""

        def _recv_internal(self, timeout: float | None) -> Any:
            try:
                return super()._recv_internal(timeout)
            except Exception:
                # a line that is no text would otherwise stay in front of every later one
                self._buffer.clear()
                raise

    return ListeningSlcanBus


def was_opened_silently(bus: Any) -> bool:
    """Whether the adapter was opened with L, after C, and never with O.

    >>> class Bus: written = ("C", "S6", "", "C", "L", "C", "L")
    >>> was_opened_silently(Bus()), was_opened_silently(object())
    (True, False)
    """
    written: tuple[str, ...] = getattr(bus, "written", ())
    # the commands after the last C are in effect
    return "C" in written and "L" in written[_last(written, "C") :] and "O" not in written


def _last(words: tuple[str, ...], word: str) -> int:
    return len(words) - 1 - words[::-1].index(word)
