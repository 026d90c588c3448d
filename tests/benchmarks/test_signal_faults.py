"""The faults of the benchmark change what they say they change, and one of them is caught."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.signal_faults import drives
from benchmarks.signal_faults.__main__ import outcome
from benchmarks.signal_faults.faults import FAULTS, Fault

SIGN = next(fault for fault in FAULTS if fault.names == ("range_rate_sign",))


@pytest.fixture(scope="module")
def drive() -> drives.Drive:
    """A minute and a half; do not change it."""
    return drives.drive(81_000, 1.5)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_keeps_the_messages(fault: Fault, drive: drives.Drive) -> None:
    """Stamps ascend, values keep their length, and the drive itself is not changed."""
    before = [message.t.copy() for message in drive.messages]
    planted = fault.plant(drive.messages, 30.0, np.random.default_rng(1))
    assert len(planted) == len(before)
    for message, t in zip(planted, before, strict=True):
        assert (np.diff(message.t) >= 0.0).all()
        assert all(len(x) == len(message.t) for x in message.values.values())
        early = t < 29.0
        if fault.share:
            assert np.array_equal(message.t[early], t[early])
    assert all(np.array_equal(message.t, t) for message, t in zip(drive.messages, before, strict=True))


def test_a_wrong_sign_is_caught_and_named(drive: drives.Drive) -> None:
    found = outcome(SIGN, drive, 1.5)
    assert found.caught
    assert found.named
