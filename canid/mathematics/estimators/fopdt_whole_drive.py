"""FOPDT over a whole drive: one fit, change points of the gains with a fit between each, and the gains as a local level.

Windows of `WINDOW_S` of usable data that do not overlap are linear regressions at the lags and dead times of the whole
drive, whitened by its noise model: their errors are independent. The bias of short windows is removed (`_recentred`).
Chen & Ulsoy (2001) asked for lane keeping whether a driver is constant; here it is asked of every gain and of every
tau + dead time.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from canid.mathematics.estimators import dead_time_trend, step_watch
from canid.mathematics.estimators.dead_time_trend import DeadTimeTrend
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification import feedback_bias, local_level
from canid.mathematics.identification.confidence import MISS
from canid.mathematics.identification.fopdt import (
    answer_columns,
    drifting_level,
    fopdt_fit,
    gain_segments,
    gain_step,
    regression_rows,
)
from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.drifting_level import Level
from canid.mathematics.identification.fopdt.grid_search import CHUNK_ROWS, ProcessFit
from canid.mathematics.identification.fopdt.prior import Prior
from canid.mathematics.identification.identifiability import not_quotable, quotable
from canid.mathematics.identification.local_level import LocalLevel
from canid.values.types import NAN, Array, Channel, GainChange, Interval, OutputFilter, Trace

# s of usable data in a window of the local level: the gain of range rate to some 5 %, behind a lead that moves
WINDOW_S = 40.0
# s of the drive in a window at most: beyond, it is no estimate at a time
MAX_WINDOW_SPAN_S = 120.0
# s of usable data within which it is said what change would have been seen
VISIBLE_S = 60.0


class Segment(NamedTuple):
    """A stretch of the drive without a step of the gains."""

    start: float  # s
    stop: float  # s
    channels: Mapping[str, Channel]


class Constancy(NamedTuple):
    """One parameter of one channel over the drive."""

    input_name: str
    parameter: str  # "K" or "tau_plus_dead_time"
    window: float  # s of usable data in each
    over_time: LocalLevel


class OverTime(NamedTuple):
    """What changes during a drive."""

    changes: tuple[GainChange, ...]
    segments: tuple[Segment, ...]  # one more than changes; none where nothing changes
    constancy: tuple[Constancy, ...]  # none where the drive is too short
    visible: float = (
        NAN  # least factor of both gains that `VISIBLE_S` would have shown; NaN: none, or not known
    )
    drift: DeadTimeTrend | None = None  # of the dead times; None: gains change, or the drive is too short


class Fitting(NamedTuple):
    """How a stretch of the drive is fitted."""

    tau_max: float  # s
    dead_time_max: float  # s
    prior: Prior | None
    output_filter: OutputFilter | None

    def fit(self, trace: Trace, part: slice = slice(None)) -> ProcessFit:
        """Fit a stretch from several starts; the inputs before it are not its history."""
        return fopdt_fit.fit_process(
            trace.output[part],
            trace.inputs[part],
            trace.learn[part],
            trace.dt,
            fopdt_fit.Settings(
                tau_max=self.tau_max,
                dead_time_max=self.dead_time_max,
                prior=self.prior,
                output_filter=self.output_filter,
                held=feedback_bias.held(trace.input_names),
                names=trace.input_names,
            ),
            segment=trace.segment[part],
            bound=None if trace.bound is None else trace.bound[part],
            several=True,
        )


class Blocks(NamedTuple):
    """Inner products of one second each."""

    columns: Columns
    parts: Array  # (b, c, c)
    level: Level  # an offset that may drift, in the same blocks
    used: Array  # (b,) s of usable data
    end: Array  # (b,) s, of the last row


def over_time(trace: Trace, fit: ProcessFit, how: Fitting) -> OverTime:
    """Find the steps of the gains, fit what lies between, and smooth each parameter over the drive."""
    # of a gain that is not known nobody can say that it changed
    known = any(quotable(channel, "K") for channel in fit.channels)
    at = answer_columns.reference(fit) if known else None
    blocks = _blocks(trace, at, how) if at is not None else None
    if at is None or blocks is None:
        return OverTime((), (), ())
    cuts = gain_segments.segment(
        blocks.parts, blocks.used, blocks.columns, at.size, step_watch.ALARM, blocks.level
    )
    fits = _fits(trace, how, [_begin(blocks, c.block) for c in cuts]) if cuts else []
    segments = tuple(segment for segment, _ in fits)
    changes = tuple(
        GainChange(
            Interval(*(_begin(blocks, block) for block in (c.block, c.low, c.high))),
            {name: channel.K for name, channel in before.channels.items()},
            {name: channel.K for name, channel in after.channels.items()},
            c.evidence,
        )
        for c, (before, after) in zip(cuts, pairwise(segments), strict=True)
    )
    if fits:
        # the noise model of a fit over a change holds the misfit: take that of the longest stretch
        _, longest = max(fits, key=lambda pair: pair[1].used)
        of_longest = answer_columns.reference(longest)
        of_own = _blocks(trace, of_longest, how) if of_longest is not None else None
        blocks = of_own if of_own is not None else blocks
    visible, drift = NAN, None
    if not cuts:
        drift = dead_time_trend.fit(blocks.parts, len(trace.input_names), blocks.end)
        how_sure = (step_watch.ALARM, VISIBLE_S, blocks.level)
        visible = gain_segments.visible_factor(
            blocks.parts, blocks.used, blocks.columns, at.K, at.size, *how_sure
        )
    return OverTime(changes, segments, _constancy(trace.input_names, fit, segments, blocks), visible, drift)


def _blocks(trace: Trace, at: answer_columns.Reference, how: Fitting) -> Blocks | None:
    """Rows of the drive, piece by piece, as the columns of the reference."""
    layout = fopdt_fit.row_layout(len(trace.input_names), trace.dt, how.tau_max, how.dead_time_max)
    samples = np.column_stack([trace.output, trace.learn, trace.segment, trace.inputs])
    state, raws, known = regression_rows.State(), [], []
    for i in range(0, len(samples), CHUNK_ROWS):
        piece = samples[i : i + CHUNK_ROWS]
        state, rows = regression_rows.put(layout, state, piece, how.tau_max + how.dead_time_max)
        raw, usable = answer_columns.raw(layout, rows, at)
        raws.append(raw)
        known.append(usable)
    raw, usable = np.concatenate(raws, axis=1), np.concatenate(known)
    columns = answer_columns.whitened(layout, raw, usable, at, how.output_filter)
    if columns is None:
        return None
    block = max(round(gain_step.CANDIDATE_S / layout.step), 1)
    parts = gain_step.grams(columns, block)
    slow = drifting_level.raw(len(usable), layout.step)
    # whitened as an answer is; the last row, an output, is read no more
    white, _ = answer_columns.white(np.vstack([slow, raw[-1]]), usable, at, how.output_filter, layout.step)
    level = drifting_level.grams(columns, white[:-1], block)
    lacking = -len(usable) % block
    counted = np.concatenate([np.zeros(lacking), columns.usable]).reshape(-1, block).sum(axis=1)
    last = np.arange(1, len(parts) + 1) * block - lacking - 1  # row
    end = float(trace.t[0]) + ((last + 1) * layout.per_row - 1) * trace.dt
    return Blocks(columns, parts, level, np.asarray(counted * layout.step), np.asarray(end, float))


def _begin(blocks: Blocks, block: int) -> float:
    """Time in s at which a block begins."""
    return float(blocks.end[max(block - 1, 0)])


def _fits(trace: Trace, how: Fitting, times: list[float]) -> list[tuple[Segment, ProcessFit]]:
    """Fit each stretch between the changes."""
    out = []
    for start, stop in pairwise([float(trace.t[0]), *times, float(trace.t[-1])]):
        part = slice(int(np.searchsorted(trace.t, start)), int(np.searchsorted(trace.t, stop)))
        fit = how.fit(trace, part)
        out.append((Segment(start, stop, dict(zip(trace.input_names, fit.channels, strict=True))), fit))
    return out


def _constancy(
    names: tuple[str, ...], fit: ProcessFit, segments: tuple[Segment, ...], blocks: Blocks
) -> tuple[Constancy, ...]:
    """Fit a local level to each parameter that the whole drive knows."""
    windows = _windows(blocks)
    if len(windows) < local_level.MIN_WINDOWS:
        return ()
    m = len(names)
    t = np.array([0.5 * (blocks.end[a] + blocks.end[b - 1]) for a, b in windows])
    made = [_window(blocks.parts[a:b].sum(axis=0), blocks.columns) for a, b in windows]
    value, sd = (np.array(x) for x in zip(*made, strict=True))
    out = []
    for i, (name, channel) in enumerate(zip(names, fit.channels, strict=True)):
        for parameter, column in (("K", i), ("tau_plus_dead_time", m + 1 + i)):
            if quotable(channel, parameter):
                known: Interval = getattr(channel, parameter)
                long = np.full(len(t), known.value)
                for segment in segments:
                    stretch_value: Interval = getattr(segment.channels[name], parameter)
                    if quotable(segment.channels[name], parameter):
                        long[(t >= segment.start) & (t < segment.stop)] = stretch_value.value
                unbiased = _recentred(value[:, column], sd[:, column], long)
                level = local_level.fit(t, unbiased, sd[:, column])
                if level is not None:
                    level = level._replace(constant=known)
                    out.append(Constancy(name, parameter, WINDOW_S, level))
    return tuple(out)


def _recentred(value: Array, sd: Array, long: Array) -> Array:
    """Remove the bias of short windows: their mean difference from the estimates of long stretches, by precision.

    In a feedback loop a window's own offset takes some of the answer to its own noise, a bias that is the same in all
    windows and falls with their length: on simulated accelerations -8 % at 20 s, -4 % at 40 s, -2 % at 80 s, 0 % at 1200 s.

    Args:
        value: (n,) estimates of the windows.
        sd: (n,) their standard errors.
        long: (n,) of the whole drive, or of the stretch between two changes, at each window.
    """
    weight = sd**-2.0
    return value + float((weight * (long - value)).sum() / weight.sum())


def _windows(blocks: Blocks) -> list[tuple[int, int]]:
    """Stretches of blocks with `WINDOW_S` of usable data each."""
    out, first, used = [], 0, 0.0
    for k, more in enumerate(blocks.used.tolist()):
        if used == 0.0:
            first = k
        used += more
        if used > 0.0 and k + 1 - first > MAX_WINDOW_SPAN_S / gain_step.CANDIDATE_S:
            used = 0.0
        elif used >= WINDOW_S - 1e-6:
            out.append((first, k + 1))
            used = 0.0
    return out


def _window(part: Array, columns: Columns) -> tuple[Array, Array]:
    """Return estimates and standard errors of gains (m), offset, shifts of tau + dead time (m), and of dead time (m).

    Args:
        part: (c, c) inner products of a window.
        columns: names the columns.
    """
    m = columns.inputs
    by_tau, by_dead_time = columns.precision[m + 1], columns.precision[2 * m + 1]
    # the slope by the sum is that by tau at a given dead time; the slope by dead time at a given sum the difference
    turn = np.eye(3 * m + 1)
    turn[2 * m + 1 :, m + 1 : 2 * m + 1] = -np.eye(m)
    M = turn @ part[:-1, :-1] @ turn.T
    r = turn @ part[:-1, -1]
    prior = np.concatenate([np.zeros(2 * m + 1), np.full(m, by_tau + by_dead_time)])
    C = np.linalg.inv(M + np.diag(prior + 1e-9 * np.diag(M) + 1e-12))
    return C @ r, np.sqrt(np.diag(C))


# --- presentation ------------------------------------------------------------------------------------


def with_changes(drive: WholeDrive, course: OverTime) -> WholeDrive:
    """Add what changes to the result of a whole drive; where gains step, none of the whole drive may be quoted."""
    channels = drive.channels
    if course.changes:
        times = ", ".join(f"{change.t.value:.0f}" for change in course.changes)
        why = f"the gains changed during the drive, at {times} s"
        channels = {name: not_quotable(channel, why) for name, channel in channels.items()}
    details: dict[str, Any] = {
        "changes": course.changes,
        "visible_change": {"factor": course.visible, "seconds": VISIBLE_S},
        "segments": [{"start": s.start, "stop": s.stop, "channels": s.channels} for s in course.segments],
        "constancy": [
            {"input": c.input_name, "parameter": c.parameter, "window": c.window} | c.over_time._asdict()
            for c in course.constancy
        ],
    }
    if drifts := dead_time_trend.says(course.drift):
        details["dead_time_trend"] = drifts
    return drive._replace(
        channels=channels,
        details={**drive.details, **details},
        lines=(*drive.lines, *_change_lines(course), *(_constancy_line(c) for c in course.constancy)),
    )


def _change_lines(course: OverTime) -> list[str]:
    if not course.changes:
        return []
    said = [step_watch.says(change) for change in course.changes]
    first = (
        f"the gains changed {len(said)} time{'s' * (len(said) > 1)}: no gain holds for the whole drive, "
        "use those between the changes"
    )
    between = [f"{s.start:.0f}–{s.stop:.0f} s: {_gains(s.channels)}" for s in course.segments]
    return [first, *said, *between]


def _gains(channels: Mapping[str, Channel]) -> str:
    known = [
        f"{name.replace('_', ' ')} K {c.K.value:.2f} [{c.K.low:.2f}, {c.K.high:.2f}]"
        for name, c in channels.items()
        if quotable(c, "K")
    ]
    return ", ".join(known) or "no gain can be estimated"


_SYMBOLS = {"K": ("K", ""), "tau_plus_dead_time": ("τ+θ", " s")}


def _constancy_line(c: Constancy) -> str:
    """One parameter over the drive in words."""
    symbol, unit = _SYMBOLS[c.parameter]
    name = f"{c.input_name.replace('_', ' ')} {symbol}"
    level, p = c.over_time, f"p = {c.over_time.p_value:.3f}"
    size = f"{len(level.t)} windows of {c.window:.0f} s"
    if level.p_value < MISS:
        v = level.variation
        return (
            f"{name} varies over the drive: sd {v.value:.2f} [{v.low:.2f}, {v.high:.2f}]{unit}, from "
            f"{float(level.level.min()):.2f} to {float(level.level.max()):.2f}{unit} ({p} of a constant one, {size})"
        )
    half = 0.5 * float(np.mean(level.high - level.low))
    value = f"{level.constant.value:.2f} ± {half:.2f}{unit}"
    return f"{name} no change shown: {value} over the drive ({p} of a constant one, {size})"
