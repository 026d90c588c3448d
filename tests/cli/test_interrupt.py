"""A signal ends a verb with its exit code, whatever a library makes of the exception that it raises."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from canid.ui.cli.interrupt import SIGNALS, Ended, ending
from canid.values.errors import OutputError

# s; a signal that is lost is waited for so long
PATIENCE_S = 20.0


def interrupted_import(number: int) -> None:
    """What numpy does when a signal comes while it is imported."""
    try:
        os.kill(os.getpid(), number)
    except KeyboardInterrupt as error:
        raise ImportError("PyCapsule_Import could not import module") from error


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_library_that_turns_a_signal_into_its_own_error_does_not_hide_it(number: int, code: int) -> None:
    with pytest.raises(Ended) as found, ending():
        interrupted_import(number)
    assert found.value.code == code


def test_ctrl_c_stays_one() -> None:
    with pytest.raises(KeyboardInterrupt), ending():
        interrupted_import(signal.SIGINT)


def test_an_error_without_a_signal_stays_what_it_is() -> None:
    with pytest.raises(ImportError), ending():
        raise ImportError("really missing")


def unwritable(number: int) -> None:
    """A file that is being completed on the way out, and cannot be."""
    try:
        os.kill(os.getpid(), number)
    except KeyboardInterrupt as error:
        raise OutputError("x.json: cannot be written") from error


def test_a_file_that_could_not_be_completed_is_still_reported() -> None:
    with pytest.raises(OutputError), ending():
        unwritable(signal.SIGTERM)


POLLED = """
import os, signal, sys
from canid.ui.cli.interrupt import Interrupt
with Interrupt() as stop:
    if sys.argv[1] == "announced":
        stop.end_at_once()
    os.kill(os.getpid(), signal.SIGTERM)
    print(stop(), stop.code)
"""


@pytest.mark.parametrize(
    ("when", "code", "printed"), [("announced", 143, ""), ("not announced", 0, "True 143\n")]
)
def test_the_first_signal_ends_a_program_that_has_said_so(when: str, code: int, printed: str) -> None:
    """At the end that --duration began no signal has come before, and the line that is shown promises one."""
    done = subprocess.run([sys.executable, "-c", POLLED, when], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (code, printed)


class Finalised:
    """Ends this process while it is finalised."""

    def __init__(self, number: int):
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)


def ended_and_waiting(number: int) -> None:
    """A signal in a finaliser, then work."""
    Finalised(number)
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        time.sleep(0.01)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_in_a_finaliser_is_not_lost(number: int) -> None:
    """Python drops what is raised there, as in callbacks of weak references: while modules are imported, for one."""
    with pytest.raises(KeyboardInterrupt) as found, ending():
        ended_and_waiting(number)
    assert getattr(found.value, "code", 128 + signal.SIGINT) == 128 + number


class Failing:
    """Raises an error while it is finalised."""

    def __del__(self) -> None:
        raise ValueError("a finaliser's own")


def test_another_error_in_a_finaliser_is_reported_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    reported: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda error: reported.append(error.exc_type))
    with ending():
        Failing()
    assert reported == [ValueError]
