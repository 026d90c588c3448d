"""First order plus dead time for every input jointly, y = b + sum K_i x_i(tau_i, theta_i) + AR(p) noise.

One window or a whole drive, from the rows of regression_rows.py; the search is in grid_search.py, and that of a whole
drive from several starts in several_starts.py. K and the offset are linear inside (Golub & Pereyra 1973).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import band, feedback_bias, identifiability
from canid.mathematics.identification.fopdt import grid_search, reduced_basis, several_starts, vehicle_band
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.grid_search import (
    CHUNK_ROWS,
    ProcessFit,
    Start,
    Task,
    enough,
    no_fit,
    ready,
)
from canid.mathematics.identification.fopdt.prior import InputPrior, Prior, for_inputs, states_nothing
from canid.mathematics.identification.output_filter import Equalizer, apply, complete, equalizer, is_unknown
from canid.values.types import Array, OutputFilter


class Settings(NamedTuple):
    """How a driver's answers are fitted."""

    tau_max: float = 3.0  # s, end of the box
    dead_time_max: float = 1.5  # s, end of the box
    prior: Prior | None = None  # declared belief; None: the box alone
    output_filter: OutputFilter | None = None  # that the output has passed; None: not known
    held: int | None = None  # the input that the driver's loop holds, see feedback_bias.py; None: none
    names: tuple[str, ...] = ()  # of the inputs; a prior of one channel's own needs them

    def input_prior(self) -> InputPrior | None:
        """The prior of these inputs, None: nothing. Raises ValueError for a prior of one channel without names."""
        prior = for_inputs(self.prior, self.names) if self.prior is not None else None
        return None if prior is None or states_nothing(prior) else prior


def fit_process(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    dt: float,
    how: Settings = Settings(),  # noqa: B008
    *,
    segment: npt.NDArray[np.int64] | None = None,
    bound: Array | None = None,
    start: Start | None = None,
    several: bool = False,
) -> ProcessFit:
    """Fit all channels jointly.

    Args:
        output: (n,) in its unit, NaN where not measured.
        inputs: (n, m), one or two columns, each in its unit, NaN where not measured.
        usable: (n,) whether the output may be learnt from; the inputs drive the lags all the same.
        dt: s.
        how: the box, the prior, and what is known of the output and the loop.
        segment: (n,), changes where the inputs' history breaks.
        bound: (n,) of the driver's demand where the output is not usable, at a limit of the output: at most this, or at
            least this where the output is above it; NaN: nothing is known of it.
        start: of an overlapping window: saves passes, changes nothing else.
        several: search from several starts, as is due to a whole drive.

    Raises:
        ValueError: shapes that do not fit, or more than two inputs; a prior of one channel without names.

    >>> from canid.mathematics.identification.first_order import scan
    >>> rng = np.random.default_rng(0)
    >>> u = scan(rng.normal(size=600), np.array([0.82]))
    >>> x = scan(0.22 * u, np.array([0.78]))  # a lag of 0.4 s
    >>> y = 3.0 + 5.6 * np.roll(x, 2) + 0.05 * rng.normal(size=600)
    >>> fit = fit_process(y, u[:, None], np.full(600, True), 0.1)
    >>> fit.channels[0].K.low < 5.6 < fit.channels[0].K.high
    True
    """
    inputs = np.asarray(inputs, float)
    if (
        inputs.ndim != 2
        or inputs.shape[1] not in (1, 2)
        or len(output) != len(inputs)
        or len(usable) != len(inputs)
    ):
        raise ValueError(
            f"output {np.shape(output)}, inputs {inputs.shape}: expected (n,) and (n, 1) or (n, 2)"
        )
    layout = row_layout(inputs.shape[1], dt, how.tau_max, how.dead_time_max)
    parts = np.zeros(len(output)) if segment is None else np.asarray(segment, float)
    known = np.where(usable, 1.0, 0.0)
    output = np.asarray(output, float)
    if bound is not None:
        hidden = np.isfinite(bound) & (known == 0.0)
        known[hidden] = np.where(bound[hidden] >= output[hidden], rows.AT_MOST, rows.AT_LEAST)
        output = np.where(hidden, bound, output)
    samples = np.column_stack([output, known, parts, inputs])
    most = len(samples) // layout.per_row + 1
    both, known_rows = np.empty((_height(layout), most)), np.zeros(most)
    state, n = rows.State(), 0
    for i in range(0, len(samples), CHUNK_ROWS):
        state, more = rows.put(layout, state, samples[i : i + CHUNK_ROWS], how.tau_max + how.dead_time_max)
        part = slice(n, n + len(more))
        both[:, part], known_rows[part] = _columns(layout, more)
        n += len(more)
    return _fit(layout, both[:, :n], known_rows[:n], how, start, several=several, scored=True)


