"""Real platoons: what comes out for people and for factory ACC, next to a plain least-squares fit made here.

`python tests/test_openacc.py` prints the table of docs/results.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import canid
from canid.mathematics.identification import identifiability
from canid.values.text import estimate_text
from canid.values.types import Channel, Identifiable, Status, Trace
from tests.fixtures.measured_logs import MEASURED, needs_measured

DATA = MEASURED / "openacc"
NAMES = ("human_h22_v3", "human_h22_v5", "human_h22_v6", "acc_short_h2_v4", "acc_long_h10_v5")
pytestmark = needs_measured


class Plain(NamedTuple):
    """accel(t) = b + K1 headway_error(t − d) + K2 range_rate(t − d), least squares, best d of a grid."""

    K1: float
    K2: float
    delay: float  # s


def least_squares(trace: Trace) -> Plain:
    best, found = np.inf, Plain(np.nan, np.nan, np.nan)
    usable = trace.learn & np.isfinite(trace.inputs).all(axis=1)
    for d in range(26):
        rows = np.flatnonzero(usable)
        rows = rows[(rows >= 26)]
        rows = rows[usable[rows - d] & (trace.segment[rows] == trace.segment[rows - d])]
        X = np.column_stack([trace.inputs[rows - d], np.ones(rows.size)])
        theta, *_ = np.linalg.lstsq(X, trace.output[rows], rcond=None)
        error = float(np.mean((trace.output[rows] - X @ theta) ** 2))
        if error < best:
            best, found = error, Plain(float(theta[0]), float(theta[1]), d * trace.dt)
    return found


def estimates(name: str) -> tuple[Channel, list[Channel], Plain]:
    """The whole drive's answer to range rate, the windows' answers that are ok, and plain least squares."""
    trace = canid.read_trace(DATA / f"{name}.blf", "openacc")
    drive = canid.identify(trace, select_orders=False)
    windows = [
        e.channels["range_rate"]
        for e in drive.windows
        if e.estimator == "fopdt"
        and e.status is Status.OK
        and e.channels["range_rate"].status is not Identifiable.NOT
    ]
    return drive.channels["range_rate"], windows, least_squares(trace)


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("name", NAMES)
def test_gains_are_of_the_right_size(name: str) -> None:
    """People and controllers close range rates: K2 > 0, and of the size that plain least squares finds.

    Least squares has no noise model and no lag, so it is biased low (the loop is closed): a factor of three.
    """
    whole, windows, plain = estimates(name)
    assert plain.K2 > 0.0
    every = [*windows, whole] if whole.status is not Identifiable.NOT else windows
    assert every, "neither the drive nor any window identifies K2"
    for ch in every:
        assert ch.K.low > 0.0
    middle = float(np.median([ch.K.value for ch in every]))
    assert plain.K2 / 3 < middle < plain.K2 * 3
    sums = [ch.tau_plus_dead_time.value for ch in every if identifiability.quotable(ch, "tau_plus_dead_time")]
    assert all(0.2 < total < 2.5 for total in sums)


@pytest.mark.slow("whole drives through the pipeline")
def test_two_halves_of_one_driver_agree() -> None:
    """The answer to range rate is the driver's own: both halves of a drive give the same, within their intervals."""
    for name in ("human_h22_v3", "human_h22_v6"):
        trace = canid.read_trace(DATA / f"{name}.blf", "openacc")
        middle = trace.t.size // 2
        halves = []
        for part in (slice(0, middle), slice(middle, None)):
            columns = {
                field: getattr(trace, field)[part]
                for field in ("t", "output", "inputs", "gate", "learn", "segment", "bound")
            }
            half = trace._replace(**columns, signals={})
            halves.append(canid.identify(half, select_orders=False).channels["range_rate"].K)
        a, b = halves
        assert a.low <= b.high
        assert b.low <= a.high


if __name__ == "__main__":
    print("| log | K2, whole drive | delays, whole drive | K2 in windows, median (n) | plain LS: K2, delay |")
    print("|---|---|---|---|---|")
    for name in NAMES:
        whole, windows, plain = estimates(name)
        gain = estimate_text.fixed(whole.K) if whole.status is not Identifiable.NOT else "not identifiable"
        median = f"{np.median([ch.K.value for ch in windows]):.2f} ({len(windows)})" if windows else "none"
        print(
            f"| {name} | {gain} | {estimate_text.delays(whole) or '–'} | {median} | {plain.K2:.2f}, {plain.delay:.1f} s |"
        )
