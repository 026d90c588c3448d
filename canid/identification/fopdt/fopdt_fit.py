"""First order plus dead time for every input jointly, y = b + sum K_i x_i(tau_i, theta_i) + AR(p) noise.

One window or a whole drive, from the rows of regression_rows.py. The search is the posterior's own grid: it starts
on the whole physical box (or where the last window's posterior was), closes in, and refits the noise model each
time; there is no descent that could stop in a local minimum. K and the offset are linear inside (Golub & Pereyra 1973).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.identification import band, feedback_bias, identifiability, innovation_law
from canid.identification.fopdt import fopdt_posterior, reduced_basis, row_noise
from canid.identification.fopdt import regression_rows as rows
from canid.identification.fopdt.prior import InputPrior, Prior, density, for_inputs, states_all
from canid.identification.fopdt.row_noise import Data, Noise, Point, by_channel, power, residual_of
from canid.identification.output_filter import Equalizer, apply, complete, equalizer, is_unknown
from canid.state_constraints import FINITE
from canid.types import NAN, Array, Channel, OutputFilter

# Passes of the grid. From the whole box to 5 ms takes five; the rest is for an odd start.
MAX_PASSES = 16
# Passes on a fine grid after which the noise model is kept: with few samples two noise models can lead to each other
# for ever.
MAX_NOISE_REFITS = 4
# The same where each noise model leads far away: the data know no lag then, and the grid is fine from the start. Of 371
# windows of five logs that moves 17, all of accelerations; 13 of them have no number either way.
MAX_FINE_PASSES = 8

# %. Below this fit the noise has twice the output's variance: it must cancel the answer that it is said to be
# independent of, and the numbers rest on the last few samples' changes alone. A feedback loop makes the two oppose
# each other too, but not so far: of 690 estimates on simulated drives 4 were there, on real logs only absurd ones
# (a gain ten times the rest at a fit of -1240 %). This is no gate on a good fit, which proves nothing.
MIN_FIT_PERCENT = 100.0 * (1.0 - 2.0**0.5)


class SearchGrid(NamedTuple):
    """Cells of the grid search, with the basis weights of each."""

    regions: Annotated[tuple[fopdt_posterior.Region, ...], FINITE]
    cells: Annotated[tuple[fopdt_posterior.Cells, ...], FINITE]
    W: Annotated[tuple[Array, ...], FINITE]  # per channel (c, b)


class Start(NamedTuple):
    """Initial guess that the next window takes over from this one."""

    point: Annotated[Point, FINITE]
    search_grid: SearchGrid


class ProcessFit(NamedTuple):
    """The joint fit. NaN values and `Identifiable.NOT` where the data do not identify it."""

    channels: tuple[Channel, ...]
    point: Point  # the posterior's mean
    noise: Array  # (p,) autoregression of every `stride`-th row
    stride: int
    sigma: float  # root mean square of the whitened residual
    variance_inflation: float  # >= 1: inflation of variances by the autocorrelation that whitening left
    law: innovation_law.Law | None  # of the innovations; None: no estimate
    drift: int  # cosines that the offset follows
    fit_percent: float  # of the simulated answer
    used: int  # rows
    start: Start | None  # for the next window
    posterior: fopdt_posterior.Grid | None = None  # of lags, dead times and gains together; None: no estimate


def fit_process(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    dt: float,
    *,
    segment: npt.NDArray[np.int64] | None = None,
    tau_max: float = 3.0,
    dead_time_max: float = 1.5,
    prior: Prior | None = None,
    start: Start | None = None,
    output_filter: OutputFilter | None = None,
    bound: Array | None = None,
    held: int | None = None,
    names: Sequence[str] = (),
) -> ProcessFit:
    """Fit all channels jointly.

    Args:
        output: (n,) in its unit, NaN where not measured.
        inputs: (n, m), one or two columns, each in its unit, NaN where not measured.
        usable: (n,) whether the output may be learnt from; the inputs drive the lags all the same.
        dt: s.
        segment: (n,), changes where the inputs' history breaks.
        tau_max: s, end of the box.
        dead_time_max: s, end of the box.
        prior: declared belief; None: the box alone.
        start: of an overlapping window: saves passes, changes nothing else.
        output_filter: that the output has passed; None: not known.
        bound: (n,) that the driver's demand did not exceed where the output is not usable, a pedal at its floor; NaN:
            nothing is known of it.
        held: the input that the driver's loop holds, see feedback_bias.py; None: none.
        names: of the inputs; a prior of one channel's own needs them.

    Raises:
        ValueError: shapes that do not fit, or more than two inputs; a prior of one channel without names.

    >>> from canid.identification.first_order import scan
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
    layout = row_layout(inputs.shape[1], dt, tau_max, dead_time_max)
    parts = np.zeros(len(output)) if segment is None else np.asarray(segment, float)
    known = np.where(usable, 1.0, 0.0)
    output = np.asarray(output, float)
    if bound is not None:
        below = np.isfinite(bound) & (known == 0.0)
        known[below], output = -1.0, np.where(below, bound, output)
    samples = np.column_stack([output, known, parts, inputs])
    most = len(samples) // layout.per_row + 1
    both, ready = np.empty((_height(layout), most)), np.zeros(most)
    state, n = rows.State(), 0
    for i in range(0, len(samples), CHUNK_ROWS):
        state, more = rows.put(layout, state, samples[i : i + CHUNK_ROWS], tau_max + dead_time_max)
        part = slice(n, n + len(more))
        both[:, part], ready[part] = _columns(layout, more)
        n += len(more)
    known_prior = for_inputs(prior, names) if prior is not None else None
    return _fit(layout, both[:, :n], ready[:n], start, known_prior, output_filter, held)


