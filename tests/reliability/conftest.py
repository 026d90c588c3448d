"""The trials of benchmarks/reliability in a shortened form: what they need of the machine."""

from __future__ import annotations

import os

import pytest

from benchmarks.reliability import needs


@pytest.fixture
def between_processes() -> None:
    """udp_multicast that stays on this machine."""
    why = needs.loopback_alone()
    # CANID_BUSES names the buses that must be there: without them the tests fail instead of being skipped
    if why and "netns" in os.environ.get("CANID_BUSES", "").split():
        pytest.fail(why)
    _skip(why)


@pytest.fixture
def mounting() -> None:
    """File systems of our own."""
    _skip(needs.mounting())


@pytest.fixture
def root() -> None:
    """A small tmpfs."""
    _skip(needs.root())


def _skip(why: str) -> None:
    if why:
        pytest.skip(why)
