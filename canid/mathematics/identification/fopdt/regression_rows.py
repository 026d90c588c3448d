"""From samples to the rows of a regression: the output, and each input as the nodes of the basis answer it.

Rows are made once, as samples come, whether for a live window or a whole drive. Short gaps of the inputs are joined
by a line; a longer one, or another segment, begins the history anew at rest. On a fine grid several samples make one
row, output and answers averaged alike: averaging both is a filter that both pass, so the model stays exact and what
the noise's samples know is kept; and nothing later than the row enters it.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import first_order
from canid.mathematics.identification.fopdt import reduced_basis
from canid.values.state_constraints import FINITE, NOT_NEGATIVE
from canid.values.types import Array

# s; an input that is missing for less than this is joined by a line: a driver's lag hardly sees the
# difference. Beyond it the history is broken.
MAX_BRIDGED_GAP_S = 0.5

# s; the rows' step where the samples are finer: a person's answer ends below 1 Hz, and noise of a few seconds' memory
# then takes few coefficients
ROW_STEP_S = 0.1


# of a sample or a row that is a bound of the demand: what it may be at most, or at least
AT_MOST, AT_LEAST = -1.0, -2.0


class Layout(NamedTuple):
    """What all rows of an estimator have in common."""

    basis: reduced_basis.Basis
    inputs: int  # m
    dt: float  # s, of the samples
    per_row: int  # samples in a row
    reach: int  # how many past samples the answers need
    # the exact solution of tau x' + x = u over one sample, u joined by lines, per node
    alpha: Array  # (b,)
    g: Array  # (b,)
    # t_k - dead_time lies a part of a sample after the sample 1 + whole back
    whole: npt.NDArray[np.int64]  # (b,)
    beta: Array  # (b,)
    h: Array  # (b,)

    @property
    def step(self) -> float:
        """Step of the rows in s."""
        return self.dt * self.per_row

    @property
    def width(self) -> int:
        """Columns: output, whether usable (1) or a bound (-1), inputs, answers input by input."""
        return 2 + self.inputs * (1 + self.basis.size)


def make_layout(basis: reduced_basis.Basis, inputs: int, dt: float) -> Layout:
    """Layout of rows for `inputs` inputs sampled every `dt` s."""
    tau, dead_time = basis.tau, basis.dead_time
    alpha = np.exp(-dt / tau)
    # 1e-12: a dead time of three samples is three samples, whatever its last bit is
    whole = np.floor(dead_time / dt + 1e-12).astype(np.int64)
    part = dt - (dead_time - whole * dt)
    beta = np.exp(-part / tau)
    return Layout(
        basis,
        inputs,
        dt,
        max(1, math.floor(ROW_STEP_S / dt + 0.5)),
        int(whole.max()) + 2,
        alpha,
        1.0 - tau / dt * (1.0 - alpha),
        whole,
        beta,
        (part - tau * (1.0 - beta)) / dt,
    )


class History(NamedTuple):
    """The inputs' past, as far as the answers need it."""

    u: Array  # (reach, m), oldest first
    x: Array  # (reach, m, b) each lag without its dead time
    age: Annotated[int, NOT_NEGATIVE]  # samples since the history began


class State(NamedTuple):
    """What the next samples need."""

    history: Annotated[History, FINITE] | None = None  # None: it begins with the next known input
    pending: Array = np.zeros(
        (0, 0)
    )  # (k, 3 + m) samples that wait; after a history, the last answered one is first
    answered: Array = np.zeros((0, 0))  # (j, width) samples of a row that is not full


def put(layout: Layout, state: State, samples: Array, settle: float) -> tuple[State, Array]:
    """Take in samples.

    Args:
        layout: of the rows.
        state: `State()` or as left by the samples before.
        samples: (k, 3 + m): output, whether it may be learnt from (1), is a bound of the demand (`AT_MOST`, `AT_LEAST`) or
            neither (0), segment, inputs; NaN = not measured. One per step of the grid: a time that
            never came is a row of NaN.
        settle: s after a break in which the unknown history still matters; not usable.

    Returns:
        The new state, and the new rows (r, width). The samples after the last known input wait for the next one, as long
        as it can be joined to it: those of a prefix are the same however it is cut.
    """
    m, longest = layout.inputs, round(MAX_BRIDGED_GAP_S / layout.dt)
    raw = np.concatenate([state.pending.reshape(-1, 3 + m), samples])
    at = np.flatnonzero(np.isfinite(raw[:, 3:]).all(axis=1))
    end = int(at[-1]) + 1 if len(at) else 0
    # without a history there is nothing that the next input can be joined to
    lost = not len(at) or len(raw) - end > longest
    history, ready = _answer(layout, state.history, raw[: len(raw) if lost else end], at, settle, longest)
    history, end = (None, len(raw)) if lost else (history, end)
    pending = raw[end if history is None else end - 1 :]
    ready = np.concatenate([state.answered.reshape(-1, layout.width), ready])
    full = len(ready) // layout.per_row * layout.per_row
    return State(history, pending, ready[full:]), _average(ready[:full], layout.per_row)


