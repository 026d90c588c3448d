"""Search for the joint posterior of all channels: on its own grid, the noise model refitted with each pass.

It starts on the whole physical box (or where the last window's posterior was), closes in, and refits the noise model each
time. For a given noise model there is no descent that could stop in a local minimum; gains and noise model are fitted in
turn, though, and two pairs may each reproduce themselves: a whole drive is searched from several starts
(several_starts.py).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import band, innovation_law
from canid.mathematics.identification.fopdt import (
    fopdt_posterior,
    information_bounds,
    input_noise,
    posterior_cells,
    posterior_channels,
    posterior_region,
    reduced_basis,
    row_noise,
)
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.prior import InputPrior, density, states_all
from canid.mathematics.identification.fopdt.row_noise import (
    Data,
    Noise,
    Point,
    by_channel,
    power,
    residual_of,
)
from canid.values.state_constraints import FINITE
from canid.values.types import NAN, Array, Channel

# samples, and rows, that are worked on at once: 2,048 of two inputs take 1 MB. A drive's rows are held once, 18 MB an
# hour, of a whole drive twice (vehicle_band.py); whatever is made of all of them is made in such pieces.
CHUNK_ROWS = 2048

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

    regions: Annotated[tuple[posterior_cells.Region, ...], FINITE]
    cells: Annotated[tuple[posterior_cells.Cells, ...], FINITE]
    W: Annotated[tuple[Array, ...], FINITE]  # per channel (c, b)


class Start(NamedTuple):
    """Initial guess that the next window takes over from this one."""

    point: Annotated[Point, FINITE]
    search_grid: SearchGrid


class Optimum(NamedTuple):
    """One of several answers that fit the data about as well."""

    channels: tuple[Channel, ...]
    share: float  # of the posterior


class ProcessFit(NamedTuple):
    """The joint fit. NaN values and `Identifiable.NOT` where the data do not identify it."""

    channels: tuple[Channel, ...]
    point: Point  # the posterior's mean
    noise: Array  # (p,) autoregression of every `stride`-th row
    stride: int
    sigma: float  # root mean square of the whitened residual
    variance_inflation: float  # >= 1: inflation of variances by the autocorrelation that whitening left
    law: innovation_law.Law | None  # of the innovations; None: no estimate
    drift: float  # walk of the offset, see offset_drift.py; 0: it stays
    fit_percent: float  # of the simulated answer
    used: int  # rows
    start: Start | None  # for the next window
    posterior: fopdt_posterior.Grid | None = None  # of lags, dead times and gains together; None: no estimate
    score: float = NAN  # penalised log likelihood of the noise model, see row_noise.score; NaN: not asked for
    optima: tuple[Optimum, ...] = ()  # what the data may mean, see several_starts.py; none: one start


class Task(NamedTuple):
    """What is fitted."""

    layout: rows.Layout
    data: Data
    used: int  # rows that are usable
    prior: InputPrior | None
    limits: band.Strides  # of the noise model's stride
    scored: bool = False  # is the fit compared with others?
    slow: Array | None = None  # (m b, n) answers to the inputs as vehicles move them; None: as all there is


def enough(both: Array, usable: npt.NDArray[np.bool_], inputs: int) -> bool:
    """Whether answers and output (m b + 1, n) suffice for a fit of m inputs."""
    # a tenth of a window: below this the noise model and the response are not identifiable separately
    return int(usable.sum()) >= 20 * (inputs + 1) and bool(float(np.ptp(both[-1, usable])) > 0.0)


def ready(
    both: Array, usable: npt.NDArray[np.bool_], bounded: npt.NDArray[np.bool_], side: Array, count: int
) -> Data:
    """Make answers and output (m b + 1, n) ready in place; `usable`, `bounded`, `side` (n,), `count` rows are usable."""
    nothing = ~(usable | bounded)
    if count < len(usable):
        both[:, nothing] = 0.0
    mean = (both @ usable if bounded.any() else both.sum(axis=1)) / count
    both -= mean[:, None]
    if count < len(usable):
        both[:, nothing] = 0.0
    return Data(both, usable, bounded, side, float(mean[-1]), mean[:-1])


def search(task: Task, start: Start | None = None, continued: bool = True, least: int = 0) -> ProcessFit:
    """Close in on the posterior from the whole box, or from another window's.

    Args:
        task: what is fitted.
        start: of an overlapping window; None: the whole box.
        continued: another window starts from the last grid.
        least: noise models that are refitted on a fine grid, however little each moves the answer.
    """
    layout, data, prior, limits = task.layout, task.data, task.prior, task.limits
    known = start if start is not None else _initial(layout, data, prior)
    near = start is not None
    simulated = known.point.w @ data.X
    noise = row_noise.estimate(layout, data, known.point, simulated, limits, near=near)
    finished, passes = 0, 0
    for _ in range(MAX_PASSES):
        made = _pass(layout, data, known, noise, prior, simulated, passes > 0)
        simulated = made.simulated
        # a residual that was mostly misfit, and went: the search goes on, no noise model leads to another
        finished, passes = finished + (made.fine and made.moved <= 0.5), passes + made.fine
        settled = made.moved <= SAME_SHARE**2 and near and finished > least
        ended = made.fine and (settled or finished > MAX_NOISE_REFITS or passes >= MAX_FINE_PASSES)
        keep = made.stays or (ended and not continued)
        known = Start(made.point, known.search_grid if keep else _search_grid(layout, made.regions))
        if ended:
            break
        if finished < MAX_NOISE_REFITS:
            # far from the posterior the residual holds the answer itself, and its band shows nothing of the noise
            band_limits = limits._replace(least=noise.stride) if finished else limits
            near = near or finished > 0
            noise = row_noise.estimate(layout, data, made.point, simulated, band_limits, noise, near)
    fit = _finished(task, made, noise, known)
    if fit.posterior is None and start is not None:
        # the window before may have led here: once more from the whole box
        return search(task, None, continued)
    return fit


class _Pass(NamedTuple):
    """The posterior on one grid, and what it says of the next."""

    moments: fopdt_posterior.Moments
    grid: fopdt_posterior.Grid
    regions: tuple[posterior_cells.Region, ...]  # of the next grid
    point: Point
    simulated: Array  # (n,) at the point
    fine: bool  # the grid resolves the posterior and holds it
    stays: bool  # the next grid would be this one
    moved: float  # share of the residual by which the simulation moved


def _pass(
    layout: rows.Layout,
    data: Data,
    known: Start,
    noise: Noise,
    prior: InputPrior | None,
    simulated: Array,
    near: bool,
) -> _Pass:
    """Evaluate the posterior on the grid of `known`; `simulated` (n,): at its point; `near`: see `_posterior_point`."""
    box = layout.basis.box
    moments, grid = _evaluate(layout, known.search_grid, noise, prior)
    every = range(layout.inputs)
    regions = tuple(posterior_region.gather(grid, i, box) for i in every)
    fine = all(is_fine(r, c) for r, c in zip(regions, grid.cells, strict=True))
    fine = fine and not any(posterior_region.missed(grid, i, box) for i in every)
    point = _posterior_point(layout, data, grid, fine, near)
    stays = fine and all(_centred(r, o) for r, o in zip(regions, known.search_grid.regions, strict=True))
    now = point.w @ data.X
    residual = power(noise.weighed.residual * noise.phases.data.usable)
    moved = power(now - simulated) / max(residual, 1e-300)
    return _Pass(moments, grid, regions, point, now, fine, stays, moved)


def _finished(task: Task, made: _Pass, noise: Noise, known: Start) -> ProcessFit:
    """The fit from the last pass; without an estimate where it explains too little of the output."""
    layout, data, prior, count = task.layout, task.data, task.prior, task.used
    m, grid, point, simulated = layout.inputs, made.grid, made.point, made.simulated
    if grid.gains is not None:
        point = _posterior_point(layout, data, grid, made.fine, True, grid.K)
        simulated = point.w @ data.X
    misfit = power(residual_of(data, simulated) * data.usable) / power(data.y * data.usable)
    fit_percent = 100.0 * (1.0 - misfit**0.5)
    credible = fit_percent >= MIN_FIT_PERCENT
    channels = (Channel(),) * m
    if credible:
        every = _limits(layout, made.moments, grid, point, noise)
        channels = posterior_channels.channels(
            grid,
            layout.basis.box,
            every,
            count * layout.step,
            prior is not None,
            () if prior is None or prior.gains is None else prior.gains.stated,
            prior is not None and states_all(prior),
        )
        if task.slow is not None and prior is None:
            slow = _limits(layout, made.moments, grid, point, noise, task.slow)
            inflation = noise.variance_inflation / noise.weighed.law.inflation
            channels = tuple(
                information_bounds.robust(channel, by_slow, by_every, layout.basis.box, inflation)
                for channel, by_slow, by_every in zip(channels, slow, every, strict=True)
            )
        elif prior is None:
            at = input_noise.Fitted(
                point.K,
                point.tau,
                point.dead_time,
                _variance(noise, grid, made.moments),
                noise.variance_inflation / noise.weighed.law.inflation,
            )
            channels = input_noise.believed(channels, every, made.moments, layout, at)
    sigma = noise.sd
    if math.isnan(sigma):
        sigma = (grid.residual * noise.stride / noise.weighed.counted) ** 0.5
    return ProcessFit(
        channels=channels,
        point=point,
        noise=noise.ar,
        stride=noise.stride,
        sigma=sigma,
        variance_inflation=noise.variance_inflation,
        law=noise.weighed.law,
        drift=0.0 if noise.drift is None else noise.drift.walk,
        fit_percent=fit_percent,
        used=count,
        start=known,
        posterior=grid if credible else None,
        score=row_noise.score(noise, layout.step) if task.scored else NAN,
    )


def no_fit(m: int, used: int = 0) -> ProcessFit:
    """Return the fit of m inputs without an estimate."""
    point = Point(np.full(m, NAN), np.full(m, NAN), np.full(m, NAN), NAN, np.zeros(0))
    return ProcessFit((Channel(),) * m, point, np.zeros(0), 1, NAN, 1.0, None, 0, NAN, used, None)


def _search_grid(layout: rows.Layout, regions: tuple[posterior_cells.Region, ...]) -> SearchGrid:
    cells = tuple(posterior_cells.make_cells(region, layout.basis.box) for region in regions)
    side = posterior_cells.CELLS_PER_AXIS
    tau = np.concatenate([c.tau[::side] for c in cells])
    dead_time = np.concatenate([c.dead_time for c in cells]).reshape(-1, side)
    every = reduced_basis.weights_on_grid(layout.basis, tau, dead_time)
    W = tuple(every.reshape(len(cells), side * side, -1))
    return SearchGrid(regions, cells, W)


@cache
def _whole(box: reduced_basis.Box) -> tuple[posterior_cells.Region, posterior_cells.Cells, Array]:
    region = posterior_cells.whole_box(box)
    cells = posterior_cells.make_cells(region, box)
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
    return Start(_posterior_point(layout, data, grid, False, False), search_grid)


def _moments(layout: rows.Layout, noise: Noise) -> fopdt_posterior.Moments:
    chunks = [row_noise.products(noise, i, CHUNK_ROWS) for i in range(0, len(noise.weighed.rows), CHUNK_ROWS)]
    # the phases of a stride know together about as much as one of them
    share = 1.0 / noise.stride
    sums = fopdt_posterior.Products(
        *(share * sum(parts[1:], parts[0]) for parts in zip(*chunks, strict=True))
    )
    sums = sums._replace(nuisance=sums.nuisance + np.diag(row_noise.precision(noise)))
    return fopdt_posterior.moments(sums, layout.inputs, round(share * noise.weighed.counted))


def _evaluate(
    layout: rows.Layout, search_grid: SearchGrid, noise: Noise, prior: InputPrior | None
) -> tuple[fopdt_posterior.Moments, fopdt_posterior.Grid]:
    known = _moments(layout, noise)
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
    answers: Array | None = None,
) -> tuple[information_bounds.Deviations, ...]:
    """What the data allow at the point that was found; `answers` (m b, n): what those would."""
    J = input_noise.slopes(at.K, reduced_basis.with_slopes(layout.basis, at.tau, at.dead_time))
    variance = _variance(noise, grid, moments)
    if answers is not None:
        moments = _moments(layout, row_noise.with_answers(noise, np.concatenate(J) @ answers))
        J = np.split(np.eye(3 * len(J)), len(J))
    return information_bounds.bounds(moments, J, variance, layout.basis.box)


def _variance(noise: Noise, grid: fopdt_posterior.Grid, moments: fopdt_posterior.Moments) -> float:
    """Of the whitened residual."""
    return noise.weighed.law.inflation * grid.residual / max(moments.freedom, 1)


def _posterior_point(
    layout: rows.Layout,
    data: Data,
    grid: fopdt_posterior.Grid,
    fine: bool,
    near: bool,
    gains: tuple[Array, ...] | None = None,
) -> Point:
    """Posterior mean: where a lag is not identifiable, the most likely cell is an accident.

    On a coarse grid, take the most likely cell: a mean over local maxima may be far off. Its gains are those of plain least
    squares, as long as no grid has resolved the posterior: the weighted gains of a noise model from far away may leave a
    residual that drifts; a noise that drifts would then excuse any gain: a vicious circle. From then on (`near`) they are
    the weighted ones: in a feedback loop with slow noise the plain ones are far off, and a noise model fitted to what they
    leave leads away from the maximum (a grid that has to be drawn anew would do that in every second pass).

    The gains are by default those of the data alone: a prior that is wrong for a driver must not count its misfit as noise.
    """
    K_used = grid.data_K if gains is None else gains
    if not fine:
        best = np.unravel_index(int(np.argmax(grid.log)), grid.log.shape)
        taus = np.array([c.tau[k] for c, k in zip(grid.cells, best, strict=True)])
        dead_times = np.array([c.dead_time[k] for c, k in zip(grid.cells, best, strict=True)])
        nodes = by_channel(layout, reduced_basis.weights(layout.basis, taus, dead_times))
        if near:
            return _point(data, nodes, taus, dead_times, np.array([K[best] for K in K_used]))
        return _plain(data, nodes, taus, dead_times)
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    taus = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_times = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    nodes = by_channel(layout, reduced_basis.weights(layout.basis, taus, dead_times))
    return _point(data, nodes, taus, dead_times, np.array([np.vdot(grid.weight, K) for K in K_used]))


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


def _centred(now: posterior_cells.Region, then: posterior_cells.Region) -> bool:
    """Whether a grid around one region still serves another: centre and widths to a quarter of an sd."""
    return (
        abs(now.tau - then.tau) <= 0.25 * then.tau_sd
        and abs(now.dead_time - then.dead_time - then.slope * (now.tau - then.tau)) <= 0.25 * then.rest_sd
        and 0.8 <= now.tau_sd / then.tau_sd <= 1.25
        and 0.8 <= now.rest_sd / then.rest_sd <= 1.25
    )


def is_fine(region: posterior_cells.Region, cells: posterior_cells.Cells) -> bool:
    """Whether the grid resolved the posterior: cells about as wide as one sd."""
    low, high = 0.95, posterior_cells.CELLS_PER_AXIS / 2.0
    # a spacing of zero happens where the box is only touched
    return all(
        low * space <= sd <= high * space
        for sd, space in ((region.tau_sd, cells.spacing[0]), (region.rest_sd, cells.spacing[1]))
    )