# samples, and rows, that are worked on at once: 2,048 of two inputs take 1 MB. A drive's rows are held once, 18 MB an
# hour; whatever is made of all of them is made in such pieces.
CHUNK_ROWS = 2048


def row_layout(m: int, dt: float, tau_max: float, dead_time_max: float) -> rows.Layout:
    """Return the layout of the rows that `fit_rows` takes."""
    return rows.make_layout(
        reduced_basis.basis(reduced_basis.Box(reduced_basis.TAU_MIN, tau_max, dead_time_max)), m, dt
    )


def _height(layout: rows.Layout) -> int:
    """Answers and output."""
    return layout.inputs * layout.basis.size + 1


def _columns(layout: rows.Layout, window: Array) -> tuple[Array, Array]:
    """Answers and output of rows (m b + 1, n), and whether they are usable (> 0) or a bound (< 0)."""
    both = np.empty((_height(layout), len(window)))
    both[:-1], both[-1] = window[:, 2 + layout.inputs :].T, window[:, 0]
    return both, window[:, 1]


def _ready(both: Array, usable: npt.NDArray[np.bool_], bounded: npt.NDArray[np.bool_], count: int) -> Data:
    """Make ready in place."""
    nothing = ~(usable | bounded)
    if count < len(usable):
        both[:, nothing] = 0.0
    mean = (both @ usable if bounded.any() else both.sum(axis=1)) / count
    both -= mean[:, None]
    if count < len(usable):
        both[:, nothing] = 0.0
    return Data(both, usable, bounded, float(mean[-1]), mean[:-1])


def fit_rows(
    layout: rows.Layout,
    window: Array,
    start: Start | None = None,
    prior: Prior | None = None,
    output_filter: OutputFilter | None = None,
    *,
    held: int | None = None,
    continued: bool = True,
    names: Sequence[str] = (),
) -> ProcessFit:
    """Fit a window of rows.

    Args:
        layout: of the rows.
        window: (n, width) from `rows.put`.
        start: of an overlapping window.
        prior: declared belief; None: the box alone.
        output_filter: that the output has passed; None: not known.
        held: the input that the driver's loop holds, see feedback_bias.py; None: none.
        continued: another window starts from this one's `start`; else the time to make it ready is saved.
        names: of the inputs; a prior of one channel's own needs them.
    """
    known_prior = for_inputs(prior, names) if prior is not None else None
    return _fit(layout, *_columns(layout, window), start, known_prior, output_filter, held, continued)


