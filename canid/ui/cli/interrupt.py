"""Signals that end a command: Ctrl-C, SIGTERM and a closed terminal, polled by loops or raised as exceptions."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from canid.ui.terminal import open_terminal, streams
from canid.values.errors import CanidError

# sent by a closed ssh session or terminal; Windows has no such signal
HANGUP: int | None = getattr(signal, "SIGHUP", None)
# sent by a terminal, a service manager and a closed ssh session
SIGNALS = (signal.SIGINT, signal.SIGTERM, *(() if HANGUP is None else (HANGUP,)))
# s until a signal whose exception was dropped is sent again
AGAIN_S = 0.02


class Interrupt:
    """`with Interrupt() as stop:` — `stop()` is True after a signal; a second signal ends the process at once.

    So does the first one after `end_at_once`.
    """

    def __init__(self) -> None:
        """No signal yet."""
        self.signal = 0
        self._at_once = False
        self._before: dict[int, object] = {}

    def __call__(self) -> bool:
        """Whether a signal has come."""
        return bool(self.signal)

    def end_at_once(self) -> None:
        """The end has begun without a signal, and it was said that a signal now ends it at once."""
        self._at_once = True

    def __enter__(self) -> Interrupt:
        """Install the handlers."""
        for number in SIGNALS:
            if number == HANGUP and signal.getsignal(number) is signal.SIG_IGN:
                continue  # nohup: a terminal that closes must not end the session
            # SIGINT is handled even where a script's background job starts with it ignored: `kill -INT` must end a
            # recording cleanly, as it ends candump and tcpdump
            self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the earlier handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _note(self, number: int, _: FrameType | None) -> None:
        if self.signal or self._at_once:
            open_terminal.restore_at_once()
            os._exit(128 + number)
        self.signal = number

    @property
    def code(self) -> int:
        """The exit code of an interrupted program: 130 for Ctrl-C, 143 for SIGTERM."""
        return 128 + self.signal


class Ended(KeyboardInterrupt):
    """SIGTERM or SIGHUP, raised like Ctrl-C: files are closed on the way out."""

    def __init__(self, number: int) -> None:
        """Keep the exit code of the signal."""
        super().__init__(number)
        self.code = 128 + number


@contextmanager
def ending() -> Iterator[None]:
    """Raise KeyboardInterrupt or `Ended` on a signal, for verbs without a loop that polls `Interrupt`.

    A signal that the parent process ignores (nohup, a background job of a shell) stays ignored. Libraries make errors of
    their own of such an exception (numpy an ImportError, while it is imported): it is raised again in their place. Python
    itself drops one that is raised while a finaliser or a weak reference's callback runs: the signal is sent again then.
    """
    raised: list[KeyboardInterrupt] = []
    report = sys.unraisablehook

    def dropped(unraisable: sys.UnraisableHookArgs) -> None:
        error = unraisable.exc_value
        if not any(error is each for each in raised):
            report(unraisable)
            return
        number = error.code - 128 if isinstance(error, Ended) else signal.SIGINT
        # not in this call, which would drop it as well
        again = threading.Timer(AGAIN_S, _send, (number,))
        again.daemon = True
        again.start()

    def end(number: int, _: FrameType | None) -> None:
        streams.hurry()  # messages on the way out wait for no reader
        raised.append(KeyboardInterrupt() if number == signal.SIGINT else Ended(number))
        raise raised[-1]

    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread can set handlers
        return
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.signal(number, end) for number in SIGNALS if signal.getsignal(number) in usual}
    sys.unraisablehook = dropped
    try:
        yield
    except (CanidError, OSError):
        raise  # canid's own, such as of a file that could not be completed
    except Exception:
        if raised:
            raise raised[-1] from None
        raise
    finally:
        sys.unraisablehook = report
        for number, handler in before.items():
            signal.signal(number, handler)


def _send(number: int) -> None:
    """Send a signal to the main thread, or what comes nearest to that where the system cannot."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)
    else:
        _thread.interrupt_main(signal.Signals(number))
