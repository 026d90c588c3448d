"""New rows of a recursive Box-Jenkins model, whitened, the output filter undone."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax.box_jenkins_state import State
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.output_filter import equalizer
from canid.values.types import Array, OutputFilter


class Columns(NamedTuple):
    """New rows, whitened; zero where they may not be learnt from."""

    white: Array  # (c, q)
    used: npt.NDArray[np.bool_]  # (q,)
    output: Array  # (q,)
    left: Array  # (q,) output minus simulation
    known: npt.NDArray[np.bool_]  # (q,) of the last two
    inputs: Array  # (q, m)


def reach(layout: rows.Layout, state: State, output_filter: OutputFilter | None) -> tuple[int, int]:
    """Rows before and after that a whitened row needs."""
    noise_rows = len(state.ar) * state.stride
    by = equalizer(output_filter, layout.step)
    if by is None:
        return noise_rows, 0
    most = max((by.output, by.answers), key=lambda kernel: kernel.before + kernel.after)
    return noise_rows + most.before, most.after


def columns(
    layout: rows.Layout, state: State, first: int, stop: int, output_filter: OutputFilter | None
) -> Columns:
    """Whiten rows [first, stop) of the tail."""
    m, tail, size = layout.inputs, state.tail, layout.inputs * layout.basis.size
    begin = first - len(state.ar) * state.stride
    usable = tail[begin:stop, 1] > 0.0
    by = _filters(output_filter, layout.step, begin, stop, len(tail))
    if by is None:
        both = np.empty((size + 1, stop - begin))
        both[:-1], both[-1] = tail[begin:stop, 2 + m :].T, tail[begin:stop, 0]
    else:
        both, known = _equalized(by, tail[:, 2 + m :].T, tail[:, 0])
        usable &= known
    tail, first, stop = tail[begin:stop], first - begin, stop - begin
    both[:, ~usable] = 0.0
    both[-1, usable] -= state.reference
    nodes = state.nodes[0]
    left = np.where(usable, both[-1] - state.point[0] @ nodes @ both[:-1] - state.offset, 0.0)
    lags = [slice(first - i * state.stride, stop - i * state.stride) for i in range(len(state.ar) + 1)]
    white = np.empty((size + 2 + len(state.ar), stop - first))
    white[: size + 1] = both[:, lags[0]]
    used = usable[lags[0]].copy()
    for value, lag in zip(state.ar, lags[1:], strict=True):
        white[: size + 1] -= value * both[:, lag]
        used &= usable[lag]
    white[size + 1] = 1.0 - float(state.ar.sum())
    for i, lag in enumerate(lags[1:], size + 2):
        white[i] = left[lag]
    white[:, ~used] = 0.0
    now = lags[0]
    return Columns(white, used, both[-1, now], left[now], usable[now], tail[now, 2 : 2 + m])


class _Filters(NamedTuple):
    """What answers and output pass, as matrices from the tail to the rows that are wanted."""

    answers: Array  # (n, q)
    output: Array  # (n, q)
    taps: tuple[Array, Array]  # where they are not zero
    counts: tuple[int, int]  # how many there are


@lru_cache(maxsize=8)
def _filters(
    output_filter: OutputFilter | None, step: float, first: int, stop: int, length: int
) -> _Filters | None:
    by = equalizer(output_filter, step)
    if by is None:
        return None
    made, taps = [], []
    for kernel in (by.answers, by.output):
        matrix, known = np.zeros((length, stop - first)), np.zeros((length, stop - first))
        for i, weight in enumerate(kernel.weights):
            at = np.arange(first, stop) + kernel.after - i
            inside = (at >= 0) & (at < length)
            matrix[at[inside], np.flatnonzero(inside)] = weight
            known[at[inside], np.flatnonzero(inside)] = 1.0
        made.append(matrix)
        taps.append(known)
    counts = len(by.answers.weights), len(by.output.weights)
    return _Filters(made[0], made[1], (taps[0], taps[1]), counts)


def _equalized(by: _Filters, answers: Array, output: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Pass answers (m b, n) and output (n,) through the filters; and where all that these read is known."""
    known = np.isfinite(answers[0]) & np.isfinite(answers[-1]), np.isfinite(output)
    both = np.vstack(
        [np.where(known[0], answers, 0.0) @ by.answers, np.where(known[1], output, 0.0) @ by.output]
    )
    whole = [k.astype(float) @ t > n - 0.5 for k, t, n in zip(known, by.taps, by.counts, strict=True)]
    return both, whole[0] & whole[1]