def _fit(
    layout: rows.Layout,
    both: Array,
    known: Array,
    start: Start | None,
    prior: InputPrior | None,
    output_filter: OutputFilter | None,
    held: int | None,
    continued: bool = True,
) -> ProcessFit:
    """Fit answers and output (m b + 1, n), which are used up; `known` (n,) as of `_columns`."""
    m = layout.inputs
    usable, bounded = known > 0.0, known < 0.0
    both_pass = equalizer(output_filter, layout.step)
    if both_pass is not None:
        # what a filter makes of a bound is none
        usable, bounded = usable & _equalize(both, both_pass), np.zeros(len(usable), bool)
    unknown = is_unknown(output_filter)
    count = int(usable.sum())
    # a tenth of a window: below this the noise model and the response are not identifiable separately
    if count < 20 * (m + 1) or not float(np.ptp(both[-1, usable])) > 0.0:
        return no_fit(m, count)
    limits = band.strides(layout.step, output_filter)
    fit = _search(layout, _ready(both, usable, bounded, count), count, start, prior, limits, continued)
    if held is not None:
        channels = list(fit.channels)
        channels[held] = feedback_bias.without(channels[held], fit.drift)
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


def _search(
    layout: rows.Layout,
    data: Data,
    count: int,
    start: Start | None,
    prior: InputPrior | None,
    limits: band.Strides,
    continued: bool,
) -> ProcessFit:
    """Close in on the posterior from the whole box, or from another window's.

    Args:
        layout: of the rows.
        data: the window.
        count: rows that are usable.
        start: of an overlapping window.
        prior: declared belief.
        limits: of the noise model's stride.
        continued: another window starts from the last grid.
    """
    m, box = layout.inputs, layout.basis.box
    known = start if start is not None else _initial(layout, data, prior)
    simulated = known.point.w @ data.X
    near = start is not None
    noise = row_noise.estimate(layout, data, known.point, simulated, limits, near=near)
    finished, passes = 0, 0
    for _ in range(MAX_PASSES):
        moments, grid = _evaluate(layout, known.search_grid, noise, prior)
        regions = tuple(fopdt_posterior.gather(grid, i, box) for i in range(m))
        fine = all(is_fine(r, c) for r, c in zip(regions, grid.cells, strict=True))
        fine = fine and not any(fopdt_posterior.missed(grid, i, box) for i in range(m))
        point = _posterior_point(layout, data, grid, fine)
        stays = fine and all(_centred(r, o) for r, o in zip(regions, known.search_grid.regions, strict=True))
        last, simulated = simulated, point.w @ data.X
        moved = power(simulated - last) / max(
            power(noise.weighed.residual * noise.phases.data.usable), 1e-300
        )
        same = moved <= SAME_SHARE**2
        # a residual that was mostly misfit, and went: the search goes on, no noise model leads to another
        finished, passes = finished + (fine and moved <= 0.5), passes + fine
        ended = fine and ((same and near) or finished > MAX_NOISE_REFITS or passes >= MAX_FINE_PASSES)
        keep = stays or (ended and not continued)
        known = Start(point, known.search_grid if keep else _search_grid(layout, regions))
        if ended:
            break
        if finished < MAX_NOISE_REFITS:
            # far from the posterior the residual holds the answer itself, and its band shows nothing of the noise
            found = limits._replace(least=noise.stride) if finished else limits
            near = near or finished > 0
            noise = row_noise.estimate(layout, data, point, simulated, found, noise, near)
    if grid.gains is not None:
        point = _posterior_point(layout, data, grid, fine, grid.K)
        simulated = point.w @ data.X
    misfit = power(residual_of(data, simulated) * data.usable) / power(data.y * data.usable)
    fit_percent = 100.0 * (1.0 - misfit**0.5)
    credible = fit_percent >= MIN_FIT_PERCENT
    if not credible and start is not None:
        # the window before may have led here: once more from the whole box
        return _search(layout, data, count, None, prior, limits, continued)
    return ProcessFit(
        channels=fopdt_posterior.channels(
            grid,
            box,
            _limits(layout, moments, grid, point, noise),
            count * layout.step,
            prior is not None,
            () if prior is None or prior.gains is None else prior.gains.stated,
            prior is not None and states_all(prior),
        )
        if credible
        else (Channel(),) * m,
        point=point,
        noise=noise.ar,
        stride=noise.stride,
        sigma=(grid.residual * noise.stride / noise.weighed.counted) ** 0.5
        if math.isnan(noise.sd)
        else noise.sd,
        variance_inflation=noise.variance_inflation,
        law=noise.weighed.law,
        drift=0 if noise.drift is None else len(noise.drift),
        fit_percent=fit_percent,
        used=count,
        start=known,
        posterior=grid if credible else None,
    )