def _answer(
    layout: Layout,
    history: History | None,
    raw: Array,
    at: npt.NDArray[np.int64],
    settle: float,
    longest: int,
) -> tuple[History | None, Array]:
    """Answer the samples, piece by piece of unbroken history; after a history raw[0] has been answered already."""
    m, n, done = layout.inputs, len(raw), int(history is not None)
    out = np.full((max(n - done, 0), layout.width), np.nan)
    out[:, 0], out[:, 1], out[:, 2 : 2 + m] = raw[done:, 0], 0.0, raw[done:, 3:]
    if not len(at) or not len(out):
        return history, out
    known = np.zeros(n, bool)
    known[at] = True
    inputs = raw[:, 3:]
    if len(at) < n:
        inputs = np.column_stack([np.interp(np.arange(n), at, column[at]) for column in inputs.T])
    parts = raw[:, 2]
    parts = parts[np.maximum.accumulate(np.where(np.isfinite(parts), np.arange(n), 0))]
    changes = np.flatnonzero((parts[1:] != parts[:-1]) & np.isfinite(parts[:-1])) + 1
    broken = at[1:] - at[:-1] > longest + 1
    gaps, before = at[1:][broken], at[:-1][broken]
    # a history begins at a known input
    later = np.searchsorted(at, changes)
    begins = sorted({*gaps.tolist(), *at[later[later < len(at)]].tolist(), *(() if done else (int(at[0]),))})
    hold, stop = round(settle / layout.dt), int(at[-1]) + 1
    ends = dict(zip(gaps.tolist(), (before + 1).tolist(), strict=True))
    for a, following in pairwise([*([] if begins and begins[0] == done else [done]), *begins, stop]):
        b = ends.get(following, following)
        if b <= a or (history is None and a not in begins):
            continue
        history, columns, age = _advance(layout, None if a in begins else history, inputs[a:b])
        piece = out[a - done : b - done]
        piece[:, 2 + m :] = columns
        if a in begins and a > 0 and (a == done or np.isfinite(out[a - done - 1, -1])):
            piece[0, 2 + m :] = np.nan  # no filter may join one history to another; after a gap none does
        piece[:, 1] = np.where(known[a:b] & np.isfinite(raw[a:b, 0]) & (age >= hold), raw[a:b, 1], 0.0)
    return history, out


def _advance(
    layout: Layout, history: History | None, u: Array
) -> tuple[History, Array, npt.NDArray[np.int64]]:
    """Answer inputs (k, m) that follow a history; None: at rest at their first value.

    Returns:
        The new history, (k, m b) answers, (k,) ages.
    """
    b, reach = layout.basis.size, layout.reach
    k = len(u)
    if history is None:
        still = np.repeat(u[:1], reach, axis=0)
        history = History(still, np.repeat(still[:, :, None], b, axis=2), -1)
    all_u = np.concatenate([history.u, u])
    before = all_u[reach - 1 : -1]
    change = u - before
    drive = (1.0 - layout.alpha) * before[:, :, None] + layout.g * change[:, :, None]
    all_x = np.concatenate([history.x, drive])
    if k <= _MAX_LOOP_SAMPLES:
        for last, x in pairwise(all_x[reach - 1 :]):
            x += layout.alpha * last
    else:
        drive[0] += layout.alpha * history.x[-1]
        all_x[reach:] = np.moveaxis(first_order.scan(np.moveaxis(drive, 0, -1), layout.alpha[:, None]), -1, 0)
    late = np.arange(reach, reach + k)[:, None] - layout.whole  # (k, b)
    u1, u0 = np.take(all_u, late - 1, axis=0), np.take(all_u, late, axis=0)  # (k, b, m)
    x1 = all_x[late - 1, :, np.arange(b)]
    columns = (x1 - u1) * layout.beta[:, None] + u1 + layout.h[:, None] * (u0 - u1)
    age = history.age + 1 + np.arange(k)
    # copies: a view would keep the whole drive alive
    kept = History(all_u[-reach:].copy(), all_x[-reach:].copy(), int(age[-1]))
    return kept, columns.transpose(0, 2, 1).reshape(k, -1), age


# up to so many samples a loop over them, whose last bits do not depend on where it is cut; beyond, a scan is faster
_MAX_LOOP_SAMPLES = 128


def _average(ready: Array, per_row: int) -> Array:
    """Average the usable samples of each row, usable where at least half of them are; else all, not usable.

    A row with a bound among usable samples is a bound itself: the mean of demands is at most, or at least,
    that of their bounds.
    """
    if per_row == 1 or not len(ready):
        return ready
    blocks = ready.reshape(-1, per_row, ready.shape[1])
    usable, bounded = blocks[:, :, 1] > 0.0, blocks[:, :, 1] < 0.0
    count = usable.sum(axis=1)
    known = blocks[:, :, 1].min(axis=1)
    # of demands of which some are at least and some at most so much nothing is known
    both = (known == AT_LEAST) & (blocks[:, :, 1] == AT_MOST).any(axis=1)
    below = bounded.any(axis=1) & (usable | bounded).all(axis=1) & ~both
    good = (count >= 0.5 * per_row) & ~below & ~both
    rows: Array = np.where(usable[:, :, None], blocks, 0.0).sum(axis=1) / np.maximum(count, 1)[:, None]
    rows[~good] = blocks[~good].mean(axis=1)
    rows[:, 1] = np.where(below, known, good)
    return rows
