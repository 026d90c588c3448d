"""Gains of a lead's gap and range rate that differ in scale: widened by the factor, as either of the two may be wrong.

The change of the gap over five seconds and the integral of the range rate are regressed both ways, as the check of the
signals does (signals/signal_checks/gap_and_range_rate.py), which withholds what differs by more than 15 %. Below that a gain
is quoted, and a range rate of 5 % too much made it 3 to 5 % too small: as wide as its interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.plausibility import SEARCH
from canid.mathematics.identification.identifiability import with_gain
from canid.signals.samples.lead import REPORTED
from canid.signals.signal_checks.blocks import BLOCK_S
from canid.signals.signal_checks.drive_time import behind_a_lead
from canid.signals.signal_checks.gap_and_range_rate import WINDOW_BLOCKS, scale_ratio
from canid.signals.signal_checks.mean_difference import integrals
from canid.values.runs import runs
from canid.values.types import TASK_INPUTS, Array, Interval, LearnGate, Trace

INPUTS = TASK_INPUTS["car_following"]
# of the scale, that radars are good to
RIGHT = 0.01


def widened(whole: Mapping[str, WholeDrive | None], trace: Trace) -> dict[str, WholeDrive | None]:
    """Widen the gains of every method by the factor in which gap and range rate differ, where they surely do.

    Args:
        whole: estimator -> its result; None: it has none.
        trace: of the drive, without what a limit hides.
    """
    ratio = None if trace.input_names != INPUTS else measured(trace)
    return {name: result if ratio is None else _widened(result, ratio) for name, result in whole.items()}


def measured(trace: Trace) -> Interval | None:
    """Ratio of the range rate to the change of the gap; None: it may be right, or is not known.

    Args:
        trace: of a drive behind a lead, with its signals as they were reported.
    """
    if not all(name in trace.signals for name in REPORTED.values()):
        return None
    gap, rate = (trace.signals[REPORTED[role]] for role in ("gap", "range_rate"))
    limited = np.array([gate is LearnGate.LIMITED for gate in trace.gate], dtype=bool)
    sound = behind_a_lead(trace.gate) & ~limited & np.isfinite(gap) & np.isfinite(rate)
    # neither over a pause nor from one lead to the next
    new = (np.diff(trace.t, prepend=trace.t[:1]) > 1.5 * trace.dt) | (
        np.diff(trace.segment, prepend=trace.segment[:1]) != 0
    )
    changes, sums = [], []
    for piece in np.split(np.arange(len(gap)), np.flatnonzero(new)):
        for first, stop in runs(sound[piece]):
            part = piece[first:stop]
            change, integral = _windows(gap[part], rate[part], trace.dt)
            changes.append(change)
            sums.append(integral)
    if not changes:
        return None
    ratio = scale_ratio(np.concatenate(changes), np.concatenate(sums))
    return None if ratio is None or (ratio.low <= 1.0 + RIGHT and ratio.high >= 1.0 - RIGHT) else ratio


def _windows(gap: Array, rate: Array, dt: float) -> tuple[Array, Array]:
    """Change of the gap and integral of the range rate, (m,) m each, over `WINDOW_BLOCKS` s."""
    n = round(BLOCK_S / dt)
    blocks = len(gap) // n
    if blocks <= WINDOW_BLOCKS:
        return np.empty(0), np.empty(0)
    means = gap[: blocks * n].reshape(blocks, n).mean(axis=1)
    both = [integrals(rate[k * n : (k + 1) * n], dt) for k in range(blocks)]
    moved = np.array([before.rise + after.fall for before, after in pairwise(both)])
    windows = (blocks - 1) // WINDOW_BLOCKS
    ends = means[: windows * WINDOW_BLOCKS + 1 : WINDOW_BLOCKS]
    return np.diff(ends), moved[: windows * WINDOW_BLOCKS].reshape(windows, WINDOW_BLOCKS).sum(axis=1)


def _widened(result: WholeDrive | None, ratio: Interval) -> WholeDrive | None:
    if result is None:
        return None
    factor, channels = max(ratio.value, 1.0 / ratio.value), dict(result.channels)
    for name in INPUTS:
        value, low, high = channels[name].K if name in channels else Interval()
        # a NaN, or one that may be 0, is not quoted
        if low * high > 0.0:
            ends = (low / factor, high * factor) if low > 0.0 else (low * factor, high / factor)
            channels[name] = with_gain(channels[name], Interval(value, *ends))
    if channels == dict(result.channels):
        return result
    said = (
        f"range rate is {ratio.value:.3f} [{ratio.low:.3f}, {ratio.high:.3f}] times the change of the gap: one of the two "
        f"has a wrong scale, and the intervals of K are {100.0 * (factor - 1.0):.0f} % wider to either side; {SEARCH}"
    )
    return result._replace(channels=channels, lines=(*result.lines, said))