def no_fit(m: int, used: int = 0) -> ProcessFit:
    """Return the fit of m inputs without an estimate."""
    point = Point(np.full(m, NAN), np.full(m, NAN), np.full(m, NAN), NAN, np.zeros(0))
    return ProcessFit((Channel(),) * m, point, np.zeros(0), 1, NAN, 1.0, None, 0, NAN, used, None)


def _search_grid(layout: rows.Layout, regions: tuple[fopdt_posterior.Region, ...]) -> SearchGrid:
    cells = tuple(fopdt_posterior.make_cells(region, layout.basis.box) for region in regions)
    side = fopdt_posterior.CELLS_PER_AXIS
    tau = np.concatenate([c.tau[::side] for c in cells])
    dead_time = np.concatenate([c.dead_time for c in cells]).reshape(-1, side)
    every = reduced_basis.weights_on_grid(layout.basis, tau, dead_time)
    W = tuple(every.reshape(len(cells), side * side, -1))
    return SearchGrid(regions, cells, W)


@cache
def _whole(box: reduced_basis.Box) -> tuple[fopdt_posterior.Region, fopdt_posterior.Cells, Array]:
    region = fopdt_posterior.whole_box(box)
    cells = fopdt_posterior.make_cells(region, box)
    return region, cells, reduced_basis.weights(reduced_basis.basis(box), cells.tau, cells.dead_time)


def _initial(layout: rows.Layout, data: Data, prior: InputPrior | None) -> Start:
    """Initial guess: the whole box with white noise; its least residual gives the noise model.

    A prior of gains waits for a noise model: white noise gives the data too much weight against it.
    """
    m = layout.inputs
    region, cells, W = _whole(layout.basis.box)
    every = (cells,) * m
    search_grid = SearchGrid((region,) * m, every, (W,) * m)
    of_delays = prior._replace(gains=None) if prior is not None else None
    grid = _evaluate(layout, search_grid, row_noise.white(data), of_delays)[1]
    return Start(_posterior_point(layout, data, grid, False), search_grid)


def _evaluate(
    layout: rows.Layout, search_grid: SearchGrid, noise: Noise, prior: InputPrior | None
) -> tuple[fopdt_posterior.Moments, fopdt_posterior.Grid]:
    found = [row_noise.products(noise, i, CHUNK_ROWS) for i in range(0, len(noise.weighed.rows), CHUNK_ROWS)]
    # the phases of a stride know together about as much as one of them
    share = 1.0 / noise.stride
    sums = fopdt_posterior.Products(*(share * sum(parts[1:], parts[0]) for parts in zip(*found, strict=True)))
    known = fopdt_posterior.moments(sums, layout.inputs, round(share * noise.weighed.counted))
    if prior is None:
        return known, fopdt_posterior.evaluate(
            known, search_grid.W, search_grid.cells, noise.variance_inflation
        )
    of_delays = density(prior, search_grid.cells, layout.basis.box)
    return known, fopdt_posterior.evaluate(
        known, search_grid.W, search_grid.cells, noise.variance_inflation, *of_delays, prior.gains
    )


