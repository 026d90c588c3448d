"""First order plus dead time for every input jointly, y = b + sum K_i x_i(tau_i, theta_i) + AR(p) noise.

One window or a whole drive, from the rows that rows.py makes. The search is the posterior's own grid: it starts on
the whole physical box (or where the last window's posterior lay), closes in, and refits the noise's colour each
time; there is no descent that could stop in a side valley. K and the offset are linear inside (Golub & Pereyra 1973).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.identification import answers, autoregression, belief, posterior, residuals, rows
from canid.types import NAN, Array, Channel, Prior

# Highest order of the noise. Ornstein-Uhlenbeck noise is AR(1), a resonance AR(2), coloured plus white noise
# ARMA(1,1), which AR(4) follows to a per cent at 10 Hz.
NOISE_ORDER = 5

# Every how many rows may be used. An output that was smoothed (an acceleration from speeds) has noise
# without content above some frequency. Whitening would lift that empty band and fit K, tau and dead time to
# what leaked into it: on data/openacc at 10 Hz the halves of one drive then disagree by ten of their own sd.
# Point samples further apart limit the likelihood to the band that is left; the model is exact at any of them.
STRIDES = (1, 2, 4, 8)
# Least power, in shares of a flat spectrum's, that every eighth of the band must hold after whitening. White,
# Ornstein-Uhlenbeck, mixed and resonant noise keep 0.3 to 0.8 (a resonance at 0.6 Hz the least), noise that ends at
# 1 or 0.5 Hz 0.00 to 0.05 until the stride has left the empty band out.
CONTENT = 0.25

# Passes of the grid. From the whole box to 5 ms takes five; the rest is for an odd start.
PASSES = 16
# Passes on a fine grid after which the noise's colour is kept: with few samples two colours can lead to each other
# for ever.
SETTLED = 4

# %. Below this fit the noise has twice the output's variance: it must cancel the answer that it is said to be
# independent of, and the numbers rest on the last few samples' changes alone. A feedback loop makes the two oppose
# each other too, but not so far: of 690 estimates on simulated drives 4 were there, on real logs only absurd ones
# (a gain ten times the rest at a fit of -1240 %). This is no gate on a good fit, which proves nothing.
CANCELLING = 100.0 * (1.0 - 2.0**0.5)


class Point(NamedTuple):
    """One value of every parameter, noise aside."""

    K: Array  # (m,)
    tau: Array  # (m,) s
    dead_time: Array  # (m,) s
    offset: float
    w: Array  # (m b,) the simulated output is the offset and the basis' answers times these


class Laid(NamedTuple):
    """A grid that was laid out, with the weights of its cells."""

    regions: tuple[posterior.Region, ...]
    cells: tuple[posterior.Cells, ...]
    W: tuple[Array, ...]  # per channel (c, b)
    belief: Array | None  # log of the declared prior at each pair of cells


class Start(NamedTuple):
    """What the next window takes over from this one: only where to look first."""

    point: Point
    laid: Laid


class ProcessFit(NamedTuple):
    """The joint fit. NaN values and `Identifiable.NOT` where the data cannot tell."""

    channels: tuple[Channel, ...]
    point: Point  # the posterior's mean
    noise: Array  # (p,) autoregression of every `stride`-th row
    stride: int
    sigma: float  # of the whitened residual
    temper: float  # >= 1: how much the residual's left-over colour widens the intervals
    fit_percent: float  # of the simulated answer
    used: int  # rows
    start: Start | None  # for the next window


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

    Raises:
        ValueError: shapes that do not fit, or more than two inputs.

    >>> from canid.identification import first_order
    >>> rng = np.random.default_rng(0)
    >>> u = first_order.response(rng.normal(size=600), 0.1, 0.5, 0.0).x
    >>> y = 3.0 + 5.6 * first_order.response(u, 0.1, 0.4, 0.25).x + 0.05 * rng.normal(size=600)
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
    lay = layout(inputs.shape[1], dt, tau_max, dead_time_max)
    parts = np.zeros(len(output)) if segment is None else np.asarray(segment, float)
    samples = np.column_stack([np.asarray(output, float), usable, parts, inputs])
    most = len(samples) // lay.per_row + 1
    both, ready = np.empty((_height(lay), most)), np.zeros(most, bool)
    state, n = rows.State(), 0
    for i in range(0, len(samples), CHUNK):
        state, more = rows.put(lay, state, samples[i : i + CHUNK], tau_max + dead_time_max)
        part = slice(n, n + len(more))
        both[:, part], ready[part] = _columns(lay, more)
        n += len(more)
    return _fit(lay, both[:, :n], ready[:n], start, prior)


# samples, and rows, that are worked on at once: 2,048 of two inputs take 1 MB. A drive's rows are held once, 18 MB an
# hour; whatever is made of all of them is made in such pieces.
CHUNK = 2048


def layout(m: int, dt: float, tau_max: float, dead_time_max: float) -> rows.Layout:
    """Return the layout of the rows that `fit_rows` takes."""
    return rows.layout(answers.basis(answers.Box(answers.TAU_MIN, tau_max, dead_time_max)), m, dt)


class _Data(NamedTuple):
    """Rows made ready: finite, means taken out, zero where not usable."""

    both: Array  # (m b + 1, n) answers and output
    usable: npt.NDArray[np.bool_]  # (n,)
    y_mean: float
    X_mean: Array  # (m b,)

    @property
    def X(self) -> Array:  # noqa: N802
        """Return (m b, n) the basis' answers."""
        answered: Array = self.both[:-1]
        return answered

    @property
    def y(self) -> Array:
        """Return (n,) the output."""
        output: Array = self.both[-1]
        return output


