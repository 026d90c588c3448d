"""A session ends when it is asked to."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.analysis.session.session import SessionSettings, session
from canid.io.buses.bus_opener import open_buses

# s: longer than a session waits for a result before it asks whether it should stop
SLOW = 0.2


@pytest.fixture
def slow_signal() -> Iterator[list[int]]:
    """SIGUSR1 takes its time, as any signal does on a busy machine or in a process that stood still."""
    came: list[int] = []

    def note(number: int, _: object) -> None:
        time.sleep(SLOW)
        came.append(number)

    before = signal.signal(signal.SIGUSR1, note)
    yield came
    signal.signal(signal.SIGUSR1, before)


def test_a_signal_that_is_answered_late_ends_the_session(tmp_path: Path, slow_signal: list[int]) -> None:
    """In CPython before 3.13 `SimpleQueue.get(timeout=...)` does not return after such a signal."""
    buses = open_buses([{"interface": "virtual", "channel": str(tmp_path)}])
    kill = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGUSR1))
    kill.start()
    reports = list(
        session(buses, SessionSettings(record=tmp_path / "a.blf"), stopped=lambda: bool(slow_signal))
    )
    kill.join()
    assert slow_signal == [signal.SIGUSR1]
    assert reports[-1].recorder.state == "stopped"  # type: ignore[union-attr]
