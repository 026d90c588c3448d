"""Stamps that jitter are found; lost frames, pauses and slow messages are not."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.samples import stamps
from canid.signals.signal_checks import signal_checks
from canid.values.types import Driver
from tests import seeds
from tests.signal_checks.synthetic import following, samples


def spans(t: np.ndarray, cuts: int = 1) -> list[stamps.StampIntervals]:
    """The intervals of these stamps, in so many parts."""
    state, out = stamps.init(), []
    for part in np.array_split(np.arange(len(t)), cuts):
        state, found = stamps.step(state, "gap", t[part], part)
        out += [span for _, span in found]
    return out


def stamped(kind: str, rng: np.random.Generator) -> np.ndarray:
    t = np.arange(0.0, 60.0, 0.05)
    if kind == "bursts":
        return np.sort((np.floor(t / 0.3) + 1) * 0.3 + 0.001 * np.arange(len(t)) % 0.3 * 0.01)
    if kind == "jitter":
        return np.sort(t + rng.exponential(0.1, len(t)))
    if kind == "lost of 10 Hz":
        return (t[::2] + 0.003 * rng.random(len(t[::2])))[rng.random(len(t[::2])) > 0.75]
    if kind.startswith("lost"):
        return t[rng.random(len(t)) > float(kind.removeprefix("lost "))]
    if kind == "bursts in ms":
        return np.round(np.floor(t / 0.3) * 0.3 + 0.001 * (np.arange(len(t)) % 6), 3)
    if kind == "pauses":
        return t[(t % 20.0) > 3.0]
    if kind == "slow":
        return np.arange(0.0, 60.0, 0.5) + 0.01 * rng.random(120)
    return t + 0.002 * rng.random(len(t))


def named(kind: str, seed: int) -> set[str]:
    """Findings on stamps of this kind."""
    waiting = spans(stamped(kind, np.random.default_rng(seed)))
    state, names = signal_checks.init(), set()
    for sample in samples(following(3, 1.0)):
        while waiting and waiting[0].t <= sample.t:
            state = signal_checks.put(state, waiting.pop(0))
        state, report = signal_checks.step(state, sample, Driver(), 0.1)
        names |= {one.name for one in report.findings} if report is not None else set()
    return names & {"stamps_jitter", "messages_lost"}


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("bursts", {"stamps_jitter"}), ("bursts in ms", {"stamps_jitter"}), ("lost 0.15", set()), ("pauses", set()),
     ("slow", set()), ("even", set())],
)  # fmt: skip
def test_bursts_are_found_and_lost_frames_are_not(kind: str, expected: set[str], seed: int) -> None:
    """Frames that are stamped when an adapter is read, against all that is no jitter."""
    assert named(kind, seed) == expected


@pytest.mark.parametrize("kind", ["lost 0.8", "lost of 10 Hz"])
@seeds.mostly(0.8)
def test_most_messages_lost_have_a_name_of_their_own(kind: str, seed: int) -> None:
    """Of 20 Hz, and of 10 Hz with stamps of 3 ms of jitter.

    The intervals are geometric, with a standard deviation of the root of the share that is lost times their mean. Of three
    quarters, 25 in ten seconds are below 0.7 of it in 1 of 8 spans, and in 8 % of these minutes no two spans in a row are
    above (200 and 200 seeds: 0.99 and 0.87 are named so, and nothing else).
    """
    assert named(kind, seed) == {"messages_lost"}


def test_sums_do_not_depend_on_the_division(seed: int) -> None:
    """Whole numbers are summed: any division gives the same intervals."""
    t = stamped("jitter", np.random.default_rng(seed))
    assert spans(t) == spans(t, 7) == spans(t, len(t))
