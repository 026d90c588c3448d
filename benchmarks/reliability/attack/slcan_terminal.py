"""An slcan adapter on a pseudo-terminal that keeps every byte which it is sent, and answers as configured."""

from __future__ import annotations

import os
import pty
import threading
import time
import tty
from contextlib import suppress

# s between two frames that an open adapter reports
EVERY_S = 0.005


class SlcanTerminal:
    """The adapter. `received`: every byte; `open`: the latest of L and O that it was sent since the last C."""

    def __init__(self, answers: dict[bytes, bytes], noise: bytes = b"", left_active: bool = False):
        """`answers`: by a command's first letter, b"" for any other; `noise` comes between frames."""
        self.received = b""
        self.open = "O" if left_active else ""
        self._answers = answers
        self._noise = noise
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.channel = os.ttyname(self._slave)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def commands(self) -> list[bytes]:
        """Everything that it was sent, by line; what has no end yet too."""
        time.sleep(0.1)  # what was written may still be on its way to the thread
        return [part for part in self.received.split(b"\r") if part]

    def close(self) -> None:
        """Unplug it."""
        self._ended.set()
        self._thread.join(5.0)
        for fd in (self._master, self._slave):
            with suppress(OSError):
                os.close(fd)

    def _run(self) -> None:
        os.set_blocking(self._master, False)
        begun, number = b"", 0
        while not self._ended.wait(EVERY_S):
            try:
                got = os.read(self._master, 4096)
            except BlockingIOError:
                got = b""
            except OSError:
                return
            self.received += got
            *commands, begun = (begun + got).split(b"\r")
            for command in commands:
                letter = command[:1]
                answer = self._answers.get(letter, self._answers.get(b"", b""))
                if letter == b"C":
                    self.open = ""
                elif letter in (b"L", b"O") and answer != b"\a":
                    self.open = letter.decode()
                self._say(answer)
            if self.open:
                self._say(b"t%03X4%08X\r" % (number % 0x800, number) + self._noise)
                number += 1

    def _say(self, text: bytes) -> None:
        with suppress(OSError):  # no reader
            os.write(self._master, text)