def _height(lay: rows.Layout) -> int:
    """Answers and output."""
    return lay.inputs * lay.basis.size + 1


def _columns(lay: rows.Layout, window: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Answers and output of rows (m b + 1, n), and which are usable."""
    both = np.empty((_height(lay), len(window)))
    both[:-1], both[-1] = window[:, 2 + lay.inputs :].T, window[:, 0]
    return both, window[:, 1] > 0.0


def _ready(both: Array, usable: npt.NDArray[np.bool_], count: int) -> _Data:
    """Make ready in place."""
    if count < len(usable):
        both[:, ~usable] = 0.0
    mean = both.sum(axis=1) / count
    both -= mean[:, None]
    if count < len(usable):
        both[:, ~usable] = 0.0
    return _Data(both, usable, float(mean[-1]), mean[:-1])


def fit_rows(
    lay: rows.Layout, window: Array, start: Start | None = None, prior: Prior | None = None
) -> ProcessFit:
    """Fit a window of rows.

    Args:
        lay: of the rows.
        window: (n, width) from `rows.put`.
        start: of an overlapping window.
        prior: declared belief; None: the box alone.
    """
    return _fit(lay, *_columns(lay, window), start, prior)


def _fit(
    lay: rows.Layout,
    both: Array,
    usable: npt.NDArray[np.bool_],
    start: Start | None,
    prior: Prior | None,
) -> ProcessFit:
    """Fit answers and output (m b + 1, n), which are used up."""
    m = lay.inputs
    count = int(usable.sum())
    # a tenth of a window: below this the colour of the noise cannot be told from the answer
    if count < 20 * (m + 1) or not float(np.ptp(both[-1, usable])) > 0.0:
        return nothing(m, count)
    return _search(lay, _ready(both, usable, count), count, start, prior)


def _search(
    lay: rows.Layout, data: _Data, count: int, start: Start | None, prior: Prior | None
) -> ProcessFit:
    """Close in on the posterior from the whole box, or from another window's."""
    m, box = lay.inputs, lay.basis.box
    known = start if start is not None else _cold(lay, data, prior)
    simulated = known.point.w @ data.X
    colour = _colour(lay, data, known.point, simulated)
    finished = 0
    for _ in range(PASSES):
        moments, grid = _look(lay, data, known.laid, colour)
        regions = tuple(posterior.gather(grid, i, box) for i in range(m))
        fine = all(_fine(r, c) for r, c in zip(regions, grid.cells, strict=True))
        fine = fine and not any(posterior.missed(grid, i, box) for i in range(m))
        point = _middle(lay, data, grid, fine)
        stays = fine and all(_centred(r, o) for r, o in zip(regions, known.laid.regions, strict=True))
        known = Start(point, known.laid if stays else _lay(lay, regions, prior))
        last, simulated = simulated, point.w @ data.X
        moved = _power(simulated - last) / max(_power(colour.residual), 1e-300)
        same = moved <= SAME**2
        # a residual that was mostly misfit, and went: the search goes on, no colour leads to another
        finished += fine and moved <= 0.5
        if fine and (same or finished > SETTLED):
            break
        if finished < SETTLED:
            # far from the posterior the residual holds the answer itself, and its band says nothing of the noise
            colour = _colour(lay, data, point, simulated, colour.stride if finished else 1)
    fit_percent = 100.0 * (1.0 - (_power(_residual(data, simulated)) / _power(data.y)) ** 0.5)
    told = fit_percent >= CANCELLING
    if not told and start is not None:
        # the window before may have led here: once more from the whole box
        return _search(lay, data, count, None, prior)
    return ProcessFit(
        channels=posterior.channels(grid, box, _limits(lay, moments, grid, known.point), prior is not None)
        if told
        else (Channel(),) * m,
        point=known.point,
        noise=colour.noise,
        stride=colour.stride,
        sigma=(grid.residual / int(colour.rows.sum())) ** 0.5,
        temper=colour.temper,
        fit_percent=fit_percent,
        used=count,
        start=known,
    )


class _Colour(NamedTuple):
    """The noise as it looks from one point."""

    noise: Array  # (p,)
    stride: int  # rows from one that is used to the next
    first: int  # the first that is used; the newest always is
    rows: npt.NDArray[np.bool_]  # (n/stride,) whose predecessors are usable too
    residual: Array  # (n,) not whitened, zero where not usable
    temper: float


def nothing(m: int, used: int = 0) -> ProcessFit:
    """Return the fit of m inputs that tells nothing."""
    point = Point(np.full(m, NAN), np.full(m, NAN), np.full(m, NAN), NAN, np.zeros(0))
    return ProcessFit((Channel(),) * m, point, np.zeros(0), 1, NAN, 1.0, NAN, used, None)


def _lay(lay: rows.Layout, regions: tuple[posterior.Region, ...], prior: Prior | None) -> Laid:
    cells = tuple(posterior.lay(region, lay.basis.box) for region in regions)
    side = posterior.CELLS
    tau = np.concatenate([c.tau[::side] for c in cells])
    dead_time = np.concatenate([c.dead_time for c in cells]).reshape(-1, side)
    every = answers.weights_on_grid(lay.basis, tau, dead_time)
    W = tuple(every.reshape(len(cells), side * side, -1))
    return Laid(regions, cells, W, belief.log_density(prior, cells) if prior is not None else None)


@cache
def _whole(box: answers.Box) -> tuple[posterior.Region, posterior.Cells, Array]:
    region = posterior.whole_box(box)
    cells = posterior.lay(region, box)
    return region, cells, answers.weights(answers.basis(box), cells.tau, cells.dead_time)


def _cold(lay: rows.Layout, data: _Data, prior: Prior | None) -> Start:
    """Look at the whole box as if the noise were white: the least residual there shows the noise's colour."""
    m, n = lay.inputs, len(data.y)
    region, cells, W = _whole(lay.basis.box)
    every = (cells,) * m
    laid = Laid(
        (region,) * m, every, (W,) * m, belief.log_density(prior, every) if prior is not None else None
    )
    white = _Colour(np.zeros(0), 1, 0, data.usable, np.zeros(n), 1.0)
    return Start(_middle(lay, data, _look(lay, data, laid, white)[1], False), laid)


def _spread(lay: rows.Layout, w: Array) -> Array:
    """(m, m b) from (m, b): row i picks channel i's answer from those of all channels."""
    out = np.zeros((lay.inputs, w.size))
    for i, row in enumerate(w):
        out[i, i * len(row) : (i + 1) * len(row)] = row
    return out


def _power(x: Array) -> float:
    return float(x @ x)


def _residual(data: _Data, simulated: Array) -> Array:
    """(n,) not whitened, mean zero, zero where not usable."""
    usable = data.usable.astype(float)
    residual: Array = (data.y - simulated) * usable
    residual -= float(residual.sum()) / float(usable.sum()) * usable
    return residual


def _colour(lay: rows.Layout, data: _Data, at: Point, simulated: Array, least: int = 1) -> _Colour:
    """Look at the noise from one point.

    Args:
        lay: of the rows.
        data: the window.
        at: the point.
        simulated: (n,) the answer there, its mean taken out.
        least: stride; a shorter one was found too short in this fit already.
    """
    residual = _residual(data, simulated)
    each = answers.with_slopes(lay.basis, at.tau, at.dead_time)
    look = np.concatenate([_spread(lay, w) for w in each]) @ data.X
    # counted from the newest row, which is always taken
    phase = (len(residual) - 1) % STRIDES[-1]
    for stride in STRIDES[STRIDES.index(least) :]:
        pick = slice(phase % stride, None, stride)
        r, usable, J = residual[pick], data.usable[pick], look[:, pick]
        # one round from the residual's own colour: from round to round a noise that drifts could excuse ever more drift
        noise = autoregression.fit(r, usable, NOISE_ORDER)
        taken = _taken(lay, at, J, r, noise, autoregression.whole(usable, len(noise)))
        noise = autoregression.fit(np.vstack([r, taken]), usable, NOISE_ORDER)
        inside = autoregression.whole(usable, len(noise))
        white = autoregression.whiten(np.vstack([r, J]), noise)
        if _flat(white[0] * inside):
            break
    white = white[:, autoregression.chosen(inside)]
    e, score = white[0], white[1:] - white[1:].mean(axis=1, keepdims=True)
    sd = (_power(e) / max(len(e), 1)) ** 0.5
    temper = residuals.left_over(score * e, score * sd, round(residuals.CORRELATED / lay.step / stride))
    # as many independent looks at the noise as the window holds: its variance over its spectrum at zero frequency
    long_run = (sd / (1.0 - float(np.sum(noise)))) ** 2
    looks = _power(r) / max(long_run, 1e-300)
    return _Colour(noise, stride, phase % stride, inside, residual, temper * _student(looks) ** 2)


# Fewest looks that Student's t is taken for: below, its tails say more about the formula than about the noise.
FEWEST_LOOKS = 4.0


def _student(looks: float) -> float:
    """How much wider Student's t is than a Gaussian at 95 % (Fisher & Cornish 1960, to second order).

    >>> round(1.95996 * _student(10.0), 2)  # tables: 2.23
    2.23
    """
    z2, v = 1.959964**2, max(looks, FEWEST_LOOKS)
    return 1.0 + (z2 + 1.0) / (4.0 * v) + (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * v * v)


def _taken(
    lay: rows.Layout, at: Point, look: Array, r: Array, noise: Array, inside: npt.NDArray[np.bool_]
) -> Array:
    """Return (3 m + 1, n): what else the answer and the offset may be, each direction by its own sd.

    Args:
        lay: of the rows.
        at: the point.
        look: (3 m, n) answers, and their derivatives by tau and by dead time, of unit gain.
        r: (n,) residual.
        noise: its colour so far.
        inside: (n,) rows to weigh.
    """
    m = lay.inputs
    J = np.vstack([look[:m], np.tile(at.K, 2)[:, None] * look[m:], np.ones(len(r))])
    white = autoregression.whiten(np.vstack([r, J]), noise)[:, autoregression.chosen(inside)]
    variance = _power(white[0]) / max(white.shape[1] - len(J), 1)
    by_tau, by_dead_time = posterior.precision(lay.basis.box)
    least = np.concatenate([np.zeros(m), np.full(m, by_tau), np.full(m, by_dead_time), [0.0]])
    information = white[1:] @ white[1:].T + np.diag(variance * least)
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    value, vector = np.linalg.eigh(information / np.outer(size, size))
    known = value > 1e-9
    root = vector[:, known] / np.sqrt(value[known])
    out: Array = variance**0.5 * (root.T / size) @ J
    return out


def _flat(e: Array) -> bool:
    """Whether a whitened residual, zero where there is none, has content up to the end of the band, see CONTENT."""
    power = np.abs(np.fft.rfft(e)[1:]) ** 2
    # ten frequencies in a part at least: their mean is then known to a third
    parts = min(8, len(power) // 10)
    if parts < 2:
        return True
    share = power[len(power) % parts :].reshape(parts, -1).mean(axis=1)
    return bool(share.min() >= CONTENT * share.mean())


def _look(
    lay: rows.Layout, data: _Data, laid: Laid, colour: _Colour
) -> tuple[posterior.Moments, posterior.Grid]:
    found = [_products(data, colour, i) for i in range(0, len(colour.rows), CHUNK)]
    sums = posterior.Products(*(sum(parts[1:], parts[0]) for parts in zip(*found, strict=True)))
    known = posterior.moments(sums, lay.inputs, int(np.count_nonzero(colour.rows)))
    return known, posterior.evaluate(known, laid.W, laid.cells, colour.temper, laid.belief)


def _products(data: _Data, colour: _Colour, first: int) -> posterior.Products:
    """Of a piece of the rows that the colour uses, from its `first` on."""
    pick, p = slice(colour.first, None, colour.stride), len(colour.noise)
    begin = max(first - p, 0)
    # with the rows before that whitening looks back at
    piece, new = slice(begin, first + CHUNK), slice(first - begin, None)
    r, usable = colour.residual[pick][piece], colour.rows[piece][new].astype(float)
    nuisance = np.zeros((p + 1, len(r)))
    nuisance[0] = 1.0
    for i, row in enumerate(nuisance[1:], 1):
        row[i:] = r[:-i]
    white = autoregression.whiten(data.both[:, pick][:, piece], colour.noise)
    return posterior.products(white[:, new] * usable, nuisance[:, new] * usable)


def _limits(
    lay: rows.Layout, moments: posterior.Moments, grid: posterior.Grid, at: Point
) -> tuple[posterior.Deviations, ...]:
    """What the data allow at the point that was found."""
    by_K, by_tau, by_dead_time = (
        _spread(lay, w) for w in answers.with_slopes(lay.basis, at.tau, at.dead_time)
    )
    J = [np.array([by_K[i], K * by_tau[i], K * by_dead_time[i]]) for i, K in enumerate(at.K)]
    return posterior.bounds(moments, J, grid.residual / max(moments.freedom, 1), lay.basis.box)


def _middle(lay: rows.Layout, data: _Data, grid: posterior.Grid, fine: bool) -> Point:
    """Take the posterior's mean: where a lag cannot be told, the most likely cell is an accident.

    On a coarse grid, take the most likely cell with the gains of plain least squares. A mean over valleys, or the
    weighted gains, may be far off there and leave a residual that drifts; a noise that drifts would then excuse
    any gain: a vicious circle.
    """
    if not fine:
        best = np.unravel_index(int(np.argmax(grid.log)), grid.log.shape)
        taus = np.array([c.tau[k] for c, k in zip(grid.cells, best, strict=True)])
        dead_times = np.array([c.dead_time[k] for c, k in zip(grid.cells, best, strict=True)])
        return _plain(data, _spread(lay, answers.weights(lay.basis, taus, dead_times)), taus, dead_times)
    weights = [posterior.marginal(grid, i) for i in range(lay.inputs)]
    taus = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_times = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    nodes = _spread(lay, answers.weights(lay.basis, taus, dead_times))
    return _point(data, nodes, taus, dead_times, np.array([np.vdot(grid.weight, K) for K in grid.K]))


def _plain(data: _Data, nodes: Array, taus: Array, dead_times: Array) -> Point:
    """Gains and offset by plain least squares on given answers."""
    gains = np.asarray(np.linalg.lstsq((nodes @ data.X).T, data.y, rcond=None)[0], dtype=np.float64)
    return _point(data, nodes, taus, dead_times, gains)


def _point(data: _Data, nodes: Array, taus: Array, dead_times: Array, gains: Array) -> Point:
    w = gains @ nodes
    return Point(gains, taus, dead_times, data.y_mean - float(w @ data.X_mean), w)


# share of the residual that a pass may still move the simulation by: its colour would come out the same
SAME = 0.05


def _centred(now: posterior.Region, then: posterior.Region) -> bool:
    """Whether a grid laid around one region still serves another: centre and widths to a quarter of an sd."""
    return (
        abs(now.tau - then.tau) <= 0.25 * then.tau_sd
        and abs(now.dead_time - then.dead_time - then.slope * (now.tau - then.tau)) <= 0.25 * then.rest_sd
        and 0.8 <= now.tau_sd / then.tau_sd <= 1.25
        and 0.8 <= now.rest_sd / then.rest_sd <= 1.25
    )


def _fine(region: posterior.Region, cells: posterior.Cells) -> bool:
    """Whether the grid resolved the posterior: cells about as wide as one sd."""
    low, high = 0.95, posterior.CELLS / 2.0
    # a spacing of zero happens where the box is only touched
    return all(
        low * space <= sd <= high * space
        for sd, space in ((region.tau_sd, cells.spacing[0]), (region.rest_sd, cells.spacing[1]))
    )
