"""What every test runs under: signals as in a terminal's foreground, and one seed for whatever is drawn."""

from __future__ import annotations

import signal
from types import FrameType

import pytest

from tests import seeds
from tests.fixtures.browser import browser

__all__ = ["browser"]


def _nothing(number: int, frame: FrameType | None) -> None:
    """A handler instead of SIG_IGN: this process ignores the signal, programs that it starts get the default."""


def pytest_configure() -> None:
    """`make test &` in a script and nohup ignore signals, and a program inherits what is ignored."""
    for name in ("SIGINT", "SIGHUP", "SIGQUIT"):
        number = getattr(signal, name, None)  # Windows has the first one alone
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, _nothing)


def pytest_report_header() -> str:
    """How to run it again."""
    return f"{seeds.VARIABLE}={seeds.SEED}"


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """A seed of this test's own, another one in each run; a failure prints it."""
    drawn = seeds.seed(request.node.nodeid)
    print(f"seed {drawn}; the same again: {seeds.VARIABLE}={seeds.SEED}")
    return drawn
