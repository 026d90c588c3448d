"""A signal ends a verb with its exit code, whatever a library makes of the exception that it raises."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from canid.cli.interrupt import Ended, ending
from canid.values.errors import OutputError


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
from canid.cli.interrupt import Interrupt
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