def row_layout(m: int, dt: float, tau_max: float, dead_time_max: float) -> rows.Layout:
    """Return the layout of the rows that `fit_rows` takes."""
    return rows.make_layout(
        reduced_basis.basis(reduced_basis.Box(reduced_basis.TAU_MIN, tau_max, dead_time_max)), m, dt
    )


def _height(layout: rows.Layout) -> int:
    """Answers and output."""
    return layout.inputs * layout.basis.size + 1


def _columns(layout: rows.Layout, window: Array) -> tuple[Array, Array]:
    """Answers and output of rows (m b + 1, n), and whether they are usable (> 0) or which bound (< 0)."""
    both = np.empty((_height(layout), len(window)))
    both[:-1], both[-1] = window[:, 2 + layout.inputs :].T, window[:, 0]
    return both, window[:, 1]


def fit_rows(
    layout: rows.Layout,
    window: Array,
    how: Settings = Settings(),  # noqa: B008
    *,
    start: Start | None = None,
    continued: bool = True,
) -> ProcessFit:
    """Fit a window of rows.

    Args:
        layout: of the rows.
        window: (n, width) from `rows.put`.
        how: the prior, and what is known of the output and the loop; the box is the layout's.
        start: of an overlapping window.
        continued: another window starts from this one's `start`; else the time to make it ready is saved.
    """
    return _fit(layout, *_columns(layout, window), how, start, continued)


def _fit(
    layout: rows.Layout,
    both: Array,
    known: Array,
    how: Settings,
    start: Start | None,
    continued: bool = True,
    several: bool = False,
    scored: bool = False,
) -> ProcessFit:
    """Fit answers and output (m b + 1, n), which are used up; `known` (n,) as of `_columns`."""
    m = layout.inputs
    usable, bounded = known > 0.0, known < 0.0
    side = np.where(known == rows.AT_LEAST, -1.0, 1.0)
    prior = how.input_prior()
    both_pass = equalizer(how.output_filter, layout.step)
    if both_pass is not None:
        # what a filter makes of a bound is none
        usable, bounded = usable & _equalize(both, both_pass), np.zeros(len(usable), bool)
    unknown = is_unknown(how.output_filter)
    count = int(usable.sum())
    if not enough(both, usable, m):
        return no_fit(m, count)
    limits = band.strides(layout.step, how.output_filter)
    slow = vehicle_band.slow(both[:-1], layout.step) if several else None
    data = ready(both, usable, bounded, side, count)
    task = Task(layout, data, count, prior, limits, scored, slow)
    # fits that are compared are refitted alike
    least = several_starts.LEAST_REFITS if scored and start is not None else 0
    fit = (
        several_starts.search(task, how.held)
        if several
        else grid_search.search(task, start, continued, least)
    )
    if how.held is not None:
        channels = list(fit.channels)
        channels[how.held] = feedback_bias.without(channels[how.held])
        fit = fit._replace(channels=tuple(channels))
    if unknown:
        # the delays found are those of the driver and of the filter
        return fit._replace(channels=tuple(map(identifiability.gain_only, fit.channels)))
    return fit


def _equalize(both: Array, by: Equalizer) -> npt.NDArray[np.bool_]:
    """Filter answers and output (m b + 1, n) in place; where all that the filters need was there."""
    known = np.isfinite(both[0]) & np.isfinite(both[-2]), np.isfinite(both[-1])
    for row, k in zip(both, [by.answers] * (len(both) - 1) + [by.output], strict=True):
        row[~known[k is by.output]] = 0.0
        row[:] = apply(k, row)
    return complete(by.answers, known[0]) & complete(by.output, known[1])