def _limits(
    layout: rows.Layout,
    moments: fopdt_posterior.Moments,
    grid: fopdt_posterior.Grid,
    at: Point,
    noise: Noise,
) -> tuple[fopdt_posterior.Deviations, ...]:
    """What the data allow at the point that was found."""
    by_K, by_tau, by_dead_time = (
        by_channel(layout, w) for w in reduced_basis.with_slopes(layout.basis, at.tau, at.dead_time)
    )
    J = [np.array([by_K[i], K * by_tau[i], K * by_dead_time[i]]) for i, K in enumerate(at.K)]
    variance = noise.weighed.law.inflation * grid.residual / max(moments.freedom, 1)
    return fopdt_posterior.bounds(moments, J, variance, layout.basis.box)


def _posterior_point(
    layout: rows.Layout,
    data: Data,
    grid: fopdt_posterior.Grid,
    fine: bool,
    gains: tuple[Array, ...] | None = None,
) -> Point:
    """Posterior mean: where a lag is not identifiable, the most likely cell is an accident.

    On a coarse grid, take the most likely cell with the gains of plain least squares. A mean over local maxima, or the
    weighted gains, may be far off there and leave a residual that drifts; a noise that drifts would then excuse
    any gain: a vicious circle. For the same reason the gains are by default those of the data alone: a prior that is wrong
    for a driver must not count its misfit as noise.
    """
    if not fine:
        best = np.unravel_index(int(np.argmax(grid.log)), grid.log.shape)
        taus = np.array([c.tau[k] for c, k in zip(grid.cells, best, strict=True)])
        dead_times = np.array([c.dead_time[k] for c, k in zip(grid.cells, best, strict=True)])
        return _plain(
            data, by_channel(layout, reduced_basis.weights(layout.basis, taus, dead_times)), taus, dead_times
        )
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    taus = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_times = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    nodes = by_channel(layout, reduced_basis.weights(layout.basis, taus, dead_times))
    of = grid.data_K if gains is None else gains
    return _point(data, nodes, taus, dead_times, np.array([np.vdot(grid.weight, K) for K in of]))


def _plain(data: Data, nodes: Array, taus: Array, dead_times: Array) -> Point:
    """Gains and offset by plain least squares on given answers."""
    answers, y = nodes @ data.X, data.y
    if data.bounded.any():
        answers, y = answers * data.usable, y * data.usable
    gains = np.asarray(np.linalg.lstsq(answers.T, y, rcond=None)[0], dtype=np.float64)
    return _point(data, nodes, taus, dead_times, gains)


def _point(data: Data, nodes: Array, taus: Array, dead_times: Array, gains: Array) -> Point:
    w = gains @ nodes
    return Point(gains, taus, dead_times, data.y_mean - float(w @ data.X_mean), w)


# share of the residual that a pass may still move the simulation by: its noise model would come out the same
SAME_SHARE = 0.05


def _centred(now: fopdt_posterior.Region, then: fopdt_posterior.Region) -> bool:
    """Whether a grid around one region still serves another: centre and widths to a quarter of an sd."""
    return (
        abs(now.tau - then.tau) <= 0.25 * then.tau_sd
        and abs(now.dead_time - then.dead_time - then.slope * (now.tau - then.tau)) <= 0.25 * then.rest_sd
        and 0.8 <= now.tau_sd / then.tau_sd <= 1.25
        and 0.8 <= now.rest_sd / then.rest_sd <= 1.25
    )


def is_fine(region: fopdt_posterior.Region, cells: fopdt_posterior.Cells) -> bool:
    """Whether the grid resolved the posterior: cells about as wide as one sd."""
    low, high = 0.95, fopdt_posterior.CELLS_PER_AXIS / 2.0
    # a spacing of zero happens where the box is only touched
    return all(
        low * space <= sd <= high * space
        for sd, space in ((region.tau_sd, cells.spacing[0]), (region.rest_sd, cells.spacing[1]))
    )
